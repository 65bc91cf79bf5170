"""The nodes of a grid that have mass, and where they lie: for conditions at nodes.

On a dense grid the number of a node in the flattened arrays gives its place. On a sparse one each
box is read line by line along the last axis, and the index of each node is kept.
"""

from typing import NamedTuple

import numpy as np

from .jit import kernel
from .sparse_grid import is_sparse
from .tensor import vec


class MassNodes(NamedTuple):
    """Some nodes of a grid, by their index in its flattened arrays."""

    flat: np.ndarray      # (A,)
    m: np.ndarray         # (n1, .., nd)  for its shape
    origin: np.ndarray    # (d,)          index of the first node, counted from the world's origin;
    #                                     on a sparse grid (A, d), that of each node
    dx: float             # [m]


def nodes_with_mass(grid):
    """`MassNodes` of a grid that have mass."""
    if is_sparse(grid):
        flat, index = sparse_nodes(grid)
        return MassNodes(flat, grid.m, index, float(grid.dx))
    flat = np.flatnonzero(grid.m.reshape(-1) > 0.0)
    return MassNodes(flat, grid.m, grid.origin, float(grid.dx))


def selected(nodes, which):
    """Return those of some `MassNodes` that an index array or slice selects."""
    origin = nodes.origin if nodes.origin.ndim == 1 else nodes.origin[which]
    return nodes._replace(flat=nodes.flat[which], origin=origin)


@kernel
def place(nodes, k, n):
    """Position of the k-th of the nodes, of a grid of shape n [m]."""
    i = index_of(nodes.flat[k], nodes.origin, k, n)
    if len(n) == 2:
        return i[0] * nodes.dx, i[1] * nodes.dx
    else:
        return i[0] * nodes.dx, i[1] * nodes.dx, i[2] * nodes.dx


@kernel
def index_of(i, origin, k, n):
    """Index, from the world's origin, of the k-th of the nodes, which has the number i in the
    flattened arrays of a grid of shape n; origin is that of `MassNodes`.
    """
    if origin.ndim > 1:
        return vec(origin, k, n)
    elif len(n) == 2:
        return origin[0] + i // n[1], origin[1] + i % n[1]
    else:
        j = i // n[2]
        return origin[0] + j // n[1], origin[1] + j % n[1], origin[2] + i % n[2]


# nodes beyond a plane

def nodes_beyond(grid, axis, limit, below):
    """Return the numbers (K,) of the nodes with mass whose index on an axis, from the world's
    origin, is < limit (below), or > limit, by this index and then by the others. A limit of None is
    beyond all nodes.
    """
    within = sparse_nodes_beyond if is_sparse(grid) else dense_nodes_beyond
    return within(grid, axis, limit, below)


def dense_nodes_beyond(grid, axis, limit, below):
    """`nodes_beyond` of a dense grid."""
    shape, first = grid.m.shape, int(grid.origin[axis])
    start, stop = 0, shape[axis]
    if limit is None:
        stop = 0
    elif below:
        stop = min(max(limit - first, 0), stop)
    else:
        start = min(max(limit + 1 - first, 0), stop)
    if start >= stop:
        return np.empty(0, dtype=np.int64)
    slab = np.moveaxis(grid.m, axis, 0)[start:stop]
    i, *others = np.nonzero(slab > 0.0)
    others.insert(axis, i + start)
    return np.ravel_multi_index(others, shape)


def sparse_nodes_beyond(grid, axis, limit, below):
    """`nodes_beyond` of a sparse grid."""
    if limit is None:
        return np.empty(0, dtype=np.int64)
    side, end = (1, grid.first) if below else (-1, grid.first + grid.size - 1)
    boxes = np.flatnonzero(side * end[:, axis] < side * limit)
    node, index = sparse_nodes(grid, boxes)
    inside = np.flatnonzero(side * index[:, axis] < side * limit)
    axes = [axis, *(a for a in range(grid.m.ndim) if a != axis)]
    return node[inside][in_order_of_space(index[inside][:, axes])]


def in_order_of_space(index):
    """Return the order of nodes, by their indices (A, d), in which a dense grid has them."""
    return np.lexsort(index.T[::-1])


# nodes of the boxes of a sparse grid

@kernel
def line_offset(line, size, k, like):
    """First node of a line of nodes along the last axis of box k, counted from the box's first."""
    if len(like) == 2:
        return line, 0
    else:
        return line // size[k, 1], line % size[k, 1], 0


@kernel
def flat_number(offset, place, k, shape):
    """Number of a node of box k in the flattened arrays of a grid."""
    if len(shape) == 2:
        return (place[k, 0] + offset[0]) * shape[1] + place[k, 1] + offset[1]
    else:
        i = (place[k, 0] + offset[0]) * shape[1] + place[k, 1] + offset[1]
        return i * shape[2] + place[k, 2] + offset[2]


@kernel
def lines_of(size, k, like):
    """Number of lines of box k."""
    n = 1
    for a in range(len(like) - 1):
        n *= size[k, a]
    return n


@kernel
def list_mass(grid, k, row, flat, index):
    """Put the nodes with mass in box k into flat (A,) and index (A, d) from a row on; returns the
    row after them.
    """
    shape, m = grid.m.shape, grid.m.reshape(-1)
    last = len(shape) - 1
    for line in range(lines_of(grid.size, k, shape)):
        offset = line_offset(line, grid.size, k, shape)
        i = flat_number(offset, grid.place, k, shape)
        for l in range(grid.size[k, last]):
            if m[i + l] > 0.0:
                flat[row] = i + l
                for a in range(len(shape)):
                    index[row, a] = grid.first[k, a] + offset[a]
                index[row, last] += l
                row += 1
    return row


@kernel
def list_all_mass(grid, boxes, flat, index):
    """`list_mass` of boxes one after another; returns the number of nodes."""
    row = 0
    for k in boxes:
        row = list_mass(grid, k, row, flat, index)
    return row


def sparse_nodes(grid, boxes=None):
    """Return the nodes with mass of a `SparseGrid`: their numbers (A,) in its flattened arrays and
    their indices (A, d) from the world's origin; of all boxes, or of those with given numbers.
    """
    boxes = np.arange(len(grid.first)) if boxes is None else boxes
    most = int(grid.size[boxes].prod(axis=1).sum())
    flat, index = np.empty(most, np.int64), np.empty((most, grid.m.ndim), np.int64)
    n = list_all_mass(grid, boxes, flat, index)
    return flat[:n], index[:n]
