"""The mathematics of the verification problems: forcings, exact solutions, orders."""

from math import asin, pi, sqrt

import numpy as np
import pytest
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from mpm_ref.core.spline import weights
from mpm_ref.materials import LogNeoHookean, lame
from validation.verification import axis_aligned, oedometer, vortex_motion
from validation.verification.axis_aligned import AxisAligned
from validation.verification.bar import frequency
from validation.verification.cantilever import deflected, timoshenko
from validation.verification.convergence import extrapolated, order, rms
from validation.verification.manufactured import energy_density
from validation.verification.settled_columns import (
    WATER,
    Column,
    Settled,
    place_error,
    stress_errors,
)
from validation.verification.vortex_motion import INNER, OUTER, Vortex, part_in_ring

MU, LAM = lame(1e6, 0.3)
LAW, RHO0 = LogNeoHookean(MU, LAM), 1000.0
MATTER = (MU, LAM, RHO0)


def ring_points(rng, n):
    r, theta = rng.uniform(INNER, OUTER, n), rng.uniform(0.0, 2.0 * pi, n)
    return r[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)


def vortex_closed_form(turn, period, t, r, sign=-1.0):
    """b_R, b_theta as in the literature, written by hand; sign is that of the last term."""
    s = (r - 1.0) / -0.5
    h, h1, h2 = 1 - 8 * s**2 + 16 * s**4, (64 * s**3 - 16 * s) / -0.5, (192 * s**2 - 16) / 0.25
    g, g1 = turn * np.sin(pi * t / period), turn * pi / period * np.cos(pi * t / period)
    g2 = -((pi / period) ** 2) * g
    shear = MU / RHO0 * (3 * g * h1 + r * g * h2) - r * g2 * h
    bend, turn_in = MU / RHO0 * r * (g * h1) ** 2, r * (g1 * h) ** 2
    c, s = np.cos(g * h), np.sin(g * h)
    return np.stack([shear * s + (bend - turn_in) * c, -shear * c + (bend + sign * turn_in) * s], 1)


def test_axis_aligned_forcing_is_that_of_the_motion(d, rng):
    for X, t in ((rng.random(d), rng.random()) for _ in range(2)):
        b = axis_aligned.forcing_by_differences(LAW, RHO0, (0.05, 30.0), X, t)
        ours = axis_aligned.forcing(d)(*MATTER, 0.05, 30.0, t, *X)
        np.testing.assert_allclose(ours, b, rtol=1e-12, atol=1e-12 * max(map(abs, b)))


def test_axis_aligned_forcing_is_the_closed_form(d, rng):
    X, t, A, c = rng.random((50, d)), 0.013, 0.05, sqrt(1e3)
    motion = AxisAligned(X, LAW, RHO0, A, c)
    u = motion.position(t) - X
    F = np.einsum("pii->pi", motion.gradient(t))
    log_J = np.log(np.prod(F, axis=1, keepdims=True))
    b = pi**2 * u * (4 * MU / RHO0 - c**2 - 4 * (LAM * (log_J - 1) - MU) / (RHO0 * F**2))
    ours = motion.body_force(t)
    assert np.abs(ours - b).max() < 1e-11 * np.abs(b).max()


def test_vortex_forcing_is_that_of_the_motion(rng):
    for X, t in zip(ring_points(rng, 3), rng.random(3), strict=True):
        b = vortex_motion.forcing_by_differences(LAW, RHO0, (1.0, 1.0), X, t)
        radial = X / np.hypot(*X)
        b_r, b_t = vortex_motion.forcing()(*MATTER, 1.0, 1.0, t, np.hypot(*X))
        ours = b_r * radial + b_t * np.array([-radial[1], radial[0]])
        np.testing.assert_allclose(ours, b, rtol=0, atol=1e-12 * np.hypot(*b))


