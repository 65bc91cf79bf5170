"""Nodes with mass of sparse grids: those of the dense one, where conditions act alike."""

import numpy as np
import pytest
from far_bodies import clusters, sparse_over
from hypothesis import given
from hypothesis import strategies as st
from problems import DT, DX

from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.levelset import half_space, sphere
from mpm_ref.core.mass_nodes import nodes_beyond, nodes_with_mass
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.stencil import locate
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.plain.spline import pairs


def filled(seed, d, gap=0):
    """Sparse and dense grids with the same masses and velocities at the same nodes, which are
    returned too: (K, d) from the world's origin, and as indices in the arrays of both.
    """
    rng = np.random.default_rng(seed)
    x = clusters(rng, d, centers=8, width=50.0)
    grids = sparse_over(x, 2, gap=gap)
    reached = pairs(x, DX, 2).node
    node, one = np.unique(reached.reshape(-1, d), axis=0, return_index=True)
    m, v = rng.uniform(0.5, 1.0, len(node)), rng.normal(size=(len(node), d))
    places = []
    for grid in grids:
        base = np.array([locate(tuple(x_p), grid, STENCILS[2])[0] for x_p in x])
        index = (reached + (base - reached[:, 0])[:, None]).reshape(-1, d)[one]
        places.append(tuple(index.T))
        grid.m[places[-1]], grid.v[places[-1]] = m, v
    return *grids, node, places


@given(st.integers(0, 2**32 - 1), st.sampled_from((2, 3)))
def test_nodes_with_mass_are_those_of_the_dense_grid(seed, d):
    grid, _, node, (place, _) = filled(seed, d)
    nodes = nodes_with_mass(grid)
    expected = {int(k): tuple(i) for k, i in zip(np.ravel_multi_index(place, grid.m.shape), node)}
    assert len(nodes.flat) == len(expected)
    assert {int(k): tuple(i) for k, i in zip(nodes.flat, nodes.origin)} == expected


@given(st.integers(0, 2**32 - 1), st.sampled_from((2, 3)), st.integers(-40, 40), st.booleans())
def test_nodes_beyond_a_plane_are_those_of_the_dense_grid_in_its_order(seed, d, limit, below):
    grid, whole, *_ = filled(seed, d)
    axis = seed % d
    for where in (limit, None):
        one, two = (nodes_beyond(g, axis, where, below) for g in (grid, whole))
        assert (grid.m.reshape(-1)[one] == whole.m.reshape(-1)[two]).all()


def parts(d):
    """Colliders that touch many nodes, with friction and motion, and a region."""
    up = np.eye(d)[-1]
    turning = Motion(Steady(0.3 * up), Steady(2.0), None if d == 2 else up, np.zeros(d))
    floor = Collider(half_space(np.full(d, 0.37 * DX), 0.3 + up), "separate", 0.4)
    ball = Collider(sphere(np.full(d, 2.1 * DX), 14.3 * DX), "slip", 0.2, turning)
    region = Prescribed(sphere(np.full(d, -9.0 * DX), 6.0 * DX), Motion(Steady(up)))
    past = Prescribed(sphere(np.zeros(d), 6.0 * DX), until=0.5)
    return (floor, ball), (region, past), BoxWalls(d * (-12,), (None, *(d - 1) * (13,)), "slip")


@pytest.mark.parametrize("kind", [Conditions, SurfaceConditions])
@given(seed=st.integers(0, 2**32 - 1), d=st.sampled_from((2, 3)))
def test_conditions_have_the_bits_of_the_dense_grid(kind, seed, d):
    """But for the order in which impulses are summed."""
    conditions = kind(*parts(d))
    grid, whole, _, places = filled(seed, d, conditions.read_distance)
    J = [conditions.apply(g, 1.0, DT) for g in (grid, whole)]
    u, w = grid.v[places[0]], whole.v[places[1]]
    assert u.tobytes() == w.tobytes()
    sizes = abs(whole.m[..., None] * whole.v).sum() + abs(J[1]).max()
    assert J[0] == pytest.approx(J[1], abs=1e-14 * sizes)
    assert conditions.fastest(grid, 1.0, DT) == conditions.fastest(whole, 1.0, DT)
