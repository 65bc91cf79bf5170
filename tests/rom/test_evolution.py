"""Deformation gradients that a reduced run evolves on the grid, in place of those of its map."""

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.rom.evolution import EvolvedGradients
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.kinematics import Kinematics, NoBody
from mpm_ref.rom.latent import Latent, start_state
from mpm_ref.rom.quadrature import Cloud
from mpm_ref.rom.quadrature.eulerian import Eulerian
from mpm_ref.rom.quadrature.lagrangian import lagrangian
from mpm_ref.rom.step import ldm_stepper, next_gradients
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_model
from validation.ldm.studies import fallen

DX, DT, RHO, POINTS = 0.17, 0.01, 800.0, 18
LAW = FixedCorotated(3e3, 4e3)
GRAVITY = np.array([1.0, -9.8, 3.0])


def anything(d):
    """A linear map that reaches every position and velocity of its points, whose F at other
    coordinates than those of its first state means nothing; and that state, with rates.
    """
    X, rng, r = cloud(d, POINTS), np.random.default_rng(1), POINTS * d
    x = X + 0.1 * rng.uniform(-1.0, 1.0, (r, POINTS, d))
    F = np.eye(d) + 0.2 * rng.uniform(-1.0, 1.0, (r, POINTS, d, d))
    g = modes(X, x, F, r)
    U = g.derivatives(X, np.zeros(r))[2].reshape(r, r)
    return g, np.linalg.solve(U, (x[0] - X).ravel()), rng.normal(size=r)


def quadrature(X, degree=2):
    """Lagrangian quadrature of points of unequal volumes."""
    V0 = np.random.default_rng(2).uniform(0.5, 1.5, len(X)) / len(X)
    return lagrangian(X, RHO * V0, V0, DX, degree)


def full_run(g, latent, transfer, steps):
    """Particles of the full model after steps from a state of a map."""
    X, d = g.X, g.dim
    x, F, G = g.derivatives(X, latent.xhat)
    sizes = quadrature(X)
    q = particles_at(x, G @ latent.vhat, sizes.m, sizes.V0, transfer)
    body = Body("full", q._replace(F=F.copy()), LAW, NoFlow(), np.arange(len(X)))
    stepper = Stepper(Scheme(2, transfer), DX, d, GRAVITY[:d])
    stepper.start([body])
    for k in range(steps):
        stepper.step([body], k * DT, DT)
    return body.particles


def reduced_run(g, latent, steps, samples=None, **options):
    """The `Latent` after reduced steps from a state."""
    model = ldm_stepper(g, quadrature(g.X), LAW, GRAVITY[:g.dim], **options)
    every = np.arange(len(g.X)) if samples is None else samples
    for k in range(steps):
        latent, _ = model.step(latent, every, k * DT, DT)
    return latent


@pytest.mark.parametrize("projection", ["linear", "nonlinear"])
def test_steps_that_evolve_F_and_that_nothing_restrains_are_those_of_the_full_model(d, projection):
    g, xhat, vhat = anything(d)
    start = Latent(xhat, vhat, xhat - DT * vhat)
    particles = full_run(g, start, "pic", 4)
    size = abs(particles.v).max()
    after = {name: reduced_run(g, start, 4, deformation_gradient=name, projection=projection)
             for name in ("map", "evolved")}
    v = {name: g.velocity(g.X, one.before, one.vhat) for name, one in after.items()}
    assert abs(v["evolved"] - particles.v).max() < 1e-12 * size
    assert abs(g.place(g.X, after["evolved"].xhat) - particles.x).max() < 1e-13
    assert abs(after["evolved"].gradients.F - particles.F).max() < 1e-12
    assert abs(v["map"] - particles.v).max() > 1e-3 * size
    assert after["map"].gradients is None


