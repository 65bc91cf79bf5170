"""Dense grid storage that covers the matter and moves with it, and the momentum update of nodes.

The grid is the smallest box of nodes that the particles reach, aligned to whole slabs along the
first axis; `sparse_grid` has that of bodies far from each other. A domain box is a boundary
condition (see `boundary`), not an array bound.
"""

from math import prod
from typing import NamedTuple

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .order import slab_width
from .precision import converted
from .spline import base_of
from .state import NONE, Grid

MAX_BYTES = 8e9
FINEST = 0.25           # of a cell: coordinates of particles are at least that exact


class OutOfRange(ValueError):
    """A particle is not finite, or so far away that no grid can cover it."""


@kernel
def _extent(x, low, high, bad, bounds):
    for p in range(bounds[0], bounds[1]):
        for a in range(x.shape[1]):
            if not np.isfinite(x[p, a]):
                bad[0] = p
                return
            low[a] = min(low[a], x[p, a])
            high[a] = max(high[a], x[p, a])


@parallel_if_many
def _extents(x, low, high, bad):
    for c in prange(CHUNKS):
        _extent(x, low[c], high[c], bad[c], chunk(c, len(x)))


def extent(x):
    """Smallest and largest coordinates of points x (N, d). Raises OutOfRange for a point that is
    not finite.
    """
    d = x.shape[1]
    low, high = np.full((CHUNKS, d), np.inf, x.dtype), np.full((CHUNKS, d), -np.inf, x.dtype)
    bad = np.full((CHUNKS, 1), -1)
    _extents(x, low, high, bad)
    if bad.max() >= 0:
        p = bad.max()
        raise OutOfRange(f"particle {p} has position {x[p]}: expected finite coordinates")
    return low.min(axis=0), high.max(axis=0)


class GridBox(NamedTuple):
    """A box of nodes."""

    first: np.ndarray       # (d,)  index of its first node, from the world's origin
    shape: tuple            # nodes along each axis
    real: type              # of the floats of its grid


class Storage:
    """Reusable storage of a `Grid` for spacing dx [m] and a stencil; see `cover`. The grid has the
    precision of the points that it covers.
    """

    def __init__(self, dx, stencil, dim, flip=False):
        self.dx, self.stencil, self.dim = dx, stencil, dim
        self.vectors = 3 if flip else 1
        self._buffer = NONE

    def cover(self, clouds):
        """Zeroed grid over all nodes that the points of `clouds`, arrays (N, d), reach.

        Raises OutOfRange where a point is not finite or too far away, or the box of nodes would
        need more than MAX_BYTES.
        """
        return self.zeroed(self.box(clouds))

    def box(self, clouds):
        """Return the `GridBox` of the points of `clouds`. Raises OutOfRange as `cover` does, but
        for its size.
        """
        extents = [extent(x) for x in clouds]
        low = np.min([e[0] for e in extents], axis=0)
        high = np.max([e[1] for e in extents], axis=0)
        farthest = FINEST / np.finfo(low.dtype).eps
        if max(-low.min(), high.max()) / self.dx > farthest:
            raise OutOfRange(
                f"particles from {low} to {high}: expected coordinates of at most {farthest:.0e} "
                f"times dx = {self.dx}, beyond which places in a cell are lost to round-off; has a "
                "particle flown off?"
            )
        first = self._base(low)
        first[0] -= first[0] % (2 * slab_width(self.stencil))     # see `order`
        shape = tuple(map(int, self._base(high) + len(self.stencil) - first))
        return GridBox(first, shape, low.dtype.type)

    def bytes(self, shape, box):
        """Return the memory [bytes] of arrays of a shape, for the matter in a `GridBox`."""
        return np.dtype(box.real).itemsize * prod(shape) * (1 + self.vectors * self.dim)

    def zeroed(self, box):
        """Return the zeroed dense grid of a `GridBox`. Raises OutOfRange as `fields`."""
        return Grid(*self.fields(box.shape, box), box.first, self.dx)

    def fields(self, shape, box):
        """Return zeroed arrays m, v, f, v_old of a shape, for the matter in a `GridBox`. Raises
        OutOfRange where they would need more than MAX_BYTES.
        """
        size = prod(shape)
        if self.bytes(shape, box) > MAX_BYTES:
            low, high = box.first * self.dx, (box.first + box.shape - 1) * self.dx
            raise OutOfRange(
                f"nodes from {low} to {high} need a grid of {self.bytes(shape, box):.1e} bytes at "
                f"dx = {self.dx}, at most {MAX_BYTES:.0e} are allowed; has a particle flown off, "
                "or is dx too small?"
            )
        needed = size * (1 + self.vectors * self.dim)
        if len(self._buffer) < needed or self._buffer.dtype != box.real:
            self._buffer = np.empty(int(1.3 * needed), box.real)
        self._buffer[:needed] = 0.0
        return self._carve(shape, size)

    def _base(self, x):
        dx = converted(self.dx, x.dtype.type)
        return np.array([base_of(x_a, dx, self.stencil) for x_a in x], dtype=np.int64)

    def _carve(self, shape, size):
        d, at, none = self.dim, size, converted(NONE, self._buffer.dtype.type)
        vectors = []
        for _ in range(self.vectors):
            vectors.append(self._buffer[at : at + size * d].reshape((*shape, d)))
            at += size * d
        v, f, v_old = vectors if self.vectors == 3 else (vectors[0], none, none)
        return self._buffer[:size].reshape(shape), v, f, v_old


