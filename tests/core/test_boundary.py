"""Conditions on a grid: which nodes carry them, motion, impulses. Walls: core/test_walls.py."""

import os
import subprocess
import sys
from math import cos, pi, sin
from pathlib import Path

import numba
import numpy as np
import pytest
from grids import DX, applied, floor, grid_of, positions, random_grid

from mpm_ref.core.boundary import Collider, Conditions, Prescribed, nclaw_walls
from mpm_ref.core.levelset import box, half_space, sphere
from mpm_ref.core.motion import Keyframes, Motion, Steady, rotation

# where the wall is

def test_nodes_on_the_wall_and_below_carry_the_condition(d):
    """0.3 is not 3 * 0.1 in binary: the node is on the wall all the same."""
    v, u, _ = applied(grid_of(np.ones((*d * (6,), d))), floor(0.3, d))
    assert not u[..., :4, :].any()
    assert (u[..., 4:, :] == v[..., 4:, :]).all()


@pytest.mark.parametrize("dx", [0.04, 1 / 150, 1e-3, 0.7])
def test_rounding_moves_no_wall(dx):
    """A wall through any node, given as a decimal: that node is the last one in it."""
    for k in range(1, 200, 7):
        grid = grid_of(np.ones((3, 2, 2)), k - 1, dx=dx)
        applied(grid, Collider(half_space((float(f"{k * dx:.15g}"), 0), (1, 0))))
        assert (grid.v[:, 0, 0] == (0, 0, 1)).all()


def test_a_wall_between_nodes_acts_from_the_node_below():
    _, u, _ = applied(grid_of(np.ones((2, 6, 2))), floor(0.4 - 1e-7, 2))
    assert (u[0, :, 0] == (0, 0, 0, 0, 1, 1)).all()


def test_container_and_collider_meet_on_the_surface(d):
    """A box and its outside share the nodes of the surface."""
    shape = box(d * [0.2], d * [0.4])
    v, u, _ = applied(grid_of(np.ones((*d * (7,), d))), Collider(shape))
    w = applied(grid_of(v), Collider(shape, inside=True))[1]
    x = np.rint(positions(grid_of(v)) / DX)
    inside = ((x >= 2) & (x <= 4)).all(axis=-1)
    within = (x == 3).all(axis=-1)
    assert (u[..., 0] == np.where(inside, 0.0, 1.0)).all()
    assert (w[..., 0] == np.where(within, 1.0, 0.0)).all()


def test_a_container_pushes_inward():
    v, u, _ = applied(grid_of(np.ones((5, 5, 2))),
                      Collider(sphere((0.2, 0.2), 0.2), "separate", inside=True))
    assert (u[4, 2] == (0, 1)).all()          # leaves at the right
    assert (u[0, 2] == v[0, 2]).all()         # comes in from the left
    assert u[4, 4] == pytest.approx((0, 0))   # leaves along the diagonal


def test_nodes_without_mass_are_left_alone(d, rng):
    grid = random_grid(rng, d)
    v, u, _ = applied(grid, floor(9.0, d), walls=nclaw_walls(20, 10, d))
    assert (u[grid.m == 0.0] == v[grid.m == 0.0]).all()
    assert not u[grid.m > 0.0].any()


# motion

def test_rotating_collider_moves_its_nodes_rigidly(d):
    """v = omega x (x - c) in a disk or ball about c, by hand."""
    c, omega = np.array([0.3, 0.2, 0.3])[:d], 2.0
    motion = Motion(rotation=Steady(omega), center=c, axis=(0, 0, 1) if d == 3 else None)
    grid = grid_of(np.full((*d * (7,), d), 9.0))
    _, u, _ = applied(grid, Collider(sphere(c, 0.25), motion=motion))
    r = positions(grid) - c
    inside = (r**2).sum(axis=-1) < 0.25**2
    expected = omega * np.stack((-r[..., 1], r[..., 0], 0.0 * r[..., 0])[:d], axis=-1)
    assert u[inside] == pytest.approx(expected[inside], abs=1e-13)
    assert (u[~inside] == 9.0).all()


def test_a_turned_and_moved_box_contains_its_nodes(d):
    """A square turned by 45 degrees (about z), after a unit time at velocity (0.1, 0, ..)."""
    c, half = np.full(d, 0.3), 0.2 / np.sqrt(2.0)
    e = np.eye(d)[0]
    motion = Motion(Steady(0.1 * e), center=c,
                    orientation=rotation(pi / 4, (0, 0, 1) if d == 3 else None))
    grid = grid_of(np.zeros((*d * (8,), d)))
    _, u, _ = applied(grid, Collider(box(c - half, c + half), motion=motion))
    r = np.rint((positions(grid) - c) / DX) - e
    inside = abs(r[..., 0]) + abs(r[..., 1]) <= 2
    if d == 3:
        inside &= abs(r[..., 2]) <= 1
    assert (u[inside] == pytest.approx(np.broadcast_to(0.1 * e, u.shape)[inside], abs=1e-15))
    assert not u[~inside].any()