@pytest.mark.parametrize("transfer", ["apic", "mls"])
def test_affine_transfers_evolve_F_by_their_own_velocity_gradient(d, transfer):
    g, xhat, _ = anything(d)
    start = start_state(xhat)           # at rest: without an affine field, as the full model
    particles = full_run(g, start, transfer, 1)
    after = reduced_run(g, start, 1, deformation_gradient="evolved", transfer=transfer)
    assert abs(after.gradients.F - particles.F).max() < 1e-13
    assert abs(particles.F - g.derivatives(g.X, xhat)[1]).max() > 1e-4


def test_points_that_enter_take_the_gradient_of_the_map():
    F = np.arange(16.0).reshape(4, 2, 2)
    held = EvolvedGradients(np.array([2, 5, 7, 9]), F)
    asked, of_map = np.array([0, 5, 8, 9, 11]), -np.ones((5, 2, 2))
    found = held.gradients_of(asked, of_map)
    np.testing.assert_array_equal(found[[1, 3]], F[[1, 3]])
    np.testing.assert_array_equal(found[[0, 2, 4]], of_map[:3])
    assert held.gradients_of(held.numbers, of_map) is F


def test_a_point_between_the_samples_keeps_its_gradient():
    g, xhat, vhat = anything(2)
    start, samples = Latent(xhat, vhat, xhat), np.array([0, 1])
    few = reduced_run(g, start, 1, samples, deformation_gradient="evolved")
    numbers, F = few.gradients
    assert len(samples) < len(numbers) < POINTS
    neighbour = np.flatnonzero(~np.isin(numbers, samples))[0]

    def step(numbers, F):
        latent = few._replace(gradients=EvolvedGradients(numbers, F))
        return reduced_run(g, latent, 1, samples, deformation_gradient="evolved").vhat

    changed = F.copy()
    changed[neighbour] *= 1.1
    assert abs(step(numbers, changed) - step(numbers, F)).max() > 1e-6
    foreign = np.setdiff1d(np.arange(POINTS), numbers)[:1]
    known = np.union1d(numbers, foreign)
    more = np.tile(2.0 * np.eye(2), (len(known), 1, 1))
    more[np.isin(known, numbers)] = F
    assert np.array_equal(step(known, more), step(numbers, F))


def test_a_gradient_that_is_not_finite_stops_the_run_with_its_point():
    g, xhat, vhat = anything(2)
    few = reduced_run(g, Latent(xhat, vhat, xhat), 1, deformation_gradient="evolved")
    few.gradients.F[5] = np.nan
    with pytest.raises(NoBody):
        reduced_run(g, few, 1, deformation_gradient="evolved")
    cloud = Cloud(Kinematics(None, None, few.gradients.F), None, None, None, {}, np.arange(POINTS))
    with pytest.raises(NoBody, match=r"of 1 of 18 points are not finite .* of point 5; take"):
        next_gradients(cloud, np.zeros((POINTS, 2, 2)), 0.0, DT)


def test_unknown_gradients_and_points_of_cells_are_refused():
    g, *_ = anything(2)
    with pytest.raises(ValueError, match="deformation_gradient = 'carried': expected one of map, "
                       "evolved"):
        ldm_stepper(g, quadrature(g.X), LAW, GRAVITY[:2], deformation_gradient="carried")
    cells = Eulerian(g.X, RHO, lambda X: X[:, 0] - 1.0, g.X, DX, 2)
    with pytest.raises(ValueError, match="deformation_gradient = 'evolved': expected 'map', since"):
        ldm_stepper(g, cells, LAW, GRAVITY[:2], deformation_gradient="evolved")


@pytest.mark.parametrize("quadrature", ["eulerian", "resampled"])
def test_a_study_refuses_evolved_gradients_without_material_points(quadrature):
    full = ldm_full_model(fallen(1.0))
    options = RunOptions(quadrature, deformation_gradient="evolved")
    with pytest.raises(ValueError, match=f"'evolved' with quadrature = '{quadrature}': expected "
                       "'lagrangian'"):
        ldm_model(full, Affine(3), options)
