"""Named arrays as a file that says its format and how it was made (see `sealed`).

A caller puts what `stated` gives among its arrays, where the bytes of its files have it, and tells
`write` and `read` what is wrong with arrays: fault_of, a function of them to a sentence or None.
"""

import json
import re
from pathlib import Path

import numpy as np

from .sealed import opened, sealed, write_whole

KINDS = {       # a format without its number -> the files that have it
    "": "maps, laws or stress fields", "gnn": "graph networks",
    "mpm_ref law": "layers of exported laws"}


def stated(path, format, about):
    """The arrays of a file that are no numbers: its format, and plain values on how it was made.

    Raises ValueError, which names the path, for an `about` with more than JSON knows (of which
    tuples come back as lists).
    """
    try:
        text = json.dumps(about, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} is not written: about: {error}; give numbers, text, lists and "
                         "dicts of them") from None
    return {"format": np.array(format), "about": np.array(text)}


def write(path, arrays, fault_of):
    """Write arrays; who reads the file meanwhile, or a crash, finds the old one or the new one.

    Raises ValueError where they have a fault, OSError where the system refuses.
    """
    if fault := fault_of(arrays):
        raise ValueError(f"{path} is not written: {fault}")
    write_whole(Path(path), sealed(arrays))


def read(path, format, fault_of, what):
    """The arrays of a file, and how it was made; what: in words, what they are of.

    Raises ValueError for a file that is damaged, of another format, or has a fault.
    """
    arrays = opened(Path(path))
    require_format(path, arrays, format, what)
    if fault := fault_of(arrays):
        raise ValueError(f"{path} holds no {what}: {fault}; train again")
    return arrays, about_of(path, arrays)


def format_of(arrays):
    """The format that a file names; in words where that is not one number."""
    found = arrays.get("format")
    return f"an array of shape {found.shape}" if np.ndim(found) else found


def kind_of(format):
    """The kind of files that have a format, in words; None for none of ours."""
    found = re.fullmatch(r"(.*?) ?\d+", str(format))
    return KINDS.get(found[1]) if found else None


def require_format(path, arrays, expected, what):
    """Raise ValueError unless a file is of the expected format; what: in words, what was asked
    for.
    """
    found = format_of(arrays)
    if found == expected:
        return
    if kind_of(found) not in (None, kind_of(expected)):
        raise ValueError(f"{path} holds no {what}, format {expected}: its format, {found}, is that "
                         f"of {kind_of(found)}; name another file")
    raise ValueError(f"{path} has format {found}, this program reads {expected}; use the version "
                     "that wrote it, or make it again")


def about_of(path, arrays):
    """What is known of a file's making, from its arrays. Raises ValueError for no JSON of it."""
    try:
        about = json.loads(str(arrays.get("about", "")))
    except ValueError as error:
        raise ValueError(f"{path} does not say how it was made: about is no JSON ({error}); copy "
                         "it again from where it came, or make it again") from None
    if not isinstance(about, dict):
        raise ValueError(f"{path} does not say how it was made: about is a "
                         f"{type(about).__name__}, expected a JSON object; make it again")
    return about
