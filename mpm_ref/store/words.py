"""Numbers of things for people, and records of parameters as plain values."""

import hashlib

import numpy as np


def counted(n, noun):
    """A number with its noun, which gets an s unless it is 1: 1 frame, 2 frames."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def plain(record):
    """A NamedTuple of parameters as a dict of plain values with its `type`; an array is the sha256
    of what it holds.
    """
    values = {name: hashlib.sha256(value).hexdigest() if isinstance(value, np.ndarray) else value
              for name, value in record._asdict().items()}
    return {"type": type(record).__name__, **values}
