"""Read and check arrays of particles, from memory or from a file (NPZ or HDF5).

Names are those of `core.state.Particles`; N particles in d dimensions:

    x (N, d)   needed            v (N, d)      C (N, d, d)      F (N, d, d), or J (N,) for a fluid
    two of m, V0 and density (N,)            y (N,) yield stress          body (N,) whole numbers

A file with arrays of other names is refused, unless they are to be ignored: a misnamed array would
be left out in silence. Shapes, types and sizes are checked before an array is read.
"""

import os
import zipfile
from difflib import get_close_matches
from math import prod
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


class BadArrays(ValueError):
    """A file has no such group, or arrays with other names, shapes or types than particles have."""


def read_arrays(file, dim, group="/", select=None, ignore=()):
    """Return the checked arrays {name: array} of a file; `select` takes one value of `body`.

    ignore: names of arrays that are not for us. Raises ValueError, in one sentence, for a file that
    cannot be read or has arrays of other names, and as `check_arrays`.
    """
    path = Path(file)
    if not path.is_file():
        raise ValueError(f"file = {str(file)!r}: no such file")
    archive = {".npz": Npz, ".h5": Hdf5, ".hdf5": Hdf5}.get(path.suffix.lower())
    if archive is None:
        raise ValueError(f"file = {str(file)!r}: expected a name that ends in .npz, .h5 or .hdf5")
    try:
        with archive(path, group) as arrays:
            heads = {name: head for name, head in arrays.heads().items() if name not in ignore}
            require_heads(heads, dim)
            read = {name: arrays.read(name) for name in heads}
    except BadArrays:
        raise
    except Exception as fault:      # what broken files raise in NumPy and h5py has no common class
        raise ValueError(f"file = {str(file)!r}: cannot be read ({fault})") from None
    return _selected(check_arrays(read, dim), select)


class Npz:
    """An NPZ file; `heads` are the shapes and types of its arrays, which no array is read for."""

    def __init__(self, path, group):
        if not zipfile.is_zipfile(path):
            raise ValueError("not an NPZ archive")
        self._zip, self._arrays = zipfile.ZipFile(path), np.load(path, allow_pickle=False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._zip.close()
        self._arrays.close()

    def heads(self):
        """Return {name: (shape, dtype)}."""
        return {name.removesuffix(".npy"): self._head(name) for name in self._zip.namelist()}

    def _head(self, name):
        with self._zip.open(name) as stream:
            version = np.lib.format.read_magic(stream)
            read = (np.lib.format.read_array_header_1_0 if version == (1, 0) else
                    np.lib.format.read_array_header_2_0)
            shape, _, dtype = read(stream)
        return shape, dtype

    def read(self, name):
        """Return an array."""
        return self._arrays[name]


class Hdf5:
    """The datasets of a group of an HDF5 file, as `Npz`."""

    def __init__(self, path, group):
        self._h5 = h5py.File(path, "r")
        self._group = self._h5.get(group)
        if not isinstance(self._group, h5py.Group):
            self._h5.close()
            raise BadArrays(f"group = {group!r}: the file has no such group")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._h5.close()

    def heads(self):
        """Return {name: (shape, dtype)}."""
        return {name: (item.shape, item.dtype) for name, item in self._group.items()
                if isinstance(item, h5py.Dataset)}

    def read(self, name):
        """Return an array."""
        return self._group[name][()]


def require_heads(heads, dim):
    """Raise BadArrays unless arrays with these {name: (shape, dtype)} can be those of particles."""
    for name in heads:
        if name not in QUANTITIES:
            near = ([other for other in QUANTITIES if other.lower() == name.lower()]
                    or get_close_matches(name, QUANTITIES, 1))
            hint = f"did you mean {near[0]}?" if near else f"expected {', '.join(QUANTITIES)}"
            raise BadArrays(f"the array {name} has no meaning: {hint}; the file has "
                            f"{', '.join(sorted(heads))}; rename it, or name it in `ignore`")
    n = _number(heads, {name: shape for name, (shape, _) in heads.items()}, dim)
    for name, (shape, dtype) in heads.items():
        _require_head(name, shape, dtype, (n, *QUANTITIES[name].axes * (dim,)))
    size = sum(prod(shape) * dtype.itemsize for shape, dtype in heads.values())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if size > memory:
        raise BadArrays(f"the arrays have {size / 1e9:.3g} GB: this machine has {memory / 1e9:.3g} "
                        "GB of memory; take fewer particles")


def _number(names, shapes, dim):
    """Return the number of particles."""
    if "x" not in names:
        present = ", ".join(names) or "none that has a meaning"
        raise BadArrays(f"the array x is missing; found {present}; expected x of shape (N, {dim}),"
                        f" {QUANTITIES['x'].text}")
    n = shapes["x"][0] if shapes["x"] else 1
    if n == 0:
        raise BadArrays("the array x holds no particle")
    return n


def _require_head(name, shape, dtype, expected):
    text = QUANTITIES[name].text
    if shape != expected:
        raise BadArrays(f"the array {name} has shape {shape}: expected {expected}, {text}")
    if dtype.kind not in ("iu" if name == "body" else "iuf"):
        kind = "whole numbers" if name == "body" else "real numbers"
        raise BadArrays(f"the array {name} has type {dtype}: expected {kind}, {text}")


def check_arrays(arrays, dim):
    """Return the arrays {name: array} of N particles as contiguous float64, `body` as it is.

    Raises ValueError, in one sentence with shape and unit, for an array that is missing, has
    another shape than its particles, or holds what no particle can have.
    """
    arrays = {name: np.asarray(a) for name, a in arrays.items()}
    n = _number(arrays, {name: a.shape for name, a in arrays.items()}, dim)
    return {name: _numbers(name, a, (n, *QUANTITIES[name].axes * (dim,)))
            for name, a in arrays.items()}


def _numbers(name, a, shape):
    _, text, positive = QUANTITIES[name]
    _require_head(name, a.shape, a.dtype, shape)
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