def test_vortex_forcing_is_the_closed_form_with_a_minus():
    r, t = np.linspace(INNER, OUTER, 101), 0.2
    ours = vortex_motion.forcing()(*MATTER, 1.0, 1.0, t, r)
    size = np.abs(ours).max()
    assert np.abs(ours - vortex_closed_form(1.0, 1.0, t, r)).max() < 1e-12 * size
    printed = vortex_motion.printed_forcing(MATTER, 1.0, 1.0, t, r)
    assert np.abs(printed - vortex_closed_form(1.0, 1.0, t, r, sign=1.0)).max() < 1e-12 * size
    assert 1e-4 < np.abs(printed - ours).max() / size < 1e-2


def test_energy_of_the_differences_is_the_law(d, rng):
    F = np.eye(d) + 0.2 * rng.standard_normal((d, d))
    J = np.linalg.det(F)
    psi = MU / 2 * ((F * F).sum() - d) - MU * np.log(J) + LAM / 2 * np.log(J) ** 2
    assert float(energy_density(LAW)(F.tolist())) == pytest.approx(psi, rel=1e-12)


@pytest.mark.parametrize("name", ["axis-aligned", "vortex"])
def test_motions_are_consistent(name, rng):
    """Velocity and F are derivatives of the position."""
    t, h = 0.013, 1e-6
    X = rng.random((20, 2)) if name == "axis-aligned" else ring_points(rng, 20)

    def motion(X):
        if name == "vortex":
            return Vortex(X, 0.01, MATTER, 1.0, 1.0)
        return AxisAligned(X, LAW, RHO0, 0.05, 30.0)

    v = (motion(X).position(t + h) - motion(X).position(t - h)) / (2 * h)
    assert np.abs(motion(X).velocity(t) - v).max() < 1e-6 * np.abs(v).max()
    for j, e in enumerate(np.eye(2)):
        column = (motion(X + h * e).position(t) - motion(X - h * e).position(t)) / (2 * h)
        assert np.abs(motion(X).gradient(t)[:, :, j] - column).max() < 1e-7


def test_vortex_is_isochoric_and_at_rest_at_its_edges(rng):
    motion = Vortex(ring_points(rng, 50), 0.01, MATTER, 1.0, 1.0)
    assert np.abs(np.linalg.det(motion.gradient(0.3)) - 1.0).max() < 1e-13
    edge = Vortex(np.array([[INNER, 0.0], [0.0, OUTER]]), 0.01, MATTER, 1.0, 1.0)
    assert np.abs(edge.gradient(0.3) - np.eye(2)).max() < 1e-13
    assert np.abs(edge.velocity(0.3)).max() < 1e-13


def test_parts_of_particles_fill_the_ring():
    """Better than counting particles: the area of the ring, to the accuracy of the sub-squares."""
    h = 0.05
    a = np.arange(-30, 30) * h + h / 2
    X = np.stack(np.meshgrid(a, a, indexing="ij"), -1).reshape(-1, 2)
    share, center = part_in_ring(X, h)
    area = pi * (OUTER**2 - INNER**2)
    assert abs(share.sum() * h**2 / area - 1.0) < 5e-4
    assert ((INNER <= center) & (center <= OUTER)).all()
    counted = ((np.hypot(*X.T) > INNER) & (np.hypot(*X.T) < OUTER)).sum() * h**2
    assert abs(counted / area - 1.0) > 1e-3


@pytest.mark.parametrize("bend", [0.1, 1.0, 2.0, 10.0])
def test_elastica_by_elliptic_integrals(bend):
    """[Bisshopp1945]: sqrt(P a^2/EI) = K(k) - F(phi, k), sin(phi) = 1/(k sqrt 2)."""
    low, high = sqrt(0.5) + 1e-12, 1.0 - 1e-12
    for _ in range(200):
        k = 0.5 * (low + high)
        longer = ellipk(k * k) - ellipkinc(asin(1 / (k * sqrt(2))), k * k) > sqrt(bend)
        low, high = (low, k) if longer else (k, high)
    m = k * k
    sunk = 1.0 - 2.0 / sqrt(bend) * (ellipe(m) - ellipeinc(asin(1 / (k * sqrt(2))), m))
    assert -deflected(bend, 1.0, 1.0)[-1, 1] == pytest.approx(sunk, rel=1e-6)


