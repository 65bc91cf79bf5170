"""Adjoints of the grid update and of the conditions, against differences of the primal."""

import numpy as np
import pytest
from adjoints import H, like_grid, pairing, rate
from grids import DX, floor, grid_of, random_grid
from threads import MOST, by_threads

from mpm_ref.core.adjoint.boundary import solve_adjoint
from mpm_ref.core.adjoint.grid import Update, update_adjoint
from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed, solve
from mpm_ref.core.grid import Storage, update
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.solids import half_space, sphere

DT = 0.03
H_NODE = 1e-6       # of central differences: round-off is 1e-10 of a velocity of order 1
CLOSE = 1e-8


# the update

def momenta(rng, d, flip):
    """Grid of 6 or 7 nodes a side with random mass, momentum and force; a quarter is empty."""
    grid = Storage(DX, (0, 1, 2), d, flip).cover([np.array([[0.0] * d, [4 * DX] * d])])
    grid.m[:] = rng.uniform(0.5, 1.0, grid.m.shape) * (rng.random(grid.m.shape) > 0.25)
    grid.v[:] = rng.normal(size=grid.v.shape)
    if flip:
        grid.f[:] = rng.normal(size=grid.f.shape)
    return grid


def moved(grid, by, h):
    """m, v, f + h times theirs; empty nodes stay so."""
    f = grid.f + h * by.f
    full = grid.m > 0.0
    return grid._replace(m=grid.m + h * full * by.m, v=grid.v + h * by.v, f=f,
                         v_old=np.zeros_like(grid.v_old))


@pytest.mark.parametrize(("flip", "eps", "on_empty"),
                         [(True, 0.0, True), (False, 0.2, True), (False, 0.0, False)])
def test_update(d, rng, flip, eps, on_empty):
    """Taylor test in m, momentum, force and gravity."""
    grid, g, dg = momenta(rng, d, flip), rng.normal(size=d), rng.normal(size=d)
    bars, by = like_grid(grid, rng), like_grid(grid, rng)

    def after(h):
        new = moved(grid, by, h)
        update(new, g + h * dg, DT, eps, on_empty)
        return new

    def loss(h):
        return pairing((bars.v, bars.v_old), after(h)[1:4:2])

    got = bars._replace(m=np.zeros_like(grid.m), v=bars.v.copy(), f=np.zeros_like(grid.f))
    of_g = update_adjoint(after(0.0), got, g, Update(DT, eps, on_empty))
    slope = of_g @ dg + pairing(((grid.m > 0.0) * got.m, got.v), (by.m, by.v))
    slope += pairing([got.f], [by.f]) if flip else 0.0
    assert rate(loss, slope, 0.1 * H) == pytest.approx(2.0, abs=0.1)
    assert not got.v[grid.m == 0.0].any()
    assert not got.m[grid.m == 0.0].any()


# the conditions

TILTED = np.array([0.3, 1.0, 0.4])
SLIDING = Motion(translation=Steady((0.4, -0.1, 0.2)))


def plane(k, d, kind, friction=0.0, motion=None):
    """The k-th of some oblique half-spaces through a corner."""
    n = np.roll(TILTED, k)[:d]
    motion = motion or Motion()
    return Collider(half_space(-0.05 * n, n), kind, friction, motion)


def sliding(d):
    """A steady translation."""
    return Motion(translation=Steady(SLIDING.translation.value(1.0)[:d]))


def conditions(name, d):
    """One kind each, and kinds that meet."""
    n = d - 1
    return {
        "sticky": Conditions((floor(0.0, d, kind="sticky"),)),
        "slip": Conditions((floor(0.0, d, kind="slip", motion=sliding(d)),)),
        "separate": Conditions((floor(0.0, d, kind="separate"),)),
        "noslip": Conditions((floor(0.0, d, kind="noslip"), plane(0, d, "separate"))),
        "rubs": Conditions((plane(0, d, "separate", 1.0, sliding(d)),)),
        "slides": Conditions((plane(0, d, "slip", 0.2),)),
        "prescribed": Conditions((plane(0, d, "slip", 0.2),),
                                 (Prescribed(sphere((0.0,) * d, 0.25), sliding(d)),)),
        "edges": Conditions((plane(0, d, "separate", 0.2), plane(1, d, "slip", 0.1, sliding(d)),
                             plane(2, d, "separate", 0.05))),
        "walls": Conditions(walls=BoxWalls((0,) * d, (2,) * d, "separate", 0.3)),
        "squeezed": Conditions((floor(1.0, d, kind="slip"),
                                Collider(half_space((0.0,) * d, (0.0,) * n + (-1.0,)), "slip",
                                         motion=sliding(d)))),
    }[name]


