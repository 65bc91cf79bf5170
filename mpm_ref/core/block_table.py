"""A hash table of blocks of nodes, which kernels read.

A block is a cube of 2^SHIFT nodes along each axis, counted from the world's origin. A row of the
table, an array (rows, ..) of integers, is a block (d,) and what belongs to it; rows are powers of
two, and at most half of them have a block.
"""

import numpy as np

from .jit import kernel

SHIFT = 3               # a block has 8 nodes along each axis
EMPTY = -(2**62)        # in place of a block's first integer: the row is empty
FACTOR = 2654435761     # odd, with mixed bits
LOW = 2**28 - 1         # bits of the hash, such that its product with the factor is an integer


def empty_table(blocks, columns):
    """Return a table (rows, columns) for as many blocks, without any."""
    table = np.empty((1 << (2 * blocks).bit_length(), columns), dtype=np.int64)
    table[:, 0] = EMPTY
    return table


@kernel
def block_of(node):
    """Block of a node."""
    if len(node) == 2:
        return node[0] >> SHIFT, node[1] >> SHIFT
    else:
        return node[0] >> SHIFT, node[1] >> SHIFT, node[2] >> SHIFT


@kernel
def is_row_of(table, row, block):
    """Return whether a row is that of a block."""
    for a in range(len(block)):
        if table[row, a] != block[a]:
            return False
    return True


@kernel
def row_of(table, block):
    """Row of a block, or the empty one where it belongs."""
    row = 0
    for b in block:
        row = (row * FACTOR + b) & LOW
    row &= len(table) - 1
    while table[row, 0] != EMPTY and not is_row_of(table, row, block):
        row = (row + 1) & (len(table) - 1)
    return row
