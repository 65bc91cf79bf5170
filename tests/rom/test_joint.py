"""Latent coordinates that position and stress share."""

import numpy as np
import pytest

from mpm_ref.body import Body, particles_at
from mpm_ref.core.motion import rotation
from mpm_ref.explicit import deform_body
from mpm_ref.materials import Hencky, NeoHookean, NoFlow, make_flow
from mpm_ref.rom.fields.joint_latent import (
    JointInversion,
    JointStepper,
    Stacked,
    joint,
    stretch_of,
)
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.quadrature.lagrangian import NumberedPoints
from mpm_ref.rom.snapshots import Histories, join_histories
from mpm_ref.rom.step import MaterialPoints, nsf_stepper
from mpm_ref.rom.symmetric import values

LAW, NO_FLOW = Hencky(3e3, 4e3), NoFlow()
LEVELS, N = 17, 50
SIZES = Sizes(r=2, modes=4, tau=4, C=2, smoothing=1e-8)


def stress_of(F):
    """Kirchhoff stresses of Hencky's law."""
    n, d = F.shape[:2]
    q = particles_at(np.zeros((n, d)), np.zeros((n, d)), np.ones(n), np.ones(n), "pic")
    q.F[:] = F
    deform_body(Body("b", q, LAW, NoFlow(), np.arange(n)), 0.0)
    return q.tau


def test_stretches_have_the_stresses_they_are_found_from(d, rng):
    F = np.eye(d) + 0.3 * rng.normal(size=(20, d, d))
    V = stretch_of(stress_of(F), LAW)
    assert np.abs(V - V.transpose(0, 2, 1)).max() < 1e-14
    assert np.abs(V @ V - F @ F.transpose(0, 2, 1)).max() < 1e-12
    assert np.abs(stress_of(V) - stress_of(F)).max() < 1e-12 * LAW.lam


