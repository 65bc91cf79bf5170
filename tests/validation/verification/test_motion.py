"""The mathematics of the experiments on moving bodies; the experiments themselves are not run."""

from math import cos, pi, radians, sin, sqrt

import numba
import numpy as np
import pytest

from mpm_ref.body import Body, particles_at
from mpm_ref.core.spline import STENCILS, base_of
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.scene import build
from validation.common.scenes import catalogue_scene, mean, record_settings, threads_for
from validation.nclaw.final_states import digest
from validation.verification import (
    bowl,
    collisions,
    dam_break,
    incline,
    rotation,
    sand_column,
)
from validation.verification.symplectic import allowed_gain, distance_travelled


def oscillator(steps, dt, explicit=False):
    """Total and elastic energy of x'' = -x from rest at x = 0 with speed 1, by Euler."""
    x, v, total, elastic = 0.0, 1.0, [0.5], [0.0]
    for _ in range(steps):
        x, v = (x + dt * v, v - dt * x) if explicit else (x + dt * (v - dt * x), v - dt * x)
        total.append(0.5 * (v * v + x * x))
        elastic.append(0.5 * x * x)
    return np.array(total), np.array(elastic)


def cloud(x, id=None):
    """A body of unit masses at x (N, d)."""
    x = np.asarray(x, dtype=float)
    q = particles_at(x, np.zeros_like(x), np.ones(len(x)), np.ones(len(x)))
    return Body("cloud", q, FixedCorotated(1.0, 1.0), NoFlow(),
                np.arange(len(x)) if id is None else np.array(id))


# symplectic Euler

def test_distance_is_the_sum_of_the_steps():
    v0, a, dt, x, v = 0.3, -1.7, 0.01, 0.0, 0.3
    for _ in range(250):
        v += dt * a
        x += dt * v
    assert x == pytest.approx(distance_travelled(v0, a, 2.5, dt), rel=1e-13)


@pytest.mark.parametrize("dt", [0.05, 0.01])
def test_energy_swings_as_much_as_allowed(dt):
    total, elastic = oscillator(round(50.0 / dt), dt)
    gain = total.max() - total[0]
    assert gain == pytest.approx(allowed_gain(elastic) * (1.0 + 0.5 * dt), rel=1e-3)


def test_explicit_euler_gains_more_than_allowed():
    total, elastic = oscillator(1000, 0.05, explicit=True)
    assert total.max() - total[0] > 10.0 * allowed_gain(elastic)


# spinning bodies

@pytest.mark.parametrize("dim", [2, 3])
def test_spin_matrix_is_the_cross_product(dim):
    x = np.array([0.3, -0.7, 1.1])[:dim]
    if dim == 3:
        expected = np.cross(rotation.SPIN * rotation.AXIS, x)
    else:
        expected = rotation.SPIN * np.array([-x[1], x[0]])
    assert rotation.spin_matrix(dim) @ x == pytest.approx(expected)


def test_pic_drops_the_spin_of_each_particles_surroundings():
    """Sum of (x_i - x_p) cross v_i w_ip over the nodes, for v = spin cross x, over L of a disk."""
    D = rotation.DX**2 * 3.0 / 12.0
    per_mass = D * (rotation.spin_matrix(2)[1, 0] - rotation.spin_matrix(2)[0, 1])
    total = 0.5 * rotation.RADIUS**2 * rotation.SPIN
    assert rotation.pic_loss() == pytest.approx(per_mass / total)


def test_loss_is_the_largest_of_all_steps():
    assert rotation.loss_per_step(np.array([[2.0], [2.0], [1.5], [1.4]])) == pytest.approx(0.25)


# collisions

def test_disks_touch_when_they_are_two_radii_apart():
    scene, t = catalogue_scene("colliding_disks"), collisions.touching_time()
    a, b = (np.array(body.shape.center) + t * np.array(body.velocity.linear)
            for body in scene.body)
    assert np.linalg.norm(b - a) == pytest.approx(2.0 * scene.body[0].shape.radius)
    assert t == pytest.approx((0.6 * sqrt(2.0) - 0.4) / (0.2 * sqrt(2.0)))


