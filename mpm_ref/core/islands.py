"""Islands: groups of particles that share no node, nor have neighbouring ones.

Particles are grouped by the block of their base node (see `block_table`), and blocks that touch,
also at a corner, by island. Between the blocks of two islands there is an empty one, so that the
nodes that they reach are at least APART cells away from each other along some axis.

    runs        particles one after another in a block: few, as particles are sorted by cell
    blocks      the runs of each block
    islands     blocks that are connected by neighbours

A run, a block and an island have the box of their particles' base nodes, a row (2 d,) of the lowest
and the highest index along each axis.
"""

from typing import NamedTuple

import numpy as np

from .block_table import EMPTY, SHIFT, block_of, empty_table, row_of
from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .spline import base_of
from .tensor import put_vec, vec

APART = 2**SHIFT + 1 - 3        # cells: base nodes are more than a block apart, splines reach 3


class Islands(NamedTuple):
    """The islands of some particles, B blocks of n islands in d dimensions."""

    blocks: np.ndarray      # (B, 2 d)  box of each block
    number: np.ndarray      # (B,)      island of each block
    boxes: np.ndarray       # (n, 2 d)  box of each island


@kernel
def base_node(x, dx, stencil):
    """Base node of the point x, counted from the world's origin."""
    if len(x) == 2:
        return base_of(x[0], dx, stencil), base_of(x[1], dx, stencil)
    else:
        return base_of(x[0], dx, stencil), base_of(x[1], dx, stencil), base_of(x[2], dx, stencil)


@kernel
def corners(boxes, k, like):
    """Lowest and highest node of box k."""
    d = len(like)
    if d == 2:
        return (boxes[k, 0], boxes[k, 1]), (boxes[k, 2], boxes[k, 3])
    else:
        return (boxes[k, 0], boxes[k, 1], boxes[k, 2]), (boxes[k, 3], boxes[k, 4], boxes[k, 5])


@kernel
def put_box(boxes, k, low, high):
    """Let box k have its lowest and highest node."""
    for a in range(len(low)):
        boxes[k, a], boxes[k, len(low) + a] = low[a], high[a]


@kernel
def widen(boxes, k, low, high):
    """Let box k contain two more nodes."""
    for a in range(len(low)):
        b = len(low) + a
        boxes[k, a], boxes[k, b] = min(boxes[k, a], low[a]), max(boxes[k, b], high[a])


# runs

@kernel
def put_runs(x, dx, stencil, runs, like, bounds):
    """Put the boxes of the runs of the particles bounds[0] .. bounds[1] - 1 into the rows `runs`
    from bounds[0] on; returns the number of runs.
    """
    n = bounds[0]
    for p in range(bounds[0], bounds[1]):
        base = base_node(vec(x, p, like), dx, stencil)
        if n > bounds[0] and block_of(base) == block_of(vec(runs, n - 1, like)):
            widen(runs, n - 1, base, base)
        else:
            put_box(runs, n, base, base)
            n += 1
    return n - bounds[0]


@parallel_if_many
def _put_all_runs(x, dx, stencil, runs, like, count):
    for c in prange(CHUNKS):
        count[c] = put_runs(x, dx, stencil, runs, like, chunk(c, len(x)))


def runs_of(x, dx, stencil):
    """Return the boxes (R, 2 d) of the runs of particles at x (N, d) [m]."""
    n, d = x.shape
    runs, count = np.empty((n, 2 * d), dtype=np.int64), np.empty(CHUNKS, dtype=np.int64)
    _put_all_runs(x, dx, stencil, runs, tuple(range(d)), count)
    first = np.arange(CHUNKS) * n // CHUNKS
    return np.concatenate([runs[a : a + k] for a, k in zip(first, count, strict=True)])


# blocks

@kernel
def collect(runs, table, blocks, like):
    """Put the blocks of runs into an empty table, with their number behind them, and their boxes
    into `blocks`; returns the number of blocks.
    """
    n, d = 0, len(like)
    for r in range(len(runs)):
        low, high = corners(runs, r, like)
        block = block_of(low)
        row = row_of(table, block)
        if table[row, 0] == EMPTY:
            put_vec(table, row, block)
            table[row, d] = n
            put_box(blocks, n, low, high)
            n += 1
        else:
            widen(blocks, table[row, d], low, high)
    return n


# islands

@kernel
def neighbour(block, c):
    """Neighbour c of a block: of the 3^d blocks around it, itself in the middle."""
    if len(block) == 2:
        return block[0] + c // 3 - 1, block[1] + c % 3 - 1
    else:
        return block[0] + c // 9 - 1, block[1] + c // 3 % 3 - 1, block[2] + c % 3 - 1


@kernel
def root_of(parent, k):
    """The first block of the set to which block k belongs."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def join_neighbours(blocks, table, parent, like):
    """Join the sets of blocks that are neighbours: parent[k] is a block of the set of block k that
    does not come after it.
    """
    for k in range(len(blocks)):
        block = block_of(vec(blocks, k, like))
        for c in range(3 ** len(like) // 2):        # the others have k for a neighbour
            row = row_of(table, neighbour(block, c))
            if table[row, 0] != EMPTY:
                a, b = root_of(parent, k), root_of(parent, table[row, len(like)])
                parent[max(a, b)] = min(a, b)


@kernel
def number_islands(blocks, parent, number, boxes, like):
    """Number the sets in the order of their first blocks, and put their boxes into `boxes`; returns
    the number of islands.
    """
    n = 0
    for k in range(len(blocks)):
        root, (low, high) = root_of(parent, k), corners(blocks, k, like)
        if root == k:
            number[k] = n
            put_box(boxes, n, low, high)
            n += 1
        else:
            number[k] = number[root]
            widen(boxes, number[k], low, high)
    return n


def islands_of(clouds, dx, stencil):
    """Return the `Islands` of the points of `clouds`, arrays (N, d) of finite numbers [m]; dx has
    their precision.

    Points of all clouds are grouped together; their order changes the order of the islands alone.
    """
    like = tuple(range(clouds[0].shape[1]))
    runs = np.concatenate([runs_of(x, dx, stencil) for x in clouds])
    table, blocks = empty_table(len(runs), len(like) + 1), np.empty_like(runs)
    blocks = blocks[: collect(runs, table, blocks, like)]
    parent, number, boxes = np.arange(len(blocks)), np.empty(len(blocks), int), blocks.copy()
    join_neighbours(blocks, table, parent, like)
    return Islands(blocks, number, boxes[: number_islands(blocks, parent, number, boxes, like)])
