"""Particles from a file of arrays, NPZ or HDF5, so that the state of any program can be run.

Names are those of `core.state.Particles`; N particles in d dimensions:

    x (N, d)   needed            v (N, d)      C (N, d, d)      F (N, d, d), or J (N,) for a fluid
    m, V0 (N,) one of them, or both          y (N,) yield stress          body (N,) whole numbers

Arrays of other names are left alone.
"""

from pathlib import Path

import h5py
import numpy as np

AXES = {"x": 1, "v": 1, "C": 2, "F": 2, "J": 0, "m": 0, "V0": 0, "y": 0, "body": 0}
ABOVE_ZERO = ("m", "V0", "J")


class NoGroup(ValueError):
    """An HDF5 file without the group asked for."""


def read_arrays(file, dim, group="/", select=None):
    """Checked arrays {name: array} of a file; `select` keeps the particles with that `body`.

    Raises ValueError, in one sentence, for a file that cannot be read, and for an array that is
    missing, has another shape than its particles, or holds what no particle can have.
    """
    path = Path(file)
    if not path.is_file():
        raise ValueError(f"file = {str(file)!r}: no such file")
    read = {".npz": _read_npz, ".h5": _read_hdf5, ".hdf5": _read_hdf5}.get(path.suffix.lower())
    if read is None:
        raise ValueError(f"file = {str(file)!r}: expected a name that ends in .npz, .h5 or .hdf5")
    try:
        arrays = read(path, group)
    except NoGroup:
        raise
    except Exception as fault:      # what broken files raise in NumPy and h5py has no common class
        raise ValueError(f"file = {str(file)!r}: cannot be read ({fault})") from None
    return _selected(_checked(arrays, dim), select)


def _read_npz(path, group):
    with path.open("rb") as stream:
        data = np.load(stream, allow_pickle=False)
        if not isinstance(data, np.lib.npyio.NpzFile):
            raise ValueError("not an NPZ archive")
        return {name: data[name] for name in AXES if name in data.files}


def _read_hdf5(path, group):
    with h5py.File(path, "r") as h5:
        if not isinstance(h5.get(group), h5py.Group):
            raise NoGroup(f"group = {group!r}: the file has no such group")
        there = h5[group]
        return {name: there[name][()] for name in AXES if isinstance(there.get(name), h5py.Dataset)}


def _checked(arrays, dim):
    """The arrays as numbers, if they belong to the same particles."""
    if "x" not in arrays:
        found = ", ".join(arrays) or "none that is known"
        raise ValueError(f"the array x is missing; found {found}")
    n = len(np.atleast_1d(arrays["x"]))
    if n == 0:
        raise ValueError("the array x holds no particle")
    return {name: _numbers(name, a, (n, *AXES[name] * (dim,))) for name, a in arrays.items()}


def _numbers(name, a, shape):
    a = np.asarray(a)
    if a.shape != shape:
        raise ValueError(f"the array {name} has shape {a.shape}: expected {shape}")
    kinds = "iu" if name == "body" else "iuf"
    if a.dtype.kind not in kinds:
        expected = "whole numbers" if name == "body" else "real numbers"
        raise ValueError(f"the array {name} has type {a.dtype}: expected {expected}")
    if name == "body":
        return a
    a = np.ascontiguousarray(a, dtype=np.float64)
    least = 0.0 if name in ABOVE_ZERO else -np.inf
    good = np.isfinite(a) & (a > least)
    if not good.all():
        p = tuple(int(k) for k in np.argwhere(~good)[0])
        expected = "a finite number" + (" > 0" if name in ABOVE_ZERO else "")
        raise ValueError(f"the array {name} has {a[p]} for particle {p[0]}: expected {expected}")
    return a


def _selected(arrays, body):
    if body is None:
        return arrays
    if "body" not in arrays:
        raise ValueError(f"select = {body}: the file has no array body to select by")
    chosen = arrays["body"] == body
    if not chosen.any():
        present = ", ".join(map(str, np.unique(arrays["body"])[:20]))
        raise ValueError(f"select = {body}: no particle has this body; there are {present}")
    return {name: np.ascontiguousarray(a[chosen]) for name, a in arrays.items()}
