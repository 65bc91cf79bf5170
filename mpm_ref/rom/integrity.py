"""Integrity of a reduced model in memory: the sha256 of each of its arrays.

A file is sealed, and refused where a bit of it differs. Arrays in memory are not: a damaged number
of a field makes a run that is smooth, and wrong. So a run is sealed before its first step and
compared after its last one.
"""

import hashlib

import numpy as np

from .model_file import flatten


class DamagedModel(RuntimeError):
    """Arrays of a reduced model that are not those of its seal."""


def seal(field):
    """Return {name of an array: sha256} of a field's record of arrays; {} of other objects."""
    if not hasattr(field, "_fields"):
        return {}
    return {name: digest(a) for name, a in flatten(field)}


def digest(a):
    """Return the sha256 of an array's type, shape and bytes."""
    a = np.ascontiguousarray(a)
    head = f"{a.dtype.str} {a.shape} ".encode()
    return hashlib.sha256(head + a.tobytes()).hexdigest()


def damaged_arrays(field, expected):
    """Return the names of a field's arrays that differ from its `seal`, or are in one alone."""
    found = seal(field)
    return sorted(name for name in {*found, *expected} if found.get(name) != expected.get(name))


def require_intact(field, expected):
    """Raise `DamagedModel` where a field is not that of its `seal`."""
    names = damaged_arrays(field, expected)
    if names:
        raise DamagedModel(f"arrays of the reduced model have changed in memory: {', '.join(names)}"
                           "; the states of this run are not to be trusted; load the model and run "
                           "again, and check the memory of the machine if it happens twice")
