"""Grid storage that covers the matter and moves with it, and the momentum update of its nodes.

The grid is the smallest box of nodes that the particles reach, aligned to whole slabs along the
first axis. A domain
box is a boundary condition (see `boundary`), not an array bound.
"""

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel, prange
from .order import slab_width
from .precision import converted
from .spline import base_of
from .state import NONE, Grid

MAX_BYTES = 8e9


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


@parallel
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

        Raises OutOfRange where a point is not finite or the box would need more than MAX_BYTES.
        """
        low, high = self._box(clouds)
        real = low.dtype.type
        first = self._base(low)
        first[0] -= first[0] % (2 * slab_width(self.stencil))     # see `order`
        shape = tuple(int(k) for k in self._base(high) + len(self.stencil) - first)
        size = int(np.prod(np.array(shape, dtype=float)))
        needed = size * (1 + self.vectors * self.dim)
        if len(self._buffer) < needed or self._buffer.dtype != real:
            self._buffer = np.empty(int(1.3 * needed), real)
        self._buffer[:needed] = 0.0
        return self._carve(shape, size, first)

    def _base(self, x):
        dx = converted(self.dx, x.dtype.type)
        return np.array([base_of(x_a, dx, self.stencil) for x_a in x], dtype=np.int64)

    def _box(self, clouds):
        boxes = [extent(x) for x in clouds]
        low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
        nodes = np.prod((high - low) / self.dx + len(self.stencil))
        size = low.itemsize * nodes * (1 + self.vectors * self.dim)
        if size > MAX_BYTES or max(-low.min(), high.max()) / self.dx > 2.0**50:
            raise OutOfRange(
                f"particles from {low} to {high} need a grid of {size:.1e} bytes at "
                f"dx = {self.dx}, at most {MAX_BYTES:.0e} are allowed; has a particle flown off, "
                "or is dx too small?"
            )
        return low, high

    def _carve(self, shape, size, first):
        d, at, real = self.dim, size, self._buffer.dtype.type
        fields = []
        for _ in range(self.vectors):
            fields.append(self._buffer[at : at + size * d].reshape((*shape, d)))
            at += size * d
        none = converted(NONE, real)
        v, f, v_old = fields if self.vectors == 3 else (fields[0], none, none)
        m = self._buffer[:size].reshape(shape)
        return Grid(m, v, f, v_old, first, self.dx)


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


@parallel
def _update_all(nodes, gravity, dt, eps):
    for c in prange(CHUNKS):
        _update(nodes, gravity, dt, eps, chunk(c, len(nodes.m)))


@parallel
def _update_all_apart(nodes, gravity, dt):
    for c in prange(CHUNKS):
        _update_apart(nodes, gravity, dt, chunk(c, len(nodes.m)))


@parallel
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
