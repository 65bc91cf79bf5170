"""Conditions as projectors: held nodes, slip planes at any angle, separate planes by active set."""

import numpy as np
import pytest

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.grid import Grid
from mpm_ref.core.levelset import half_space, sphere
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.state import NONE
from mpm_ref.explicit import Scheme
from mpm_ref.hot.constraints import FIXED, FREE, PLANE, RELEASES, ActiveSet
from mpm_ref.hot.methods import options_of
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.hot.system import free_part, unknowns_of

DX = 0.5


def grid_of(d, rng):
    """A grid of 4^d nodes, one of them empty, with random masses and momenta."""
    shape = (4,) * d
    m = rng.uniform(0.5, 2.0, shape)
    m[(1,) * d] = 0.0
    v = rng.normal(size=(*shape, d)) * m[..., None]
    return Grid(m, v, NONE, NONE, np.full(d, -2), DX)


def restrained(colliders, d=2, u=None, seed=0):
    """Restraint, unknowns under it, for a grid whose nodes move with u (or as they do)."""
    grid = grid_of(d, np.random.default_rng(seed))
    free = unknowns_of(grid)
    active_set = ActiveSet(Conditions(tuple(colliders)), grid, free, 0.1, 0.1)
    return active_set, active_set.initial_unknowns(free, free.v if u is None else u)


def inside(unknowns, distance):
    """Which nodes have a distance(x) <= 0."""
    return distance(unknowns.index * DX) <= 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_numbers_index_mass_velocity(d, rng):
    grid = grid_of(d, rng)
    q = unknowns_of(grid)
    assert len(q.m) == 4**d - 1
    assert q.number[(1,) * d] == -1
    for i in (0, 7, len(q.m) - 1):
        at = tuple(q.index[i] - grid.origin)
        assert q.number[at] == i
        assert q.m[i] == grid.m[at]
        assert np.array_equal(q.v[i], grid.v[at] / grid.m[at])


@pytest.mark.parametrize("d", [2, 3])
def test_sticky_nodes_take_the_velocity_of_the_collider(d):
    motion = Motion(Steady((0.3, -0.2, 0.1)[:d]))
    wall = Collider(half_space((0.0,) * d, (1.0, *(0.0,) * (d - 1))), "sticky", motion=motion)
    active_set, q = restrained([wall], d)
    held = inside(q, lambda x: x[:, 0] - 0.03)
    assert held.any()
    assert (active_set.role == FIXED).all()
    assert not q.B[held].any()
    assert np.allclose((q.v + q.dv0)[held], (0.3, -0.2, 0.1)[:d], rtol=0, atol=1e-15)
    assert np.array_equal(q.B[~held], np.tile(np.eye(d), (np.count_nonzero(~held), 1, 1)))
    assert not q.dv0[~held].any()


@pytest.mark.parametrize("d", [2, 3])
def test_slip_takes_the_normal_of_an_oblique_plane(d):
    n = np.array([0.6, 0.8, 0.0][:d])
    active_set, q = restrained([Collider(half_space((0.0,) * d, tuple(n)), "slip")], d)
    held = inside(q, lambda x: x @ n)
    assert held.any()
    assert (active_set.role == PLANE).all()
    assert np.allclose(q.B[held], np.eye(d) - np.outer(n, n), atol=1e-15)
    w = np.random.default_rng(1).normal(size=q.v.shape)
    u = q.v + q.dv0 + free_part(q, w)
    assert np.allclose((u @ n)[held], 0.0, atol=1e-15)


def test_two_slip_planes_leave_an_edge_and_three_a_point():
    planes = [Collider(half_space((0.0,) * 3, n), "slip")
              for n in ((1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.0, 0.6, 0.8))]
    for count, rank in ((2, 1), (3, 0)):
        _, q = restrained(planes[:count], 3)
        corner = np.flatnonzero((q.index == 0).all(axis=1))[0]
        assert np.isclose(np.trace(q.B[corner]), rank)
        assert np.allclose(q.B[corner] @ q.B[corner], q.B[corner], atol=1e-15)


