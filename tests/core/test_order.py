import numpy as np
import pytest
from clouds import DX, Case, cloud

from mpm_ref.core.grid import Storage
from mpm_ref.core.order import by_cell, slab_axis, slab_width, slabs_of
from mpm_ref.plain.spline import pairs

CASES = (Case("pic", 1, 2), Case("mls", 2, 3))
THIN = {2: (0.2, 1.0), 3: (0.2, 1.0, 0.5)}      # of the width on each axis


@pytest.fixture(params=[(case, thin) for case in CASES for thin in (False, True)],
                ids=lambda param: param[0].name + "-thin" * param[1])
def sorted_(request, rng):
    case, thin = request.param
    x = cloud(case, rng, n=1000, width=30.0).x
    if thin:
        x *= THIN[case.d]
    grid = Storage(DX, case.stencil, case.d).cover([x])
    node = pairs(x, DX, case.degree).node - grid.origin
    return case, x, grid, node, slabs_of(x, grid, case.stencil), int(thin)


@pytest.mark.parametrize(("shape", "axis"), [
    ((40, 40), 0), ((40, 79), 0), ((40, 80), 1), ((8, 8, 100), 2), ((63, 1000), 1), ((65, 1000), 0),
    ((10, 20, 30), 2), ((30, 20, 10), 0)])
def test_axis_of_the_slabs(shape, axis):
    assert slab_axis(shape, 2) == axis


def test_slabs_hold_every_particle_once(sorted_):
    case, x, grid, _, slabs, axis = sorted_
    assert np.array_equal(np.sort(slabs.order), np.arange(len(x)))
    assert slabs.start[0] == 0
    assert slabs.start[-1] == len(x)
    assert len(slabs.start) <= -(-grid.m.shape[axis] // slab_width(case.stencil)) + 1
    assert np.diff(slabs.start).min() >= 0
    assert np.diff(slabs.start)[-1] > 0


def test_particles_are_in_the_slab_of_their_base_node_and_in_order(sorted_):
    case, _, _, node, slabs, axis = sorted_
    base = node[:, 0, axis]
    for a in range(len(slabs.start) - 1):
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        assert (base[members] // slab_width(case.stencil) == a).all()
        assert (np.diff(members) > 0).all()


def test_slabs_of_one_colour_share_no_node(sorted_):
    _, _, grid, node, slabs, axis = sorted_
    for color in (0, 1):
        owner = np.full(grid.m.shape[axis], -1)
        for a in range(color, len(slabs.start) - 1, 2):
            reached = np.unique(node[slabs.order[slabs.start[a] : slabs.start[a + 1]], :, axis])
            assert (owner[reached] == -1).all()
            owner[reached] = a


def test_every_reached_node_is_in_the_grid(sorted_):
    _, _, grid, node, *_ = sorted_
    assert node.min() >= 0
    assert (node.max(axis=(0, 1)) < grid.m.shape).all()


def test_by_cell_sorts_stably(sorted_):
    case, x, grid, node, *_ = sorted_
    order = by_cell(x, grid, case.stencil)
    key = np.ravel_multi_index(tuple(node[:, 0].T), grid.m.shape)
    assert np.array_equal(order, np.argsort(key, kind="stable"))


def test_all_particles_in_one_slab(rng):
    case = CASES[0]
    x = DX * (0.5 + 0.01 * rng.uniform(size=(50, 2)))
    slabs = slabs_of(x, Storage(DX, case.stencil, 2).cover([x]), case.stencil)
    assert np.array_equal(slabs.order, np.arange(50))