def test_a_turned_plane_has_a_turned_normal(d):
    """A floor turned by 30 degrees: a falling node slides down along (cos, -sin) or its mirror."""
    motion = Motion(orientation=rotation(pi / 6, (0, 1, 0) if d == 3 else None))
    v = np.zeros((*d * (3,), d))
    v[..., -1] = -1.0
    grid = grid_of(v, origin=-1)
    _, u, _ = applied(grid, floor(0.0, d, kind="slip", motion=motion))
    slope = 1.0 if d == 3 else -1.0     # about y, z turns towards x; in the plane, y towards -x
    down = sin(pi / 6) * np.array([slope * cos(pi / 6), 0.0, -sin(pi / 6)])
    down = down if d == 3 else down[[0, 2]]
    assert u[(1,) * d] == pytest.approx(down, abs=1e-15)
    n = np.array([slope * sin(pi / 6), 0.0, cos(pi / 6)])
    below = positions(grid) @ (n if d == 3 else n[[0, 2]]) <= 1e-12
    assert u[below] == pytest.approx(np.broadcast_to(down, u.shape)[below], abs=1e-15)
    assert (u[~below] == grid_of(v).v[~below]).all()


def test_prescribed_region_that_follows_or_stays():
    """A slab pulled along x at 1 m/s: after 0.2 s it has left the nodes where it was, or not."""
    slab, motion = box((-0.05, -1), (0.05, 1)), Motion(Steady((1.0, 0.0)))
    follows, stays = (Prescribed(slab, motion, follows=f) for f in (True, False))
    for region, column in ((follows, 2), (stays, 0)):
        _, u, _ = applied(grid_of(np.zeros((4, 2, 2))), prescribed=(region,), t=0.2)
        assert (u[..., 1] == 0.0).all()
        assert u[column, :, 0] == pytest.approx(1.0)
        assert np.count_nonzero(u) == 2


def test_prescribed_region_stands_where_its_place_is_as_the_step_begins():
    """A place that moves by two cells in 0.2 s, and a step of 0.1 s that ends then: one cell."""
    slab, motion = box((-0.05, -1), (0.05, 1)), Motion(Steady((0.5, 0.0)))
    region = Prescribed(slab, motion, place=Motion(Steady((1.0, 0.0))))
    _, u, _ = applied(grid_of(np.zeros((4, 2, 2))), prescribed=(region,), t=0.2)
    assert u[1, :, 0] == pytest.approx(0.5)
    assert np.count_nonzero(u) == 2


@pytest.mark.parametrize(("t", "holds"), [(0.1, False), (0.2, True), (0.3, True), (0.4, False)])
def test_prescribed_region_holds_from_one_time_to_another(t, holds):
    slab = Prescribed(box((-0.05, -1), (0.05, 1)), Motion(Steady((1.0, 0.0))), follows=False,
                      since=0.1, until=0.1 + 0.1 + 0.1)
    _, u, _ = applied(grid_of(np.zeros((4, 2, 2))), prescribed=(slab,), t=t)
    assert u[0, :, 0] == pytest.approx(1.0 if holds else 0.0)


def test_a_time_of_holding_that_is_none_is_refused():
    with pytest.raises(ValueError, match=r"since = 0\.3, until = 0\.2"):
        Prescribed(box((-0.05, -1), (0.05, 1)), since=0.3, until=0.2)


def test_prescribed_nodes_override_colliders_and_walls(d):
    pull = Motion(Steady(np.ones(d)))
    region = Prescribed(half_space(np.zeros(d), np.eye(d)[0]), pull, follows=False)
    _, u, _ = applied(grid_of(np.full((*d * (4,), d), -1.0)), floor(9.0, d),
                      prescribed=(region,), walls=nclaw_walls(9, 4, d))
    assert u[0] == pytest.approx(1.0)
    assert not u[1:].any()


def test_a_stop_within_a_step_ends_where_the_schedule_does():
    """Velocities of the steps, times dt, add up to the path: 0.25 m at 1 m/s in steps of 0.1 s."""
    motion, path = Motion(Keyframes((0.0, 0.25), ((0.0, 0.0), (0.25, 0.0)))), 0.0
    for step in range(1, 6):
        piston = Collider(half_space((1, 0), (1, 0)), motion=motion)
        u = applied(grid_of(np.zeros((1, 1, 2))), piston, t=0.1 * step)[1]
        path += 0.1 * u[0, 0, 0]
    assert path == pytest.approx(0.25)


# impulses, order, threads

