"""Level sets: one source for colliders, prescribed regions and bodies to fill.

A shape is a NamedTuple of floats (`solids`), made by `half_space`, `box`, `sphere`, `cylinder`,
`capsule`, `torus` or `wedge`. `distance(x, shape)` [m] is negative inside; `normal(x, shape)` is
its gradient, a unit vector that points outward. Both take a point as a tuple (`primitives`);
`distances` and `normals` map them over arrays.
"""

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel, prange
from .primitives import distance, normal
from .solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Sphere,
    Torus,
    Wedge,
    box,
    capsule,
    check_dimension,
    cylinder,
    half_space,
    sphere,
    torus,
    wedge,
)
from .tensor import put_vec, vec

__all__ = [
    "SHAPES",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Sphere",
    "Torus",
    "Wedge",
    "box",
    "capsule",
    "cylinder",
    "distance",
    "distances",
    "half_space",
    "normal",
    "normals",
    "sphere",
    "torus",
    "wedge",
]

SHAPES = (HalfSpace, Box, Sphere, Cylinder, Capsule, Torus, Wedge)


@kernel
def _distances(x, shape, out, like, bounds):
    for p in range(bounds[0], bounds[1]):
        out[p] = distance(vec(x, p, like), shape)


@kernel
def _normals(x, shape, out, like, bounds):
    for p in range(bounds[0], bounds[1]):
        put_vec(out, p, normal(vec(x, p, like), shape))


@parallel
def _all_distances(x, shape, out, like):
    for c in prange(CHUNKS):
        _distances(x, shape, out, like, chunk(c, len(x)))


@parallel
def _all_normals(x, shape, out, like):
    for c in prange(CHUNKS):
        _normals(x, shape, out, like, chunk(c, len(x)))


def distances(x, shape):
    """Signed distances (N,) [m] of points x (N, d) to the surface of a shape; negative inside.

    Raises ValueError for a shape that is not for d dimensions.
    """
    x, like = _points(x, shape)
    out = np.empty(len(x))
    _all_distances(x, shape, out, like)
    return out


def normals(x, shape):
    """Outward unit normals (N, d) of a shape at points x (N, d); see `distances`."""
    x, like = _points(x, shape)
    out = np.empty_like(x)
    _all_normals(x, shape, out, like)
    return out


def _points(x, shape):
    """The points as a C-contiguous array, and a tuple of length d."""
    x = np.ascontiguousarray(x, dtype=float)
    if x.ndim != 2 or x.shape[1] not in (2, 3):
        raise ValueError(f"points of shape {x.shape}: expected (N, 2) or (N, 3)")
    check_dimension(shape, x.shape[1])
    return x, x.shape[1] * (0.0,)