def test_splines_of_particles_three_cells_apart_do_not_overlap():
    nodes = len(STENCILS[2])
    x = np.linspace(0.0, 1.0, 101)[:-1]
    first = np.array([base_of(p, 1.0, STENCILS[2]) for p in x])
    far = np.array([base_of(p + 3.0, 1.0, STENCILS[2]) for p in x])
    near = np.array([base_of(p + 2.01, 1.0, STENCILS[2]) for p in x])
    assert (far >= first + nodes).all()
    assert (near < first + nodes).any()
    assert pytest.approx(nodes * sqrt(2.0)) == collisions.OVERLAP


def test_rings_have_the_published_energy():
    bodies = build(collisions.ring_scene(0.4, "mls")).bodies
    kinetic = sum(0.5 * float(b.particles.m @ np.sum(b.particles.v**2, axis=1)) for b in bodies)
    area = 2.0 * pi * (4.0**2 - 3.0**2)
    assert kinetic == pytest.approx(0.5 * 1000.0 * area * 30.0**2)


# inclines and bowls

@pytest.mark.parametrize("tilted", [False, True])
def test_slope_turns_gravity_or_itself(tilted):
    slope = incline.Slope(24.0, 15.0, tilted)
    gravity = slope.pull * slope.along - slope.press * slope.normal
    assert slope.along @ slope.normal == pytest.approx(0.0, abs=1e-15)
    assert np.linalg.norm(gravity) == pytest.approx(incline.G)
    if tilted:
        assert gravity == pytest.approx([0.0, -incline.G], abs=1e-14)
    else:
        assert slope.normal == pytest.approx([0.0, 1.0])


def test_acceleration_is_newtons():
    slope = incline.Slope(24.0, 15.0, True)
    expected = incline.G * (sin(radians(24.0)) - np.tan(radians(15.0)) * cos(radians(24.0)))
    assert slope.acceleration == pytest.approx(expected)
    assert incline.Slope(24.0, 24.1, True).acceleration == 0.0
    assert incline.Slope(24.0, 0.0, True).acceleration == pytest.approx(slope.pull)


def test_pendulum_speed_solves_its_equation():
    l, k2, angle, omega, dt = 0.9, 0.83, radians(60.0), 0.0, 1e-4
    depth = l * cos(angle)

    def rate(y):
        return np.array([y[1], -incline.G * l * sin(y[0]) / k2])

    y = np.array([angle, omega])
    while y[0] > 0.0:
        last = y
        k1 = rate(y)
        k_2 = rate(y + 0.5 * dt * k1)
        k3 = rate(y + 0.5 * dt * k_2)
        y = y + dt / 6.0 * (k1 + 2.0 * k_2 + 2.0 * k3 + rate(y + dt * k3))
    at_bottom = last[1] + (y[1] - last[1]) * last[0] / (last[0] - y[0])
    assert -at_bottom == pytest.approx(bowl.pendulum_speed(l, k2, depth), rel=1e-7)


# dam break

def ritter_flow(x, t, h0, g):
    """Depth and speed of Ritter's rarefaction: 9 g h = (2 c - x/t)^2, 3 u = 2 (x/t + c)."""
    c = sqrt(g * h0)
    return (2.0 * c - x / t) ** 2 / (9.0 * g), 2.0 / 3.0 * (x / t + c)


