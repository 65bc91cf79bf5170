"""Sparse grids: nodes only where matter is, and the sums of a dense grid to the bit."""

import numpy as np
import pytest
from clouds import COVER, cloud, deep
from far_bodies import clusters, dense, rule, sparse, sparse_over
from hypothesis import given
from hypothesis import strategies as st
from problems import DX
from threads import by_threads

from mpm_ref.core import grid as grids
from mpm_ref.core import sparse_grid
from mpm_ref.core.grid import OutOfRange, update
from mpm_ref.core.order import by_cell, slab_axis, slab_width, slabs_of
from mpm_ref.core.sparse_grid import SparseStorage, boxes_of, is_sparse
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.stencil import locate
from mpm_ref.core.transfer import g2p, p2g
from mpm_ref.plain.spline import pairs

SEEDS, DEGREES = st.integers(0, 2**32 - 1), st.sampled_from((1, 2, 3))


def covered(seed, d, degree, gap=0):
    """Points, and sparse and dense grids over them."""
    x = clusters(np.random.default_rng(seed), d)
    return x, *sparse_over(x, degree, gap=gap)


@given(SEEDS, st.sampled_from((2, 3)), DEGREES, st.sampled_from((0, 5)))
def test_boxes_have_all_nodes_that_particles_reach_and_a_gap(seed, d, degree, gap):
    x, grid, _ = covered(seed, d, degree, gap)
    nodes = pairs(x, DX, degree).node.reshape(-1, d)
    inside = [((nodes >= a) & (nodes < a + n)).all(axis=1)
              for a, n in zip(grid.first, grid.size, strict=True)]
    assert np.any(inside, axis=0).all()
    owner = np.full(grid.m.shape, -1)
    for k, (start, size) in enumerate(zip(grid.place, grid.size, strict=True)):
        low = np.maximum(start - gap, 0)
        assert set(np.unique(owner[tuple(map(slice, low, start + size + gap))])) == {-1}
        owner[tuple(map(slice, start, start + size))] = k


@given(SEEDS, st.sampled_from((2, 3)), DEGREES)
def test_particles_find_their_nodes(seed, d, degree):
    """The index in the arrays, from the first node of a box on, is that from the box's place on."""
    x, grid, _ = covered(seed, d, degree)
    node = pairs(x, DX, degree).node[:, 0]
    for p in range(0, len(x), 7):
        base, s = locate(tuple(x[p]), grid, STENCILS[degree])
        index = grid.first + base - grid.place
        box, = np.flatnonzero(((base >= grid.place) & (base < grid.place + grid.size)).all(axis=1))
        assert tuple(index[box]) == tuple(node[p])
        assert s == pytest.approx(tuple(x[p] / DX - node[p]))


