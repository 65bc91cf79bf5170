import numpy as np
import pytest
from clouds import DX, Case, cloud
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.core import grid as grids
from mpm_ref.core.grid import OutOfRange, Storage, extent, update
from mpm_ref.core.order import slab_width
from mpm_ref.core.spline import STENCILS
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.transfer import grid_velocity


def test_extent(d, rng):
    x = rng.normal(size=(500, d))
    low, high = extent(x)
    assert np.array_equal(low, x.min(axis=0))
    assert np.array_equal(high, x.max(axis=0))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_particle_that_is_not_finite_is_named(bad, rng):
    x = rng.normal(size=(500, 2))
    x[137, 1] = bad
    with pytest.raises(OutOfRange, match="particle 137"):
        extent(x)


@pytest.mark.parametrize("far", [1e9, -1e9, 1e17, 1e300])
def test_a_particle_too_far_away_is_refused(far, rng):
    x = rng.normal(size=(500, 2))
    x[137, 1] = far
    with pytest.raises(OutOfRange, match="flown off"):
        Storage(DX, STENCILS[2], 2).cover([x, x])


def test_a_box_far_from_the_origin_is_refused_where_its_cells_are_lost():
    x = np.full((3, 2), 1e17)
    with pytest.raises(OutOfRange, match="flown off"):
        Storage(1.0, STENCILS[2], 2).cover([x])


@given(at=st.floats(-1e5, 1e5), degree=st.sampled_from([1, 2, 3]), edge=st.booleans())
def test_grid_is_the_smallest_aligned_box(at, degree, edge):
    x = np.array([[at, -at], [at + 3.3 * DX, -at + DX]])
    if edge:
        x = DX * np.round(x / DX)
    grid = Storage(DX, STENCILS[degree], 2).cover([x])
    node = pairs(x, DX, degree).node - grid.origin
    pair = 2 * slab_width(STENCILS[degree])      # of slabs, one of each colour
    assert grid.origin[0] % pair == 0
    assert node.min() >= 0
    assert node[..., 0].min() < pair
    assert node[..., 1].min() == 0
    assert np.array_equal(node.max(axis=(0, 1)) + 1, grid.m.shape)


def test_storage_is_reused_and_zeroed(rng):
    store = Storage(DX, STENCILS[2], 2, flip=True)
    large, small = rng.uniform(0, 40 * DX, (9, 2)), rng.uniform(0, 4 * DX, (9, 2))
    first = store.cover([large])
    for a in (first.m, first.v, first.f, first.v_old):
        a[:] = np.nan
    second = store.cover([small])
    assert np.shares_memory(first.m, second.m)
    fields = (second.m, second.v, second.f, second.v_old)
    assert all(a.flags.c_contiguous and not a.any() for a in fields)
    assert not any(np.shares_memory(a, b) for a in fields for b in fields if a is not b)


def test_cover_holds_every_cloud(rng):
    a, b = rng.uniform(0, DX, (5, 2)), rng.uniform(9 * DX, 10 * DX, (5, 2))
    grid = Storage(DX, STENCILS[1], 2).cover([a, b])
    assert (pairs(b, DX, 1).node.max(axis=(0, 1)) - grid.origin + 1 == grid.m.shape).all()


def filled(d, rng, flip=False):
    """A grid with random mass and momentum, half of its nodes empty."""
    case = Case("flip" if flip else "pic", 2, d)
    grid = Storage(DX, case.stencil, d, flip=flip).cover([cloud(case, rng).x])
    grid.m[:] = np.where(rng.random(grid.m.shape) < 0.5, 0.0, rng.uniform(1, 2, grid.m.shape))
    grid.v[:] = np.where(grid.m[..., None] > 0, rng.normal(size=grid.v.shape), 0.0)
    return grid


@pytest.mark.parametrize("eps", [0.0, 1e-2])
def test_update_equals_its_twin(d, eps, rng):
    grid, g, dt = filled(d, rng), np.arange(1.0, 1.0 + d), 0.1
    expected = grid_velocity(grid.m, grid.v.copy(), 0.0, g, dt, eps)
    update(grid, g, dt, eps)
    assert abs(grid.v - expected).max() <= 1e-15 * abs(expected).max()


def test_update_of_a_grid_with_forces_apart(rng):
    grid, g, dt = filled(2, rng, flip=True), np.array([1.0, 2.0]), 0.1
    grid.f[:] = rng.normal(size=grid.f.shape)
    old = grid_velocity(grid.m, grid.v.copy(), 0.0, 0.0 * g, dt)
    expected = grid_velocity(grid.m, grid.v.copy(), grid.f, g, dt)
    update(grid, g, dt)
    full = grid.m > 0
    assert abs(grid.v - expected)[full].max() <= 1e-15 * abs(expected).max()
    assert abs(grid.v_old - old)[full].max() <= 1e-15 * abs(old).max()
    assert not grid.v[~full].any()


def test_empty_nodes_rest_or_fall(rng):
    g, dt = np.array([1.0, -2.0]), 0.1
    for on_empty in (False, True):
        grid = filled(2, np.random.default_rng(4))
        update(grid, g, dt, on_empty=on_empty)
        assert (grid.v[grid.m == 0] == (dt * g if on_empty else 0.0)).all()
    assert np.isfinite(grid.v).all()


def test_largest_grid_is_bounded():
    """The bound protects memory: of a node in 3D, mass and momentum are 32 bytes."""
    side = DX * (grids.MAX_BYTES / 32) ** (1 / 3)
    with pytest.raises(OutOfRange, match="bytes at dx"):
        Storage(DX, STENCILS[2], 3).cover([np.array([[0.0] * 3, [1.01 * side] * 3])])
