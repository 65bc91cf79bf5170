"""Grid storage with nodes only where matter is: a box of nodes for each island of particles.

The boxes of islands (see `islands`) lie side by side in the arrays of one grid, so that a step is
the same few kernels for any number of them. A particle finds its nodes by the block of its base
node: `stencil.locate` adds what a table has for this block. Each box is aligned to the slabs of the
box of nodes around all particles, and the slabs of the grid are cut across the axis of that box, so
that sums at a node have the same order, hence the same bits, as on a dense grid (see `order`).

A grid is dense unless that would be wasteful: with more than LEAST nodes, more than PER_PARTICLE
for each particle, and more than 1/SHARE times as many as the arrays of the sparse grid have, boxes
and gaps. Only where the first two hold are islands looked for. Past MAX_BYTES it is always sparse.
"""

from math import prod

from .block_table import block_of, empty_table, row_of
from .grid import MAX_BYTES, Storage
from .islands import islands_of
from .jit import kernel
from .order import slab_axis, slab_width
from .packing import pack
from .precision import converted
from .state import Grid, SparseGrid
from .tensor import put_vec, vec

LEAST = 2**16           # nodes, below which a dense grid costs less than looking for islands
PER_PARTICLE = 4        # nodes: where there are fewer, particles cost far more than nodes
SHARE = 0.5             # of the nodes of the dense grid


class SparseStorage(Storage):
    """Reusable storage of a grid for particles with splines of a stencil; see `cover`.

    gap is the least number of nodes between two boxes in the arrays, for those who read nodes
    beyond the edge of a box.
    """

    def __init__(self, dx, stencil, dim, flip=False, gap=0):
        super().__init__(dx, stencil, dim, flip)
        self.gap = gap

    def cover(self, clouds):
        """Return a zeroed grid over all nodes that the points of `clouds`, arrays (N, d), reach:
        a `Grid`, or a `SparseGrid` where that saves nodes.

        Raises OutOfRange where a point is not finite or too far away, or the nodes would need more
        than MAX_BYTES.
        """
        dense = self.box(clouds)
        if not self.is_wide(dense, sum(map(len, clouds))):
            return self.zeroed(dense)
        islands = islands_of(clouds, converted(self.dx, dense.real), self.stencil)
        axis = slab_axis(dense.shape, slab_width(self.stencil))
        first, size = self.boxes(islands, dense, axis)
        place = pack(self.room(size, axis), axis)
        shape = tuple(map(int, (place + size).max(axis=0)))
        if prod(shape) >= SHARE * prod(dense.shape) and self.fits(dense):
            return self.zeroed(dense)
        origin = table_of_shifts(islands.blocks, (place - first)[islands.number])
        return SparseGrid(*self.fields(shape, dense), origin, self.dx, first, place, size, axis)

    def fits(self, dense):
        """Return whether a dense grid needs at most MAX_BYTES."""
        return self.bytes(dense.shape, dense) <= MAX_BYTES

    def is_wide(self, dense, particles):
        """Return whether a dense grid has so many nodes that islands are looked for."""
        return prod(dense.shape) > max(LEAST, PER_PARTICLE * particles) or not self.fits(dense)

    def boxes(self, islands, dense, axis):
        """Return first node and size, (n, d), of the box of each island, aligned to whole slabs of
        the dense grid.
        """
        first = islands.boxes[:, : self.dim].copy()
        size = islands.boxes[:, self.dim :] + len(self.stencil) - first
        pair = 2 * slab_width(self.stencil)
        before = (first[:, axis] - dense.first[axis]) % pair
        first[:, axis] -= before
        size[:, axis] += before
        return first, size

    def room(self, size, axis):
        """Return the sizes (n, d) that boxes take: with their gap, and of whole slabs."""
        room, pair = size + self.gap, 2 * slab_width(self.stencil)
        room[:, axis] += -room[:, axis] % pair
        return room


def table_of_shifts(blocks, shift):
    """Return a table (see `block_table`) of blocks, by their boxes (B, 2 d), with their shifts
    (B, d).
    """
    table = empty_table(len(blocks), blocks.shape[1])
    fill(table, blocks, shift, tuple(range(shift.shape[1])))
    return table


@kernel
def fill(table, blocks, shift, like):
    """Put blocks, by their boxes (B, 2 d), into an empty table with their shifts (B, d)."""
    d = len(like)
    for k in range(len(blocks)):
        block = block_of(vec(blocks, k, like))
        row = row_of(table, block)
        put_vec(table, row, block)
        for a in range(d):
            table[row, d + a] = shift[k, a]


# reading a sparse grid

def is_sparse(grid):
    """Return whether a grid is a `SparseGrid`."""
    return grid.origin.ndim == 2


def boxes_of(grid):
    """Return a list of dense `Grid` with views of the arrays of a grid: one for each box of a
    sparse one, the grid itself of a dense one.
    """
    if not is_sparse(grid):
        return [grid]
    views = []
    for first, place, size in zip(grid.first, grid.place, grid.size, strict=True):
        box = tuple(map(slice, place, place + size))
        fields = (a[box] if a.ndim > 1 else a for a in (grid.m, grid.v, grid.f, grid.v_old))
        views.append(Grid(*fields, first, grid.dx))
    return views