def crowd(d):
    """Colliders of all kinds that overlap."""
    e = np.eye(d)
    spin = Motion(rotation=Steady(1.0), axis=(0, 0, 1) if d == 3 else None)
    return (
        floor(-0.1, d, kind="separate", friction=0.3),
        Collider(half_space(0.1 * e[0], -e[0] - e[-1]), "slip", friction=0.1),
        Collider(half_space(-0.2 * e[0], e[0]), "noslip"),
        Collider(sphere(np.zeros(d), 0.15), "sticky", motion=spin),
    )


def test_impulses_are_what_the_matter_gained(d, rng):
    grid = random_grid(rng, d)
    v, u, J = applied(grid, *crowd(d), walls=nclaw_walls(6, 1, d))
    gained = (grid.m[..., None] * (u - v)).reshape(-1, d).sum(axis=0)
    assert J.shape == (4 + 2 * d, d)
    assert J.sum(axis=0) == pytest.approx(gained, abs=1e-12)
    assert (abs(J[:4]).max(axis=1) > 0.1).all()


def test_impulse_of_a_floor():
    """Five nodes of 2 kg fall at 3 m/s on a floor with friction 0.5; they slide at 4 m/s."""
    grid = grid_of(np.broadcast_to((4.0, -3.0), (5, 1, 2)), m=2.0)
    _, u, J = applied(grid, floor(0.0, 2, kind="separate", friction=0.5))
    assert u == pytest.approx(np.broadcast_to((2.5, 0.0), (5, 1, 2)))
    assert J[0] == pytest.approx((-15.0, 30.0))


def test_order_of_the_colliders_does_not_matter(d, rng):
    grid = random_grid(rng, d)
    v, u, J = applied(grid, *crowd(d))
    for order in ((3, 2, 1, 0), (1, 3, 0, 2)):
        _, w, I = applied(grid_of(v, -3, grid.m), *(crowd(d)[k] for k in order))
        assert abs(w - u).max() < 1e-13
        assert abs(I - J[list(order)]).max() < 1e-12


def test_the_same_bits_for_any_number_of_threads(d, rng):
    grid, seen = random_grid(rng, d, 12, -6), set()
    before, threads = grid.v.copy(), numba.get_num_threads()
    for n in range(1, numba.config.NUMBA_NUM_THREADS + 1):
        numba.set_num_threads(n)
        grid.v[:] = before
        J = Conditions(crowd(d), walls=nclaw_walls(6, 1, d)).apply(grid, 1.0, 0.1)
        seen.add((grid.v.tobytes(), J.tobytes()))
    numba.set_num_threads(threads)
    assert len(seen) == 1


def test_without_compiler_the_same():
    """The kernels as plain Python, in a process of their own."""
    code = ("import numpy as np\n"
            "from tests.core.test_boundary import applied, crowd, random_grid\n"
            "for d in (2, 3):\n"
            "    _, v, J = applied(random_grid(np.random.default_rng(1), d, 5, -2), *crowd(d))\n"
            "    print(*v.ravel(), *J.ravel())")
    root = Path(__file__).parents[2]
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1",
           "PYTHONPATH": os.pathsep.join((str(root), str(root / "tests/support")))}
    out = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True,
                         check=True).stdout
    for d, line in zip((2, 3), out.splitlines()):
        _, v, J = applied(random_grid(np.random.default_rng(1), d, 5, -2), *crowd(d))
        plain = np.array(line.split(), dtype=float)
        assert plain == pytest.approx(np.concatenate((v.ravel(), J.ravel())), abs=1e-14)


# the rest

def test_nothing_to_do(d, rng):
    grid = random_grid(rng, d)
    v, u, J = applied(grid)
    assert (u == v).all()
    assert J.shape == (0, d)
    v, u, J = applied(grid, floor(-9.0, d))
    assert (u == v).all()
    assert (J == 0.0).all()


def test_moves():
    assert not Conditions((floor(0.0, 2),), walls=nclaw_walls(20, 3)).moves
    assert Conditions((floor(0.0, 2, motion=Motion(Steady((1, 0)))),)).moves
    assert Conditions(prescribed=(Prescribed(sphere((0, 0), 1), Motion(rotation=Steady(1))),)).moves


@pytest.mark.parametrize(("make", "said"), [
    (lambda: floor(0.0, 2, kind="stick"), "kind = 'stick': expected one of sticky, slip, separate"),
    (lambda: floor(0.0, 2, kind="slip", friction=-1.0), "friction = -1.0: expected"),
    (lambda: floor(0.0, 2, kind="slip", friction=np.nan), "friction = nan: expected"),
    (lambda: floor(0.0, 2, friction=0.1), "friction = 0.1 with kind 'sticky'"),
    (lambda: applied(grid_of(np.ones((2, 2, 2))), floor(0.0, 3)), "in 2D"),
])
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