def test_elastica_of_a_small_load_is_timoshenko():
    x, y = deflected(1e-5, 8.0, EI=1e5, EA=1e6, GA=4e5)[-1]
    assert -y == pytest.approx(timoshenko(1e-5, 8.0, 1e5, 4e5), rel=1e-6)
    assert x == pytest.approx(8.0, rel=1e-9)


def test_stiff_shear_and_length_are_the_elastica():
    exact = deflected(2.0, 1.0, 1.0)[-1]
    np.testing.assert_allclose(deflected(2.0, 1.0, 1.0, EA=1e9, GA=1e9)[-1], exact, rtol=1e-6)


@pytest.mark.parametrize("key", oedometer.LAWS)
def test_oedometer_closed_form_is_the_derivative_of_the_energy(key):
    """P = d psi/ds at F = diag(s, 1), from energies written in terms of s."""
    law, s, h = oedometer.LAWS[key], 0.75, 1e-6
    mu, lam = law

    def psi(s):
        return {"fixed-corotated": mu * (s - 1) ** 2 + lam / 2 * (s - 1) ** 2,
                "hencky": (mu + lam / 2) * np.log(s) ** 2,
                "log-neo-hookean": mu / 2 * (s**2 - 1) - mu * np.log(s) + lam / 2 * np.log(s) ** 2,
                }[key]

    P, _ = oedometer.closed_form(law, s)
    assert pytest.approx((psi(s + h) - psi(s - h)) / (2 * h), rel=1e-8) == P


def test_exact_water_has_no_error():
    X = np.linspace(0.0, 2.0, 20001)
    p = WATER.rho0 * WATER.g * (WATER.height - X)
    J = 1.0 - p / WATER.law.lam
    x = np.concatenate([[0.0], np.cumsum(0.5 * (J[1:] + J[:-1]) * np.diff(X))])
    state = Settled(X, x, -p)
    assert place_error(WATER, state) < 1e-9
    assert stress_errors(WATER, state) == (0.0, 0.0)
    assert stress_errors(WATER, state._replace(stress=0.0 * p)) == (pytest.approx(0.5), 1.0)


def test_a_lost_column_has_the_largest_error():
    assert stress_errors(Column(LAW, 1.0, 1.0), None) == (1.0, 1.0)


def test_frequency_of_a_cosine():
    t = (np.arange(400) + 0.5) * 0.01
    assert frequency(np.cos(5.3 * t), 0.01) == pytest.approx(5.3, rel=1e-5)


def test_order_and_limit():
    h = np.array([0.4, 0.2, 0.1])
    assert order(h, 3.0 * h**1.7) == pytest.approx(1.7)
    assert np.isnan(order(h, [1.0, np.inf, 1.0]))
    assert extrapolated(h, 5.0 + 2.0 * h**2, 2) == pytest.approx(5.0)
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(sqrt(12.5))


def test_why_mls_gradients_of_quadratic_splines_are_of_first_order():
    """C = sum_i w_ip v_i r_ip / D of v = x^2 is 2 x + M/D, M = sum_i w_ip r_ip^3: the third moment
    of cubic splines is zero, that of quadratic ones is not. See verification.compaction.
    """
    for stencil, exact in (((0, 1, 2), False), ((0, 1, 2, 3), True)):
        s = 0.5 * (len(stencil) - 2) + np.array([0.1, 0.3, 0.7])
        moments = [sum(w * (k - f) ** 3 for k, w in zip(stencil, weights(f, stencil), strict=True))
                   for f in s]
        assert (np.abs(moments).max() < 1e-14) == exact
