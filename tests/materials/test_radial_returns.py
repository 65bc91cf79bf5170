"""Radial return maps on Hencky's law without singular values, beside those with them."""

from typing import NamedTuple

import numpy as np
import pytest
from constitutive import LAW, YOUNG, rotations
from flows import TAU_Y, VON_MISES, setting

from mpm_ref.body import Body, particles_at
from mpm_ref.core import deform
from mpm_ref.core.logarithm import LEAST_STRETCH, RADIUS
from mpm_ref.explicit import deform_body
from mpm_ref.materials import make_flow

RADIAL = ("drucker_prager", *VON_MISES)
ROUND_OFF = 4e-15       # of F, and of stresses in units of E; seen: 1.8e-15
DT = 0.1


class Outcome(NamedTuple):
    """Arrays of N particles after a step of deformation."""

    F: np.ndarray
    tau: np.ndarray
    y: np.ndarray


def returned(F, law, flow, y=TAU_Y, by=None):
    """`Outcome` of a loop of `deform`, that of `deform_body` unless it is given, for trial F."""
    n, d, _ = F.shape
    x = np.zeros((n, d))
    q = particles_at(x, x, np.ones(n), np.ones(n), "pic")._replace(y=np.full(n, y))
    q.F[:] = F
    if by is None:
        deform_body(Body("points", q, law, flow, np.arange(n)), DT)
    else:
        by(q, law, flow, DT, tuple(range(d)))
    return Outcome(q.F, q.tau, q.y)


def gradients(rng, eps):
    """F (N, d, d) of principal strains (N, d), turned at random."""
    n, d = eps.shape
    return rotations(rng, n, d) * np.exp(eps)[:, None, :] @ rotations(rng, n, d)


def directions(rng, d, n=60):
    """Deviators of size 1 (n, d)."""
    e = rng.standard_normal((n, d))
    e -= e.mean(axis=1, keepdims=True)
    return e / np.linalg.norm(e, axis=1, keepdims=True)


def radius(name, law, flow, tr, d):
    """|dev eps| on the surface of a flow."""
    if name == "drucker_prager":
        return -flow.alpha * (d * law.lam + 2 * law.mu) / (2 * law.mu) * tr
    return TAU_Y / (2 * law.mu)


def around_the_surface(name, d, rng, distance, tr=-0.05):
    """Law, flow and F with |dev eps| the distance times that on the surface."""
    law, flow = setting(name, d)
    size = distance * radius(name, law, flow, tr, d)
    return law, flow, gradients(rng, size * directions(rng, d) + tr / d)


def assert_same(one, other):
    assert np.abs(one.F - other.F).max() < ROUND_OFF
    assert np.abs(one.tau - other.tau).max() < ROUND_OFF * YOUNG
    assert np.abs(one.y - other.y).max() < ROUND_OFF * YOUNG


@pytest.mark.parametrize("distance", [0.0, 0.5, 1 - 1e-6, 1 + 1e-6, 1.01, 2.0, 4.0])
@pytest.mark.parametrize("name", RADIAL)
def test_equal_to_the_return_of_singular_values(name, distance, d, rng):
    law, flow, F = around_the_surface(name, d, rng, distance)
    found = returned(F, law, flow)
    assert_same(found, returned(F, law, flow, by=deform.plastic))
    assert (found.tau == found.tau.swapaxes(1, 2)).all()
    flows = np.abs(found.F - F).max(axis=(1, 2)) > 0
    assert (flows == (distance > 1)).all()
    if name in VON_MISES[1:]:
        assert ((found.y != TAU_Y) == flows).all()


@pytest.mark.parametrize("size", [1e-10, 1e-4, 0.02, 0.1, 0.3, 0.44, 0.46, 1.0])
@pytest.mark.parametrize("name", RADIAL)
def test_equal_for_tiny_and_for_large_strains(name, size, d, rng):
    eps = rng.standard_normal((60, d))
    eps *= size / np.linalg.norm(eps, axis=1, keepdims=True)
    law, flow = setting(name, d)
    y = size * law.mu
    if hasattr(flow, "tau_y"):
        flow = flow._replace(tau_y=y)
    F = gradients(rng, eps)
    found, other = returned(F, law, flow, y), returned(F, law, flow, y, by=deform.plastic)
    assert_same(found, other)
    same = np.array_equal(found.F, other.F)
    assert same == (size > RADIUS)          # singular values take over


