"""Conditions at the surfaces of colliders, between the nodes."""

import numpy as np
import pytest
from grids import DX, grid_of, positions
from hypothesis import given
from hypothesis import strategies as st
from threads import by_threads

from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.levelset import box, distances, half_space, normals, sphere
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.surface import NEAR, SurfaceConditions, largest_energy
from mpm_ref.plain.surface import held_velocities, surface_row

NORMALS = {2: ((0.0, 1.0), (0.6, 0.8), (-0.7, 0.3), (1.0, -1.0)),
           3: ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.7, 0.3, 0.5), (1.0, -1.0, 1.0))}


def full_grid(rng, d, v=None, n=9):
    """A grid all of whose nodes have mass, with random masses and velocities."""
    shape = d * (n,)
    v = rng.normal(size=(*shape, d)) if v is None else v
    return grid_of(v, -2, rng.uniform(0.5, 2.0, shape))


def place_of(grid):
    """A point near the middle of a grid, on no node."""
    return positions(grid).reshape(-1, grid.m.ndim).mean(axis=0) + 0.37 * DX


def constrained(grid, *colliders, **conditions):
    """Velocities before and after, and the impulses."""
    before = grid.v.copy()
    J = SurfaceConditions(colliders, **conditions).apply(grid, 1.0, 0.1)
    return before, grid.v, J


def rows_of(grid, shape):
    """The plain rows of a shape's points, and their normals (K, d)."""
    x = positions(grid).reshape(-1, grid.m.ndim)
    d, n = distances(x, shape) / DX, normals(x, shape)
    near = np.flatnonzero((d < NEAR - 1e-6) & (grid.m.reshape(-1) > 0.0))
    nodes = list(np.ndindex(grid.m.shape))
    return [surface_row(nodes[k], d[k], n[k], grid.m) for k in near], n[near]


def at_surface(v, rows):
    """Velocities (K, d) that rows interpolate."""
    return np.array([sum(a * v[node] for node, a in row.items()) for row in rows])


def planes(d):
    """Half-planes of several inclinations, through no node."""
    return [half_space(0.4 + 0.037 * np.arange(d), n) for n in NORMALS[d]]


def solid_of(name, d):
    """A curved or edged shape."""
    return sphere(d * [0.4], 0.17) if name == "sphere" else box(d * [0.23], d * [0.51])


# what it is for

def test_points_interpolate_linear_fields_exactly(d, rng):
    """v = G d(x), with d the distance from a plane, is 0 there: second order needs no more."""
    for shape in planes(d):
        grid = full_grid(rng, d, n=11)
        height = distances(positions(grid).reshape(-1, d), shape).reshape(grid.m.shape)
        inner = [row for row in rows_of(grid, shape)[0] if len(row) > 1 and is_inner(row, grid)]
        assert len(inner) > 5
        v = height[..., None] * rng.normal(size=d)
        assert at_surface(v, inner) == pytest.approx(0.0, abs=1e-12)


def is_inner(row, grid):
    """Whether the first node of a row is three cells or more from the edge of the grid."""
    return all(3 <= k < n - 3 for k, n in zip(next(iter(row)), grid.m.shape, strict=True))


def test_a_linear_field_that_rests_at_a_wall_is_left_alone(d, rng):
    grid = full_grid(rng, d)
    height = positions(grid)[..., -1] - 0.437
    grid.v[:] = height[..., None] * rng.normal(size=d)
    before, after, _ = constrained(grid, Collider(half_space(d * [0.437], np.eye(d)[-1])))
    deep = height < -2.0 * DX
    assert after[~deep] == pytest.approx(before[~deep], abs=1e-11)
    assert after[deep] == pytest.approx(0.0, abs=1e-15)


def test_a_plane_on_nodes_makes_their_velocities_odd(rng):
    """The nodes on the wall rest, and those behind it mirror those in front."""
    grid = full_grid(rng, 2)
    wall = half_space((0.2, 0.0), (1.0, 0.0))
    _, u, _ = constrained(grid, Collider(wall, "sticky"))
    assert u[4] == pytest.approx(0.0, abs=1e-10)
    assert u[3] == pytest.approx(-u[5], abs=1e-10)


# against the plain twin, whose equations are solved at once

@pytest.mark.parametrize("name", ["sphere", "box"])
def test_sticky_velocities_are_those_of_the_plain_twin(d, name, rng):
    """Also where nodes have no mass."""
    grid, shape = full_grid(rng, d), solid_of(name, d)
    grid.m[rng.random(grid.m.shape) < 0.2] = 0.0
    rows, _ = rows_of(grid, shape)
    expected, l = held_velocities(grid.v, grid.m, rows, np.zeros((len(rows), d)))
    _, u, J = constrained(grid, Collider(shape))
    assert u == pytest.approx(expected, abs=1e-8)
    assert J[0] == pytest.approx(l.sum(axis=0), abs=1e-8)
    assert at_surface(u, rows) == pytest.approx(0.0, abs=1e-9)


