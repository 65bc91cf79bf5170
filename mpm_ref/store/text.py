"""Turn counts into text and records of parameters into plain values."""

import hashlib

import numpy as np

LONGEST = 60            # characters of a label in a figure

def counted(n, noun):
    """Return a number with its noun, in the plural unless it is 1: 1 frame, 2 frames."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def figure_text(text):
    """Return a text as a label of a Matplotlib figure: its `$` begin no formula, and a long one
    loses its middle.
    """
    half = LONGEST // 2
    short = text if len(text) <= LONGEST else f"{text[:half]}...{text[-half:]}"
    return " ".join(short.split()).replace("$", r"\$")


def plain(record):
    """Return a NamedTuple of parameters as a dict of plain values with its `type`.

    An array becomes the sha256 of its bytes.
    """
    values = {name: hashlib.sha256(value).hexdigest() if isinstance(value, np.ndarray) else value
              for name, value in record._asdict().items()}
    return {"type": type(record).__name__, **values}
