"""The hash table of blocks of nodes."""

from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.core.block_table import EMPTY, SHIFT, block_of, empty_table, row_of

COORDINATE = st.one_of(st.integers(-20, 20), st.integers(-(2**47), 2**47),
                       st.integers(-5, 5).map(lambda k: k * 2**20))


@given(st.sampled_from((2, 3)).flatmap(
    lambda d: st.lists(st.tuples(*d * [COORDINATE]), min_size=1, max_size=60)))
def test_each_block_has_a_row(blocks):
    """Also far and negative ones, and those whose lowest bits agree; others have an empty row."""
    d, table = len(blocks[0]), empty_table(len(blocks), len(blocks[0]) + 1)
    for k, block in enumerate(blocks):
        row = row_of(table, block)
        assert (table[row, 0] == EMPTY) == (block not in blocks[:k])
        table[row, :d], table[row, d] = block, blocks.index(block)
    for block in blocks:
        assert table[row_of(table, block), d] == blocks.index(block)
    assert table[row_of(table, d * (2**48,)), 0] == EMPTY


def test_blocks_are_cubes_of_nodes_from_the_origin_on():
    side = 2**SHIFT
    assert block_of((0, -1)) == (0, -1)
    assert block_of((side - 1, -side)) == (0, -1)
    assert block_of((side, -side - 1, 5 * side)) == (1, -2, 5)