def test_light_nodes_of_a_plane_do_not_count(rng):
    """Beside heavy ones; else points that share a light node need as many sweeps as it is light."""
    grid, shape = full_grid(rng, 2), planes(2)[1]
    grid.m[rng.random(grid.m.shape) < 0.3] = 1e-5
    rows, _ = rows_of(grid, shape)
    _, u, _ = constrained(grid, Collider(shape))
    assert at_surface(u, rows) == pytest.approx(0.0, abs=1e-6)


def test_matter_counts_as_squeezed_beyond_ten_times_the_speeds():
    m, v, walls = np.ones(3), np.ones((3, 2)), np.array([[0.0, -2.0]])
    assert largest_energy(m, v, walls) == pytest.approx(100.0 * (3.0 + 6.0))


def test_a_moving_collider_has_its_velocity_at_the_foot_point(rng):
    """A disk that turns: omega x r at its surface, not at the node behind."""
    c, omega = np.array([0.21, 0.17]), 3.0
    grid, shape = full_grid(rng, 2), sphere(c, 0.25)
    turning = Motion(rotation=Steady(omega, start=0.9), center=c)
    rows, n = rows_of(grid, shape)
    _, u, _ = constrained(grid, Collider(shape, motion=turning))
    expected = 0.25 * omega * np.stack([-n[:, 1], n[:, 0]], axis=1)
    assert at_surface(u, rows) == pytest.approx(expected, abs=1e-8)


# rules

@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_matter_may_leave_a_separating_surface_and_not_approach_it(d, mu, rng):
    """The normal velocity is >= 0, the normal load too, one of both is zero; and Coulomb's law."""
    for shape in (*planes(d), solid_of("sphere", d)):
        grid = full_grid(rng, d)
        rows, n = rows_of(grid, shape)
        v, u, J = constrained(grid, Collider(shape, "separate", mu))
        l, w = loads(grid.m, v, u, rows), at_surface(u, rows)
        load, speed = np.einsum("ka,ka->k", l, n), np.einsum("ka,ka->k", w, n)
        assert load.min() > -1e-8
        assert speed.min() > -1e-8
        assert abs(load * speed).max() < 1e-8
        assert min(np.count_nonzero(load > 1e-6), np.count_nonzero(speed > 1e-6)) > 0
        shear, slip = l - load[:, None] * n, w - speed[:, None] * n
        assert (np.linalg.norm(shear, axis=1) <= mu * load + 1e-8).all()
        slides = np.linalg.norm(slip, axis=1) > 1e-6
        against = -np.einsum("ka,ka->k", shear, slip)[slides]
        assert against == pytest.approx((mu * load * np.linalg.norm(slip, axis=1))[slides],
                                        abs=1e-7)
        assert J[0] == pytest.approx(l.sum(axis=0), abs=1e-7)


def loads(m, v, u, rows):
    """Impulses (K, d) at the surface points that take v to u."""
    nodes = sorted({node for row in rows for node in row})
    A = np.array([[row.get(node, 0.0) for node in nodes] for row in rows])
    momentum = np.array([m[node] * (u[node] - v[node]) for node in nodes])
    l, *_ = np.linalg.lstsq(A.T, momentum, rcond=None)
    assert A.T @ l == pytest.approx(momentum, abs=1e-7)
    return l


def test_slip_holds_the_normal_velocity_alone(d, rng):
    shape = planes(d)[1]
    grid = full_grid(rng, d)
    rows, n = rows_of(grid, shape)
    v, u, _ = constrained(grid, Collider(shape, "slip"))
    assert np.einsum("ka,ka->k", at_surface(u, rows), n) == pytest.approx(0.0, abs=1e-9)
    tangent = np.linalg.svd(n[:1])[2][1:]
    assert (u - v) @ tangent.T == pytest.approx(0.0, abs=1e-10)


def test_noslip_sticks_on_approach_and_releases_on_separation(rng):
    wall = half_space((0.137, 0.0), (1.0, 0.0))
    for speed in (-1.0, 1.0):
        grid = full_grid(rng, 2)
        grid.v[:] = (speed, 0.5)
        rows, _ = rows_of(grid, wall)
        v, u, _ = constrained(grid, Collider(wall, "noslip"))
        if speed > 0.0:
            assert (u == v).all()
        else:
            assert at_surface(u, rows) == pytest.approx(0.0, abs=1e-9)