def test_ritters_flow_solves_the_shallow_water_equations():
    g, h0, x, t, eps = 9.81, 2.0, 1.3, 0.7, 1e-5

    def slope(f, axis):
        point = np.array([x, t])
        step = eps * np.eye(2)[axis]
        return (f(*(point + step)) - f(*(point - step))) / (2.0 * eps)

    def h(x, t):
        return ritter_flow(x, t, h0, g)[0]

    def flow(x, t):
        return np.prod(ritter_flow(x, t, h0, g))

    def thrust(x, t):
        depth, u = ritter_flow(x, t, h0, g)
        return depth * u * u + 0.5 * g * depth * depth

    assert slope(h, 1) + slope(flow, 0) == pytest.approx(0.0, abs=1e-8)
    assert slope(flow, 1) + slope(thrust, 0) == pytest.approx(0.0, abs=1e-7)


def test_ritters_front_is_where_the_depth_ends():
    a, g = dam_break.width(), dam_break.G
    T = 2.5
    t = T / sqrt(2.0 * g / a)
    x = (dam_break.ritter(T) - 1.0) * a
    depth, speed = ritter_flow(x, t, 2.0 * a, g)
    assert depth == pytest.approx(0.0, abs=1e-15)
    assert speed == pytest.approx(2.0 * sqrt(g * 2.0 * a))


def test_measured_front_speeds_up_but_stays_behind_ritter():
    T, Z = dam_break.MEASURED.T
    assert (np.diff(T) > 0.0).all()
    assert (np.diff(Z) > 0.0).all()
    assert (dam_break.ritter(T) > Z).all()


# columns of sand

def test_quarter_of_a_cylinder_has_its_mass():
    q = build(sand_column.column_scene(sand_column.SandColumn(3, 2.0, 4))).bodies[0].particles
    volume = pi * sand_column.WIDTH**2 / 4.0 * 2.0 * sand_column.WIDTH
    assert q.m.sum() == pytest.approx(1600.0 * volume, rel=1e-3)
    assert (q.x > 0.0).all()


def test_surface_is_the_highest_particle_of_each_ring():
    x = [[0.04, 0.0, 0.5], [0.0, 0.03, 0.9], [0.09, 0.12, 0.2]]
    surface = sand_column.surface(np.array(x), 0.1)
    assert surface == pytest.approx(np.array([[0.05, 0.9], [0.15, 0.2]]))


@pytest.mark.parametrize(("dim", "exponent"), [(2, 2.0 / 3.0), (3, 0.5)])
def test_quoted_laws_of_tall_columns_have_their_exponents(dim, exponent):
    ratio = sand_column.lube(dim, 8.0) / sand_column.lube(dim, 4.0)
    assert np.log2(ratio) == pytest.approx(exponent)


def test_quoted_law_leaves_the_gap_between_low_and_tall_open():
    assert sand_column.lube(2, 1.0) == pytest.approx(1.2)
    assert sand_column.lube(2, 2.0) is None
    assert sand_column.lube(3, 1.0) == pytest.approx(1.24)


# states and settings

def test_digest_knows_the_state_and_not_the_order():
    x = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    expected = digest(cloud(x))
    assert digest(cloud(x[[2, 0, 1]], id=[2, 0, 1])) == expected
    x[1, 0] = np.nextafter(x[1, 0], 1.0)
    assert digest(cloud(x)) != expected


def test_mean_weighs_by_mass():
    body = cloud([[0.0, 0.0], [1.0, 2.0]])
    body.particles.m[:] = 1.0, 3.0
    assert mean(body, "x") == pytest.approx([0.75, 1.5])


def test_few_particles_run_on_one_thread_for_a_while():
    before = numba.get_num_threads()
    with threads_for([cloud([[0.0, 0.0]])]):
        assert numba.get_num_threads() == 1
    assert numba.get_num_threads() == before


def test_settings_are_recorded_without_a_rule():
    """It stands with the printed number, in `validation/targets`."""
    taken = {}

    class Toy:
        def record(self, target, value, **others):
            taken[target] = (value, others)

    record_settings(Toy(), "hello", {"a.b.dx": 1.0 / 150.0, "a.b.n": 3})
    assert taken == {"a.b.dx": (1.0 / 150.0, {"scale": "scenes/hello.toml"}),
                     "a.b.n": (3, {"scale": "scenes/hello.toml"})}