def test_separate_bears_only_on_approach_and_lets_go_of_what_pulls():
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate")
    active_set, q = restrained([floor])
    node = active_set.contacts.node
    down = q.v[node, 1] < 0.0
    assert down.any()
    assert not down.all()
    assert np.array_equal(active_set.role == PLANE, down)
    # the floor would pull the first of the nodes that bear; the first free one goes down
    u, g = q.v + q.dv0, np.zeros_like(q.v)
    pulled, through = node[down][0], node[~down][0]
    g[node[down], 1] = 1.0
    g[pulled, 1], u[through, 1] = -1.0, -1.0
    assert active_set.update(u, g) == 2
    assert active_set.role[node == pulled] == FREE
    assert active_set.role[node == through] == PLANE
    q = active_set.apply(q)
    assert np.array_equal(q.B[pulled], np.eye(2))
    assert (q.v + q.dv0)[through, 1] == 0.0
    u = q.v + q.dv0
    u[pulled, 1] = 1.0
    assert active_set.update(u, g * (g > 0)) == 0


def test_relaxation_is_refused():
    scheme = Scheme(transfer="apic", relaxation=1e-3)
    with pytest.raises(ValueError, match=r"relaxation = 0\.001 with an implicit integrator"):
        ImplicitStepper(scheme, 0.1, 2, (0.0, 0.0))


def test_friction_is_that_of_the_loads_of_active_planes():
    """Coulomb's: mu times the load of each plane, and the mean of what they rub on."""
    motion = Motion(Steady((0.3, 0.0)))
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate", friction=0.5, motion=motion)
    wall = Collider(half_space((0.0, 0.0), (1.0, 0.0)), "slip", friction=0.25)
    active_set, q = restrained([floor, wall], u=np.full((15, 2), -1.0))
    impulse = np.tile((-3.0, 2.0), (len(q.m), 1))
    friction = active_set.friction(q, impulse, 1e-3)
    x = q.index[friction.node]
    on_floor, on_wall = x[:, 1] <= 0, x[:, 0] <= 0
    assert np.array_equal(friction.w, 0.5 * 2.0 * on_floor + 0.25 * 3.0 * on_wall)
    assert np.allclose(friction.c[:, 0], 0.3 * on_floor / friction.w, rtol=1e-15)
    assert np.array_equal(friction.B, q.B[friction.node])
    assert active_set.friction(q, -impulse, 1e-3).w.max() == 0.75    # a slip plane bears both ways


def test_admm_refuses_friction():
    rough = Conditions((Collider(sphere((0.0, 0.0), 1.0), "slip", friction=0.2),))
    with pytest.raises(ValueError, match="friction with the method 'admm'"):
        ImplicitStepper(Scheme(transfer="apic"), 0.1, 2, (0.0, 0.0), rough, options_of("admm"))


def test_conditions_that_touch_nothing_change_nothing():
    active_set, q = restrained([Collider(sphere((90.0, 0.0), 1.0))])
    assert not q.dv0.any()
    assert active_set.update(q.v, q.v) == 0


def test_a_plane_that_comes_and_goes_ends_bearing():
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate")
    active_set, q = restrained([floor])
    node = active_set.contacts.node
    up, down = q.v.copy(), q.v.copy()
    up[node, 1], down[node, 1] = 1.0, -1.0
    pulled, pushed = np.zeros_like(q.v), np.zeros_like(q.v)
    pulled[node, 1], pushed[node, 1] = -1.0, 1.0
    active_set.update(down, pushed)
    changes = [(active_set.update(up, pulled), active_set.update(down, pushed))
               for _ in range(RELEASES)]
    assert all(come == len(node) for _, come in changes)
    assert active_set.update(up, pulled) == 0
    assert (active_set.role == PLANE).all()