def test_prescribed_nodes_keep_their_velocity(rng):
    grid = full_grid(rng, 2)
    region = Prescribed(box((0.25, 0.05), (0.45, 0.25)), Motion(Steady((1.0, 2.0))),
                        follows=False)
    wall = half_space((0.0, 0.137), (0.0, 1.0))
    rows, _ = rows_of(grid, wall)
    _, u, _ = constrained(grid, Collider(wall, "slip"), prescribed=(region,))
    x = positions(grid)
    held = ((x > (0.24, 0.04)) & (x < (0.46, 0.26))).all(axis=-1)
    assert u[held] == pytest.approx(np.tile((1.0, 2.0), (np.count_nonzero(held), 1)))
    free = [row for row in rows if not any(held[node] for node in row)]
    assert at_surface(u, free)[:, 1] == pytest.approx(0.0, abs=1e-8)


def test_walls_counted_in_nodes_act_on_nodes(rng):
    grid = full_grid(rng, 2)
    v, u, J = constrained(grid, walls=BoxWalls((0, None), (None, None), "sticky"))
    assert u[:2] == pytest.approx(0.0, abs=1e-15)
    assert (u[2:] == v[2:]).all()
    assert J.shape == (4, 2)


# conservation

@given(st.integers(0, 2**32 - 1), st.sampled_from((2, 3)),
       st.sampled_from(("sticky", "slip", "separate")))
def test_momentum_and_its_moment_come_from_the_surface(seed, d, kind):
    """sum m dv = sum of the loads, and its moment is theirs at the foot points."""
    rng = np.random.default_rng(seed)
    grid, shape = full_grid(rng, d, n=6), planes(d)[rng.integers(4)]
    rows, _ = rows_of(grid, shape)
    v, u, J = constrained(grid, Collider(shape, kind, 0.3 if kind == "separate" else 0.0))
    x, p = positions(grid), grid.m[..., None] * (u - v)
    scale = abs(p).sum()
    assert J[0] == pytest.approx(p.reshape(-1, d).sum(axis=0), abs=1e-9 * scale)
    l, feet = loads(grid.m, v, u, rows), at_surface(x, rows)
    inner = np.array([len(row) > 2 ** (d - 1) for row in rows])
    assert distances(feet[inner], shape) == pytest.approx(0.0, abs=1e-9)
    moment, expected = x.reshape(-1, d).T @ p.reshape(-1, d), feet.T @ l
    assert moment - moment.T == pytest.approx(expected - expected.T, abs=1e-8 * scale)


def test_two_planes_hold_their_edge(d, rng):
    """The order in which colliders are listed does not matter but for round-off."""
    grid = full_grid(rng, d)
    first, second = planes(d)[0], half_space(d * [0.237], np.eye(d)[0])
    rows = [*rows_of(grid, first)[0], *rows_of(grid, second)[0]]
    a, b = Collider(first), Collider(second)
    other = grid_of(grid.v, -2, grid.m)
    u, w = constrained(grid, a, b)[1], constrained(other, b, a)[1]
    assert at_surface(u, rows) == pytest.approx(0.0, abs=1e-8)
    assert u == pytest.approx(w, abs=1e-8)


@pytest.mark.parametrize("kind", ["sticky", "separate"])
def test_between_plates_that_close_on_each_other_conditions_hold_at_nodes(kind, rng):
    """A hundredth of a cell is left between them: nodes would have to move 100 times as fast."""
    grid = full_grid(rng, 2)
    floor = Collider(half_space((0.0, 0.137), (0.0, 1.0)), kind)
    lid = Collider(half_space((0.0, 0.148), (0.0, -1.0)), kind, motion=Motion(Steady((0.0, -1.0),
                                                                                   start=0.99)))
    other = grid_of(grid.v, -2, grid.m)
    _, u, J = constrained(grid, floor, lid)
    expected = Conditions((floor, lid)).apply(other, 1.0, 0.1)
    assert (u == other.v).all()
    assert (J == expected).all()


def test_same_bits_for_any_number_of_threads(d, rng):
    base = full_grid(rng, d)
    shape = solid_of("sphere", d)

    def run():
        grid = grid_of(base.v, -2, base.m)
        constrained(grid, Collider(shape, "separate", 0.3))
        return grid.v.tobytes()

    assert len(set(by_threads(run))) == 1


def test_nan_stays_visible(rng):
    grid = full_grid(rng, 2)
    grid.v[4, 4] = np.nan
    _, u, _ = constrained(grid, Collider(planes(2)[0], "separate", 0.2))
    assert np.isnan(u).any()


def test_nodes_alone_are_refused_where_conditions_of_nodes_are_asked_for(rng):
    conditions = SurfaceConditions((Collider(planes(2)[0]),))
    with pytest.raises(ValueError, match='boundary = "surface": expected "nodes" for adjoints'):
        conditions.touched(full_grid(rng, 2), 0.0, 0.1)