@given(SEEDS, st.sampled_from((2, 3)), DEGREES, st.booleans())
def test_slabs_are_those_of_the_dense_grid(seed, d, degree, thin):
    """Particles of an island that are in one slab of the dense grid are in one of the sparse grid,
    and slabs of the same colour stay of the same colour.
    """
    x = clusters(np.random.default_rng(seed), d)
    x[:, 0] *= 0.05 if thin else 1.0
    grid, whole = sparse_over(x, degree)
    stencil, width = STENCILS[degree], slab_width(STENCILS[degree])
    assert grid.axis == slab_axis(whole.m.shape, width)
    a = grid.axis
    first, place = grid.first[:, a] - whole.origin[a], grid.place[:, a]
    assert not ((place - first) % (2 * width)).any()
    slabs = slabs_of(x, grid, stencil)
    assert np.array_equal(np.sort(slabs.order), np.arange(len(x)))
    for k in range(len(slabs.start) - 1):
        members = slabs.order[slabs.start[k] : slabs.start[k + 1]]
        assert (np.diff(members) > 0).all()
        assert all(locate(tuple(x[p]), grid, stencil)[0][a] // width == k for p in members[::5])


@given(SEEDS, st.sampled_from((2, 3)), DEGREES)
def test_order_by_cell_is_that_of_the_dense_grid(seed, d, degree):
    x, grid, whole = covered(seed, d, degree)
    assert np.array_equal(by_cell(x, grid, STENCILS[degree]), by_cell(x, whole, STENCILS[degree]))


def far_cloud(case, rng):
    """Random particles (see `clouds`) in clusters."""
    x = clusters(rng, case.d, centers=5, n=60)
    return cloud(case, rng, n=len(x))._replace(x=x)


@pytest.mark.parametrize("case", COVER, ids=lambda case: case.name)
def test_transfers_have_the_bits_of_the_dense_grid(case, rng):
    """Sums at nodes, and all that particles get back."""
    q = far_cloud(case, rng)
    grids, mls = sparse_over(q.x, case.degree, case.separate), case.transfer == "mls"
    after = []
    for grid in grids:
        r = deep(q)
        p2g(r, grid, case.stencil, 0.01, slabs_of(r.x, grid, case.stencil), mls)
        update(grid, np.arange(1.0, 1.0 + case.d), 0.01)
        g2p(r, grid, case.stencil, 0.01, 0.9, mls)
        after.append(r)
    for a, b in zip(*after, strict=True):
        assert a.tobytes() == b.tobytes()
    full = 0
    for box in boxes_of(grids[0]):
        start = box.origin - grids[1].origin
        cut = tuple(slice(max(k, 0), k + n) for k, n in zip(start, box.m.shape, strict=True))
        inner = tuple(slice(max(-k, 0), None) for k in start)
        filled = box.m[inner] > 0.0
        assert (box.m[inner][filled] == grids[1].m[cut][filled]).all()
        assert (box.v[inner][filled] == grids[1].v[cut][filled]).all()
        full += np.count_nonzero(filled)
    assert full == np.count_nonzero(grids[1].m > 0.0)


def test_same_bits_for_any_number_of_threads(d, rng):
    case = next(case for case in COVER if case.d == d and case.transfer == "mls")
    q = far_cloud(case, rng)

    def run():
        grid, _ = sparse_over(q.x, case.degree, case.separate)
        p2g(q, grid, case.stencil, 0.01, slabs_of(q.x, grid, case.stencil), True)
        return grid.m.tobytes() + grid.v.tobytes() + grid.place.tobytes()

    one, two = by_threads(run)
    assert one == two


# which grids are sparse

def two_points(cells, d=3):
    return np.array([[0.5 * DX] * d, [(cells + 0.5) * DX] * d])


def test_small_grids_are_dense_and_large_empty_ones_sparse():
    store = SparseStorage(DX, STENCILS[2], 3)
    side = round(sparse_grid.LEAST ** (1 / 3))
    assert not is_sparse(store.cover([two_points(side // 2)]))
    assert is_sparse(store.cover([two_points(2 * side)]))


def test_grids_with_few_nodes_for_each_particle_are_dense():
    """However large they are."""
    x = np.repeat(two_points(100), 100**3 // 4, axis=0)
    assert not is_sparse(SparseStorage(DX, STENCILS[2], 3).cover([x]))


def test_one_island_is_a_dense_grid(rng):
    line = DX * np.linspace(0.0, 100.0, 200)[:, None] * np.ones(3)
    assert not is_sparse(SparseStorage(DX, STENCILS[2], 3).cover([line]))


def test_boxes_that_save_too_little_are_a_dense_grid():
    """Two islands that fill more than the share of the nodes."""
    k = np.arange(40)
    block = DX * (np.stack(np.meshgrid(k, k, indexing="ij"), axis=-1).reshape(-1, 2) + 0.5)
    for cells, share, expected in ((60, 0.5, False), (60, 0.9, True), (300, 0.5, True)):
        x = np.concatenate([block, block + (cells * DX, 0.0)])
        with rule(0, 0, share):
            assert is_sparse(SparseStorage(DX, STENCILS[2], 2).cover([x])) == expected


def test_a_particle_that_flew_off_costs_a_few_nodes(d, rng):
    x = np.concatenate([DX * rng.uniform(0.0, 30.0, (500, d)), [[1e9 * DX] * d]])
    grid = SparseStorage(DX, STENCILS[2], d).cover([x])
    assert is_sparse(grid)
    assert grid.m.size < 3 * 34**d


@pytest.mark.parametrize("far", [1e17, 1e300])
def test_a_particle_whose_cell_is_lost_to_round_off_is_refused(far):
    x = np.array([[0.0, 0.0], [far, 0.0]])
    with pytest.raises(OutOfRange, match="flown off"):
        SparseStorage(DX, STENCILS[2], 2).cover([x])


def test_islands_beyond_the_largest_grid_are_refused(monkeypatch):
    """By the memory of their own boxes, not of the empty space between them."""
    for module in (grids, sparse_grid):
        monkeypatch.setattr(module, "MAX_BYTES", 1e5)
    k = np.arange(40.0)
    block = DX * np.stack(np.meshgrid(k, k, indexing="ij"), axis=-1).reshape(-1, 2)
    store = SparseStorage(DX, STENCILS[2], 2)
    assert is_sparse(store.cover([np.concatenate([block, [[1e6 * DX] * 2]])]))
    with pytest.raises(OutOfRange, match=r"need a grid of .*e\+05 bytes at dx"):
        store.cover([np.concatenate([block, block + 1e6 * DX, block - 1e6 * DX])])


def test_dense_grids_are_as_before(d, rng):
    """The boxes of a dense grid are the grid."""
    x = DX * rng.uniform(0.0, 20.0, (50, d))
    with dense():
        grid = SparseStorage(DX, STENCILS[2], d).cover([x])
    assert boxes_of(grid) == [grid]
    with sparse():
        first = SparseStorage(DX, STENCILS[2], d).cover([clusters(rng, d)])
    assert len(boxes_of(first)) == len(first.first) > 1