@pytest.mark.parametrize("name", RADIAL)
def test_results_lie_on_the_surface_at_the_same_volume(name, d, rng):
    law, flow, F = around_the_surface(name, d, rng, 1.5)
    found = returned(F, law, flow)
    dev = found.tau - np.trace(found.tau, axis1=1, axis2=2)[:, None, None] * np.eye(d) / d
    on_surface = 2 * law.mu * radius(name, law, flow, -0.05, d)
    assert np.abs(np.linalg.norm(dev, axis=(1, 2)) - on_surface).max() < ROUND_OFF * YOUNG
    assert np.abs(np.linalg.det(found.F) - np.exp(-0.05)).max() < ROUND_OFF


def test_sand_in_tension_keeps_its_rotation_alone(d, rng):
    law, flow, F = around_the_surface("drucker_prager", d, rng, 1.0, tr=-0.05)
    F *= 1.05
    found = returned(F, law, flow)
    assert_same(found, returned(F, law, flow, by=deform.plastic))
    assert (found.tau == 0.0).all()
    assert np.abs(found.F @ found.F.swapaxes(1, 2) - np.eye(d)).max() < ROUND_OFF


def test_failure_releases_all_strain(d, rng):
    law, flow, F = around_the_surface("von_mises_softening", d, rng, 3.0)
    flow = flow._replace(theta=100.0)
    found = returned(F, law, flow)
    assert_same(found, returned(F, law, flow, by=deform.plastic))
    assert (found.y == 0.0).all()
    assert (found.tau == 0.0).all()
    again = returned(found.F * 1.01, law, flow, y=0.0)
    assert (again.tau == 0.0).all()
    assert np.abs(again.F - found.F).max() < ROUND_OFF


@pytest.mark.parametrize("name", RADIAL)
def test_objective_and_isotropic(name, d, rng):
    law, flow, F = around_the_surface(name, d, rng, 1.7)
    found, Q = returned(F, law, flow), rotations(rng, len(F), d)
    turned, material = returned(Q @ F, law, flow), returned(F @ Q, law, flow)
    assert_same(turned, Outcome(Q @ found.F, Q @ found.tau @ Q.swapaxes(1, 2), found.y))
    assert_same(material, Outcome(found.F @ Q, found.tau, found.y))


@pytest.mark.parametrize("s_min", [0.05, 0.6, LEAST_STRETCH, 0.9])
@pytest.mark.parametrize("name", RADIAL)
def test_trial_stretches_are_lifted(name, s_min, d, rng):
    law, flow = setting(name, d, s_min=s_min)
    F = gradients(rng, rng.uniform(-0.4, 0.1, (200, d)))
    assert_same(returned(F, law, flow), returned(F, law, flow, by=deform.plastic))


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("name", RADIAL)
def test_states_without_strain_are_as_those_of_singular_values(name, d, rng):
    law, flow = setting(name, d)
    F = gradients(rng, 0.1 * directions(rng, d, n=12))
    F[0, 0, 0] = np.nan
    F[1, 0, 0] = np.inf
    F[2, 0] *= -1.0
    F[3, 0] = 0.0
    F[4] *= 1e-150
    F[5] *= 1e150
    found, other = returned(F, law, flow), returned(F, law, flow, by=deform.plastic)
    for a, b in zip(found, other):
        assert np.array_equal(a[:6], b[:6], equal_nan=True)
    assert np.isnan(found.tau[0]).all()
    assert np.isfinite(found.tau[6:]).all()


def test_other_laws_keep_the_return_of_singular_values(d, rng):
    law = LAW["fixed_corotated"]
    flow = make_flow("von_mises_softening", law, d, tau_y=TAU_Y, theta=0.1)
    F = gradients(rng, 0.2 * directions(rng, d))
    assert not deform.is_radial(law, flow)
    found, other = returned(F, law, flow), returned(F, law, flow, by=deform.plastic)
    assert all(np.array_equal(a, b) for a, b in zip(found, other))
