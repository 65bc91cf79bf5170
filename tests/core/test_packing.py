"""Boxes side by side in one box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.core.packing import pack


def rooms(d):
    sizes = st.one_of(st.integers(1, 5), st.integers(1, 60))
    return st.lists(st.tuples(*d * [sizes]), min_size=1, max_size=30)


@given(st.sampled_from((2, 3)).flatmap(lambda d: st.tuples(rooms(d), st.integers(0, d - 1))))
def test_boxes_share_no_node(case):
    room, axis = np.array(case[0]), case[1]
    place = pack(room, axis)
    assert place.min() >= 0
    shape = (place + room).max(axis=0)
    owner = np.full(shape, -1)
    for k, (start, size) in enumerate(zip(place, room, strict=True)):
        box = tuple(map(slice, start, start + size))
        assert (owner[box] == -1).all()
        owner[box] = k


@given(st.sampled_from((2, 3)).flatmap(lambda d: st.tuples(rooms(d), st.integers(0, d - 1))))
def test_places_are_whole_slabs_where_sizes_are(case):
    room, axis = np.array(case[0]), case[1]
    room[:, axis] *= 4
    assert not (pack(room, axis)[:, axis] % 4).any()


@pytest.mark.parametrize("n", [1, 2, 5, 27, 100, 1000])
def test_equal_boxes_waste_less_than_half(d, n):
    """A layer may be as little as a box longer than half of its limit, and so may a row."""
    room = np.full((n, d), 6)
    shape = (pack(room, 0) + room).max(axis=0)
    assert shape.prod() < 2 * room.prod(axis=1).sum()


def test_small_boxes_do_not_lie_behind_each_other_beside_a_large_one(d):
    """One behind the other, as many nodes in small boxes as in a large one would take 8^(d-1) times
    the nodes; on shelves less than half of the nodes are empty.
    """
    room = np.concatenate([np.full((1, d), 64), np.full((8**d, d), 8)])
    shape = (pack(room, 0) + room).max(axis=0)
    assert shape.prod() < 2 * room.prod(axis=1).sum()


def test_a_row_is_as_thick_as_its_own_boxes():
    """Of 31 boxes the first fills a layer, and nine of the others, which are thin, fill one."""
    room = np.array([(2, 9, 9)] + 30 * [(2, 1, 9)])
    assert tuple((pack(room, 0) + room).max(axis=0)) == (10, 9, 9)