def to_and_fro(d, reach):
    """A run that goes out and back along one pattern; its stress grows with each step either way,
    as a force of friction does: the same place, another sign.
    """
    rng = np.random.default_rng(0)
    X, pattern = rng.uniform(size=(N, d)), rng.normal(size=(N, d))
    P = rng.normal(size=(N, d * (d + 1) // 2))
    phase = np.linspace(0.0, 2.0 * np.pi, LEVELS)[:, None, None]
    x, tau = X + 0.1 * reach * np.sin(phase) * pattern, reach * np.cos(phase) * P
    ones = np.ones(N)
    C = 0.1 * np.cos(phase) * np.ones((LEVELS, N, d * d))
    return Histories(X, ones, ones / N, np.zeros((1, N, d)), np.array([[reach]]), x[None],
                     tau[None], C[None], 0.01)


@pytest.fixture
def runs(d):
    """Histories of three runs."""
    return join_histories([to_and_fro(d, reach) for reach in (0.8, 1.0, 1.2)])


def test_places_that_have_two_stresses_are_told_apart(runs):
    """Latent coordinates of positions know a mean of both alone."""
    def off(fields, xhat):
        found = [values(fields.stress(np.arange(N), y)) for y in xhat[1]]
        return np.linalg.norm(found - runs.tau[1]) / np.linalg.norm(runs.tau[1])

    both, xhat, _ = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    assert off(both, xhat) < 1e-4
    alone, xhat = fit_pod_fields(runs, Sizes(r=1, modes=1, tau=1, C=1), 0.3, follows=False)
    assert off(alone, xhat) > 0.5


def test_fields_meet_the_places_they_are_made_of(runs):
    fields, xhat, _ = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    for level in (3, 11):
        x = fields.place(np.arange(N), xhat[1, level])
        assert np.abs(x - runs.x[1, level]).max() < 1e-9


def test_scales_are_root_mean_squares(runs):
    _, _, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    assert scale.x == pytest.approx(np.sqrt(np.mean((runs.x - runs.X) ** 2)))
    assert scale.tau == pytest.approx(np.sqrt(np.mean(runs.tau**2)))


def test_derivatives_by_differences(runs, rng):
    fields, xhat, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    both = Stacked(fields, scale, 0.7)
    y, direction, points = xhat[1, 3], rng.normal(size=2) * np.abs(xhat).max(), np.array([3, 8, 41])
    at, none, G = both.derivatives(points, y)
    assert none is None
    assert np.array_equal(at, both.place(points, y))
    errors = [np.abs(both.place(points, y + t * direction) - at - t * (G @ direction)).max()
              for t in (1e-2, 5e-3)]
    assert errors[0] < 1e-9 or 3.5 < errors[0] / errors[1] < 4.5


def material(d):
    """The points at rest."""
    return MaterialPoints(np.ones(N), np.full(N, 1.0 / N), np.zeros((N, d)))


def stepper_of(fields, scale, law=LAW, flow=NO_FLOW, weight=0.03):
    """A model of the points with joint latent coordinates."""
    own, d = material(fields.dim), fields.dim
    quadrature = NumberedPoints(own.m, own.V0, 0.4, 2)
    return JointStepper(fields, quadrature, JointInversion(scale, weight), np.zeros(d), None,
                        "apic", "difference", own.v, law=law, flow=flow)


def test_without_weight_the_stress_has_no_say(runs):
    fields, xhat, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    at, some = Latent(xhat[1, 3], before=xhat[1, 3]), np.arange(0, N, 3)
    d = fields.dim
    plain, _ = nsf_stepper(fields, material(d), 0.4, 2, np.zeros(d)).step(at, some, 0.0, 1e-3)
    none, with_it = (stepper_of(fields, scale, weight=w).step(at, some, 0.0, 1e-3)[0]
                     for w in (1e-9, 1.0))
    assert np.abs(fields.place(some, none.xhat) - fields.place(some, plain.xhat)).max() < 1e-9
    assert np.abs(with_it.xhat - none.xhat).max() > 1e-6


def test_samples_carry_the_stress_of_their_fields_through_the_step(runs, d):
    """A cloud that turns as a whole turns its stress with it; the step stretches it by half the
    square of its angle, 2e-10, times moduli of 1e4 Pa.
    """
    fields, _, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    stepper = stepper_of(fields, scale, flow=make_flow("von_mises", LAW, d, tau_y=1e9))
    X, omega, dt = runs.X, 2.0, 1e-5
    spin = np.zeros((d, d))
    spin[0, 1], spin[1, 0] = -omega, omega
    tau = np.tile(np.diag([2.0, -1.0, 0.5][:d]), (N, 1, 1))
    q = particles_at(X, X @ spin.T, np.full(N, 1e6), np.full(N, 1e-9), transfer="apic")
    q.C[:], q.tau[:] = spin, tau
    first = particles_at(X[:5], 0.0 * X[:5], np.zeros(5), np.zeros(5), transfer="pic")
    trial = stepper.on_grid(Body("b", q, LAW, NoFlow(), np.arange(N)),
                            Body("samples", first, None, NoFlow(), np.arange(5)), 0.0, dt)
    R = rotation(omega * dt, None if d == 2 else (0.0, 0.0, 1.0))
    assert np.abs(trial.tau - R @ tau[:5] @ R.T).max() < 4e-6
    assert np.abs(trial.tau - tau[:5]).max() > 4e-5


def test_samples_with_weights_are_refused(runs):
    fields, xhat, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    stepper = stepper_of(fields, scale)
    at, some = Latent(xhat[1, 3], before=xhat[1, 3]), np.arange(0, N, 3)
    with pytest.raises(ValueError, match="samples with weights: expected samples that all count"):
        stepper.step(at, some, 0.0, 1e-3, np.ones(len(some)))


def test_runs_without_stress_are_refused(runs):
    with pytest.raises(ValueError, match="stresses of 0 Pa, root mean square: expected some"):
        joint(runs._replace(tau=0.0 * runs.tau), SIZES, 0.3)


@pytest.mark.parametrize(("law", "flow"), [
    (NeoHookean(1.0, 1.0), NoFlow()),
    (LAW, make_flow("von_mises_hardening", LAW, 3, tau_y=1.0, xi=0.1))])
def test_other_materials_are_refused(runs, law, flow):
    fields, _, scale = joint(runs, SIZES._replace(modes=2, tau=1, C=1), 0.3)
    with pytest.raises(ValueError, match="expected Hencky's law, whose stress determines"):
        stepper_of(fields, scale, law, flow)
