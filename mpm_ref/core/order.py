"""Order of particles for a scatter that is parallel and yet gives the same bits for any number of
threads.

The box of cells is cut into slabs of as many cells as the degree, at least 2: across the first
axis, in whose order the particles lie, unless that gives few slabs and another axis is far longer.
A particle whose base cell is in a slab writes nodes of that slab and at most `degree` beyond, so
slabs of the same colour (every other one) share no node. Within a slab the particles keep their
order. A physical sort by cell, now and then, keeps memory access local.
"""

from typing import NamedTuple

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .precision import converted, with_rounded_spacing
from .spline import base_of
from .stencil import locate
from .tensor import vec

ENOUGH = 64         # slabs, 32 of a colour, which many threads can share
FAR_LONGER = 2      # times as long as the first axis


class Slabs(NamedTuple):
    """Particles by slab: those of slab a are order[start[a] : start[a + 1]]."""

    order: np.ndarray     # (N,)          particle indices, stable within a slab
    start: np.ndarray     # (slabs + 1,)


@kernel
def slab_width(stencil):
    """Cells per slab: the degree, at least 2."""
    return max(len(stencil) - 1, 2)


def slab_axis(shape, width):
    """Return the axis across which a box of nodes is cut into slabs of `width` cells: the first,
    unless it has at most half of `ENOUGH` slabs and another is `FAR_LONGER`.
    """
    longest = int(np.argmax(shape))
    return longest if FAR_LONGER * shape[0] <= min(shape[longest], ENOUGH * width) else 0


class Cut(NamedTuple):
    """The nodes of an axis of a dense grid that is cut into slabs."""

    first: int          # number of the grid's first node along it
    dx: float           # [m]


@kernel
def slab_of(x, p, cut, stencil):
    """Slab of particle p: x is (N,) along the axis of a `Cut`, or (N, d) on a sparse grid, cut."""
    if x.ndim == 1:
        return (base_of(x[p], cut.dx, stencil) - cut.first) // slab_width(stencil)
    else:
        base, _ = locate(vec(x, p, cut.m.shape), cut, stencil)
        return base[cut.axis] // slab_width(stencil)


@kernel
def _count(x, cut, stencil, count, bounds):
    for p in range(bounds[0], bounds[1]):
        count[slab_of(x, p, cut, stencil)] += 1


@kernel
def _place(x, cut, stencil, at, order, bounds):
    for p in range(bounds[0], bounds[1]):
        a = slab_of(x, p, cut, stencil)
        order[at[a]] = p
        at[a] += 1


@parallel_if_many
def _count_all(x, cut, stencil, count):
    for c in prange(CHUNKS):
        _count(x, cut, stencil, count[c], chunk(c, len(x)))


@parallel_if_many
def _place_all(x, cut, stencil, at, order):
    for c in prange(CHUNKS):
        _place(x, cut, stencil, at[c], order, chunk(c, len(x)))


def slabs_of(x, grid, stencil):
    """Stable counting sort of the particles at x (N, d) by slab. All must lie inside the grid, a
    `Grid` or a `SparseGrid`.
    """
    width = slab_width(stencil)
    if grid.origin.ndim == 1:
        axis = slab_axis(grid.m.shape, width)
        along, cut = x[:, axis], Cut(grid.origin[axis], converted(grid.dx, x.dtype.type))
    else:
        axis, along, cut = grid.axis, x, with_rounded_spacing(grid)
    n_slabs = -(-grid.m.shape[axis] // width)
    count = np.zeros((CHUNKS, n_slabs), dtype=np.int64)
    _count_all(along, cut, stencil, count)
    ends = np.cumsum(count.T.ravel()).reshape(n_slabs, CHUNKS)     # by slab, then by chunk
    order = np.empty(len(x), dtype=np.int64)
    _place_all(along, cut, stencil, np.ascontiguousarray((ends - count.T).T), order)
    return Slabs(order, without_last_empty(np.concatenate(([0], ends[:, -1]))))


def without_last_empty(start):
    """Return the ends of slabs `start` (slabs + 1,) without those of empty slabs at the end, which
    would have threads share the others unevenly.
    """
    return start[: np.searchsorted(start, start[-1]) + 1]


@kernel
def _cells(x, grid, stencil, cell):
    d = grid.m.shape
    for p in range(len(x)):
        base, _ = locate(vec(x, p, d), grid, stencil)
        key = 0
        for a in range(len(base)):
            key = key * d[a] + base[a]
        cell[p] = key


def base_coordinates(x, dx, stencil):
    """Return the base nodes (N, d) of points x, counted from the world's origin, as floats."""
    return np.floor(x / dx - 0.5 * (len(stencil) - 2))


def by_cell(x, grid, stencil):
    """Stable permutation that sorts the particles at x (N, d) by cell, first axis slowest."""
    grid = with_rounded_spacing(grid)
    if grid.origin.ndim > 1:
        return np.lexsort(base_coordinates(x, grid.dx, stencil).T[::-1])
    cell = np.empty(len(x), dtype=np.int64)
    _cells(x, grid, stencil, cell)      # serial: the sort below takes far longer
    return np.argsort(cell, kind="stable")
