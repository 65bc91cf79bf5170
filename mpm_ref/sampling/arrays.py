"""Read and check arrays of particles, from memory or from a file (NPZ or HDF5).

Names are those of `core.state.Particles`; N particles in d dimensions:

    x (N, d)   needed            v (N, d)      C (N, d, d)      F (N, d, d), or J (N,) for a fluid
    two of m, V0 and density (N,)            y (N,) yield stress          body (N,) whole numbers

Arrays of other names in a file are ignored.
"""

from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np


class Quantity(NamedTuple):
    """The number of axes of an array besides that of the particles, and its description."""

    axes: int
    text: str
    positive: bool = False


QUANTITIES = {
    "x": Quantity(1, "positions [m]"),
    "v": Quantity(1, "velocities [m/s]"),
    "C": Quantity(2, "affine velocity gradients [1/s]"),
    "F": Quantity(2, "deformation gradients [1]"),
    "J": Quantity(0, "volume ratios det F [1]", positive=True),
    "m": Quantity(0, "masses [kg]", positive=True),
    "V0": Quantity(0, "volumes at rest [m^d]", positive=True),
    "density": Quantity(0, "densities at rest [kg/m^3]", positive=True),
    "y": Quantity(0, "yield stresses [Pa]"),
    "body": Quantity(0, "numbers of bodies"),
}


class NoGroup(ValueError):
    """The requested group is missing in an HDF5 file."""


def read_arrays(file, dim, group="/", select=None):
    """Return the checked arrays {name: array} of a file; `select` takes one value of `body`.

    Raises ValueError, in one sentence, for a file that cannot be read, and as `check_arrays`.
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
    return _selected(check_arrays(arrays, dim), select)


def _read_npz(path, group):
    with path.open("rb") as stream:
        data = np.load(stream, allow_pickle=False)
        if not isinstance(data, np.lib.npyio.NpzFile):
            raise ValueError("not an NPZ archive")
        return {name: data[name] for name in QUANTITIES if name in data.files}


def _read_hdf5(path, group):
    with h5py.File(path, "r") as h5:
        if not isinstance(h5.get(group), h5py.Group):
            raise NoGroup(f"group = {group!r}: the file has no such group")
        data = h5[group]
        return {name: data[name][()] for name in QUANTITIES
                if isinstance(data.get(name), h5py.Dataset)}


def check_arrays(arrays, dim):
    """Return the arrays {name: array} of N particles as contiguous float64, `body` as it is.

    Raises ValueError, in one sentence with shape and unit, for an array that is missing, has
    another shape than its particles, or holds what no particle can have.
    """
    if "x" not in arrays:
        present = ", ".join(arrays) or "none that has a meaning"
        raise ValueError(f"the array x is missing; found {present}; expected x of shape (N, {dim}),"
                         f" {QUANTITIES['x'].text}")
    n = len(np.atleast_1d(arrays["x"]))
    if n == 0:
        raise ValueError("the array x holds no particle")
    return {name: _numbers(name, a, (n, *QUANTITIES[name].axes * (dim,)))
            for name, a in arrays.items()}


def _numbers(name, a, shape):
    a, (_, text, positive) = np.asarray(a), QUANTITIES[name]
    if a.shape != shape:
        raise ValueError(f"the array {name} has shape {a.shape}: expected {shape}, {text}")
    kinds = "iu" if name == "body" else "iuf"
    if a.dtype.kind not in kinds:
        expected = "whole numbers" if name == "body" else "real numbers"
        raise ValueError(f"the array {name} has type {a.dtype}: expected {expected}, {text}")
    if name == "body":
        return a
    a = np.ascontiguousarray(a, dtype=np.float64)
    good = np.isfinite(a) & (a > (0.0 if positive else -np.inf))
    if not good.all():
        p = tuple(int(k) for k in np.argwhere(~good)[0])
        expected = "a finite number" + (" > 0" if positive else "")
        raise ValueError(f"the array {name} has {a[p]} for particle {p[0]}: expected {expected}, "
                         f"{text}")
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