NAMES = ("sticky", "slip", "separate", "noslip", "rubs", "slides", "prescribed", "edges", "walls",
         "squeezed")


def after_conditions(touched, grid, dv=0.0):
    """Velocities of the nodes (n, d) after the conditions, from grid.v + dv."""
    new = grid._replace(v=grid.v + dv)
    solve(*touched, new)
    return new.v.reshape(-1, grid.m.ndim)


def jacobians(touched, grid):
    """du_a/dv_b of each node (n, d, d) by central differences: nodes do not know each other."""
    columns = [(after_conditions(touched, grid, H_NODE * e)
                - after_conditions(touched, grid, -H_NODE * e)) / (2 * H_NODE)
               for e in np.eye(grid.m.ndim)]
    return np.stack(columns, axis=-1)


def bars_of(touched, grid, bar):
    """The adjoint of the conditions applied to a bar."""
    nodes = grid._replace(v=bar.copy())
    solve_adjoint(touched, grid, nodes)
    return nodes.v


@pytest.mark.parametrize("name", NAMES)
def test_conditions(name, d, rng):
    """Node by node the transpose of the Jacobian; each kind turns some nodes, and not all."""
    grid = random_grid(rng, d)
    touched = conditions(name, d).touched(grid, 1.0, DT)
    J, bar = jacobians(touched, grid), rng.normal(size=grid.v.shape)
    expected = np.einsum("nab,na->nb", J, bar.reshape(-1, d))
    got = bars_of(touched, grid, bar).reshape(-1, d)
    assert abs(got - expected).max() < CLOSE
    changed = (abs(got - bar.reshape(-1, d)) > 1e-3).any(axis=1).sum()
    assert 5 < changed < len(got)


@pytest.mark.parametrize("name", ["rubs", "edges"])
def test_friction_slides_and_sticks(name, d, rng):
    """Both branches occur, and the Jacobian of sliding nodes is not symmetric."""
    grid = random_grid(rng, d)
    touched = conditions(name, d).touched(grid, 1.0, DT)
    J = jacobians(touched, grid)
    skew = abs(J - np.swapaxes(J, 1, 2)).max(axis=(1, 2))
    identity = (abs(J - np.eye(d)) < CLOSE).all(axis=(1, 2))
    assert (skew > 0.01).sum() > 5
    assert (~identity & (skew < CLOSE)).sum() > 2


def test_conditions_taylor(rng):
    """Second-order remainder over all nodes, where edges rub; in 2D every branch is linear."""
    grid, bar, dv = random_grid(rng, 3), *(rng.normal(size=(2, 8, 8, 8, 3)))
    touched = conditions("edges", 3).touched(grid, 1.0, DT)
    slope = (bars_of(touched, grid, bar) * dv).sum()

    def loss(h):
        return (after_conditions(touched, grid, h * dv) * bar.reshape(-1, 3)).sum()

    assert rate(loss, slope, 1e-2 * H) == pytest.approx(2.0, abs=0.1)


def test_no_condition_changes_nothing(d, rng):
    grid, bar = random_grid(rng, d), rng.normal(size=(*d * (8,), d))
    assert np.array_equal(bars_of(([], [], []), grid, bar), bar)
    far = Conditions((floor(-9.0, d),)).touched(grid, 1.0, DT)
    assert np.array_equal(bars_of(far, grid, bar), bar)


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_two_threads_give_the_same_bits(rng):
    grid, bar = grid_of(rng.normal(size=(9, 9, 9, 3))), rng.normal(size=(9, 9, 9, 3))
    touched = conditions("edges", 3).touched(grid, 1.0, DT)

    def bars():
        nodes = grid._replace(m=np.zeros_like(grid.m), v=bars_of(touched, grid, bar))
        g = update_adjoint(grid, nodes, np.ones(3), Update(DT, 0.0, False))
        return nodes.v.copy(), nodes.m.copy(), g

    assert all(np.array_equal(a, b) for a, b in zip(*by_threads(bars)))