@kernel
def _update(nodes, gravity, dt, eps, bounds):
    for i in range(bounds[0], bounds[1]):
        for a in range(len(gravity)):
            if nodes.m[i] > 0.0:
                nodes.v[i, a] = nodes.v[i, a] / (nodes.m[i] + eps) + dt * gravity[a]
            else:
                nodes.v[i, a] = 0.0     # a linear spline of weight 0 has a slope, hence a force


@kernel
def _update_apart(nodes, gravity, dt, bounds):
    for i in range(bounds[0], bounds[1]):
        if nodes.m[i] > 0.0:
            for a in range(len(gravity)):
                nodes.v_old[i, a] = nodes.v[i, a] / nodes.m[i]
                nodes.v[i, a] = nodes.v_old[i, a] + dt * (nodes.f[i, a] / nodes.m[i] + gravity[a])


@kernel
def _update_empty(nodes, gravity, dt, bounds):
    for i in range(bounds[0], bounds[1]):
        if not nodes.m[i] > 0.0:
            for a in range(len(gravity)):
                nodes.v[i, a] = dt * gravity[a]


@parallel_if_many
def _update_all(nodes, gravity, dt, eps):
    for c in prange(CHUNKS):
        _update(nodes, gravity, dt, eps, chunk(c, len(nodes.m)))


@parallel_if_many
def _update_all_apart(nodes, gravity, dt):
    for c in prange(CHUNKS):
        _update_apart(nodes, gravity, dt, chunk(c, len(nodes.m)))


@parallel_if_many
def _update_all_empty(nodes, gravity, dt):
    for c in prange(CHUNKS):
        _update_empty(nodes, gravity, dt, chunk(c, len(nodes.m)))


def flattened(grid):
    """Return a view with one axis for all nodes: m (n,), v (n, d); f, v_old where carried."""
    d = grid.m.ndim
    f, v_old = (a if a.ndim == 1 else a.reshape(-1, d) for a in (grid.f, grid.v_old))
    return Grid(grid.m.reshape(-1), grid.v.reshape(-1, d), f, v_old, grid.origin, grid.dx)


def update(grid, gravity, dt, eps=0.0, on_empty=False):
    """Momentum to velocity: v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g on nodes that have mass.

    gravity is an acceleration (d,) [m/s^2]; eps [kg] regularises the mass and `on_empty` gives
    empty nodes the velocity dt g, both as in the release of NCLAW. Where the grid carries forces
    apart (FLIP), v_old is kept too.
    """
    real = grid.v.dtype.type
    nodes, gravity = flattened(grid), np.asarray(gravity, dtype=real)
    dt, eps = converted(dt, real), converted(eps, real)
    if grid.f.ndim > 1:
        _update_all_apart(nodes, gravity, dt)
    else:
        _update_all(nodes, gravity, dt, eps)
    if on_empty:
        _update_all_empty(nodes, gravity, dt)
