"""The node-wise characteristic norm (HOT-sec5.2, HOT-eq9) against sums written out."""

import numpy as np
import pytest
from clouds import DX, Case, cloud, scattered
from constitutive import EPS, LAW, evaluate, lame_of
from threads import by_threads

from mpm_ref.body import Body
from mpm_ref.hot.norms import (
    characteristic_norms,
    dot,
    nodal_stiffness,
    rest_stiffness,
    scaled_norm,
    surface,
)
from mpm_ref.hot.potential import Potential
from mpm_ref.hot.system import unknowns_of
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.plain.spline import pairs

DT = 1e-2
SOFT, STIFF = (make_law("fixed_corotated", E=E, nu=0.4) for E in (1e5, 1e9))


def closed_form(mu, lam, d):
    """HOT-sec5.2, of a law with mu and lam at rest."""
    return np.sqrt((d * (d + 1) / 2 - 1) * 4 * mu**2 + (2 * mu + d * lam) ** 2)


def case(d):
    return Case("apic", 2, d)


def body(d, law, seed=0, shift=0.0):
    q = cloud(case(d), np.random.default_rng(seed))
    return Body("cloud", q._replace(x=q.x + shift), law, NoFlow(), np.arange(len(q.x)))


def two_bodies(d):
    """Overlapping by half, so that some nodes see one of them and some see both."""
    return body(d, SOFT), body(d, STIFF, seed=1, shift=2.5 * DX)


def nodes_of(bodies, d):
    """Unknowns of the nodes that the bodies reach."""
    q = bodies[0].particles
    joined = q._replace(**{name: np.concatenate([getattr(b.particles, name) for b in bodies])
                           for name in ("x", "v", "C", "L", "F", "tau", "m", "V0")})
    return unknowns_of(scattered(case(d), joined, DT))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", sorted(LAW))
def test_stiffness_is_the_norm_of_the_differential_at_rest(name, d):
    units = np.eye(d * d).reshape(d * d, d, d)
    dP = evaluate(LAW[name], np.tile(np.eye(d), (d * d, 1, 1)), units).differential
    assert rest_stiffness(LAW[name], d) == pytest.approx(np.sqrt((dP**2).sum()), rel=10 * EPS)


@pytest.mark.parametrize("d", [2, 3])
def test_closed_form_of_fixed_corotated(d):
    for law in (SOFT, STIFF, LAW["fixed_corotated"]):
        assert rest_stiffness(law, d) == pytest.approx(closed_form(*law, d), rel=EPS)
    assert closed_form(1.0, 2.0, 3) == pytest.approx(np.sqrt(20 + 64))       # as printed, in 3D


@pytest.mark.parametrize("name", sorted(LAW))
def test_every_law_is_as_stiff_at_rest_as_its_moduli_say(name):
    assert rest_stiffness(LAW[name], 3) == pytest.approx(
        closed_form(*lame_of(LAW[name]), 3), rel=10 * EPS)


def test_surface_of_the_cube_about_a_node():
    assert surface(0.1, 3) == pytest.approx(24 * 0.1**2)
    assert surface(0.1, 2) == pytest.approx(8 * 0.1)


@pytest.mark.parametrize("d", [2, 3])
def test_stiffness_of_nodes_is_the_mean_by_mass(d):
    bodies = two_bodies(d)
    unknowns = nodes_of(bodies, d)
    up, down = np.zeros((2, *unknowns.number.shape))
    for b in bodies:
        ip = pairs(b.particles.x, DX, 2)
        i = tuple(np.moveaxis(np.asarray(ip.node) - unknowns.origin, -1, 0))
        mass = ip.w * b.particles.m[:, None]
        np.add.at(up, i, mass * closed_form(*b.law, d))
        np.add.at(down, i, mass)
    expected = (up / np.where(down > 0, down, 1.0))[unknowns.number >= 0]
    xi = nodal_stiffness(bodies, unknowns, case(d).stencil)
    assert np.abs(xi / expected - 1).max() < 1e-12      # tiny weights: sums in another order
    assert xi.min() == pytest.approx(closed_form(*SOFT, d))     # a node of soft matter alone
    assert np.any((xi > 1.1 * xi.min()) & (xi < 0.9 * xi.max()))        # and mixed ones


def test_characteristic_norms_are_stiffness_times_surface_times_time():
    bodies = two_bodies(2)
    unknowns = nodes_of(bodies, 2)
    xi = nodal_stiffness(bodies, unknowns, case(2).stencil)
    kappa = characteristic_norms(bodies, unknowns, case(2).stencil, DT)
    assert np.allclose(kappa, xi * 8 * DX * DT, rtol=EPS, atol=0)


def test_same_bits_for_any_number_of_threads():
    bodies = two_bodies(3)
    unknowns = nodes_of(bodies, 3)
    assert np.array_equal(*by_threads(
        lambda: characteristic_norms(bodies, unknowns, case(3).stencil, DT)))


def test_one_material_gives_the_l2_rule():
    one = body(2, STIFF)
    unknowns = nodes_of([one], 2)
    kappa = characteristic_norms([one], unknowns, case(2).stencil, DT)
    g = np.random.default_rng(0).standard_normal(unknowns.v.shape)
    l2 = np.linalg.norm(g) / (closed_form(*STIFF, 2) * 8 * DX * DT) / np.sqrt(len(g))
    assert scaled_norm(g, kappa) == pytest.approx(l2, rel=1e-13)
    halves = [body(2, STIFF)._replace(name=name) for name in "ab"]
    assert np.array_equal(characteristic_norms(halves, unknowns, case(2).stencil, DT), kappa)


def residual(d, length, pressure, time):
    """Scaled gradient at dv = 0 of one problem in other units: [m], [Pa] and [s] as given."""
    speed = length / time
    mass = pressure * length**d / speed**2      # of an energy Pa m^d; in 2D per depth
    law = make_law("fixed_corotated", E=1e5 * pressure, nu=0.3)
    q = body(d, law).particles
    scaled = body(d, law)._replace(particles=q._replace(
        x=q.x * length, v=0.1 * q.v * speed, C=q.C * 0.0, m=q.m * mass, V0=q.V0 * length**d))
    unknowns = unknowns_of(scattered(case(d), q, 0.0))
    unknowns = unknowns._replace(dx=DX * length, m=unknowns.m * mass, v=0.1 * unknowns.v * speed)
    stencil, dt = case(d).stencil, DT * time
    gravity = np.arange(1.0, d + 1) * length / time**2
    _, g = Potential([scaled], unknowns, stencil, dt, gravity).evaluate(np.zeros_like(unknowns.v))
    return scaled_norm(g, characteristic_norms([scaled], unknowns, stencil, dt))


@pytest.mark.parametrize("d", [2, 3])
def test_residual_has_no_unit(d):
    plain = residual(d, 1.0, 1.0, 1.0)
    for units in ((8.0, 1.0, 1.0), (1.0, 1024.0, 1.0), (1.0, 1.0, 0.25), (3.0, 70.0, 0.11)):
        assert residual(d, *units) == pytest.approx(plain, rel=1e-9)
    assert plain > 1e-4


def test_norm_of_nothing_is_zero():
    assert scaled_norm(np.empty((0, 3)), np.empty(0)) == 0.0
    assert dot(np.empty((0, 2)), np.empty((0, 2))) == 0.0
