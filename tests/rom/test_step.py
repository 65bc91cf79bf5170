"""Reduced steps against steps of the full model."""

import dataclasses
import hashlib

import numpy as np
import pytest
from grids import positions
from problems import run_python
from rom_toys import cloud, decoder

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.rom import step
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.elastic import ElasticMap
from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.latent import Latent, start_state
from mpm_ref.rom.quadrature.eulerian import Eulerian
from mpm_ref.rom.quadrature.lagrangian import lagrangian
from mpm_ref.rom.sampling import draw
from mpm_ref.rom.step import ReducedStepper, ldm_stepper

DX, DT, STEPS, RHO = 0.17, 0.01, 6, 800.0
ROUNDING = 1e-15        # of velocities [m/s] of about 0.1: a decoder rounds by its number of points
LAW = FixedCorotated(3e3, 4e3)
GRAVITY = np.array([1.0, -9.8, 3.0])


@pytest.fixture(params=(2, 3), ids=("quadratic", "cubic"))
def degree(request):
    """Of the splines."""
    return request.param


def with_affine(body, C, transfer):
    """The body with the affine velocity field of a transfer."""
    q = body.particles
    new = particles_at(q.x, q.v, q.m, q.V0, transfer)
    new.C[:] = C
    return body._replace(particles=new._replace(F=q.F))


# steps on an exact manifold

class Stirred:
    """All nodes move by an affine field that changes with time."""

    def __init__(self, d):
        rng = np.random.default_rng(5)
        self.L, self.turn, self.c = rng.normal(size=(d, d)), rng.normal(size=(d, d)), GRAVITY[:d]

    def apply(self, grid, t, dt):
        """v_i = (2 L + 20 t turn) x_i + t c."""
        grid.v[:] = positions(grid) @ (2.0 * self.L + 20.0 * t * self.turn).T + t * self.c


def weights(n, d):
    """Masses [kg] and volumes at rest [m^d] of n points."""
    V0 = np.random.default_rng(2).uniform(0.5, 1.5, n) / n
    return RHO * V0, V0


def full(X, x, v, F=None, law=LAW):
    """Body of the full model in a state."""
    q = particles_at(x, v, *weights(*X.shape), "pic")
    return Body("full", q if F is None else q._replace(F=F.copy()), law, NoFlow(),
                np.arange(len(X)))


def full_steps(body, conditions, gravity, degree, steps=STEPS, transfer="pic"):
    """The body's particles after explicit steps."""
    stepper = Stepper(Scheme(degree, transfer), DX, len(gravity), gravity, conditions)
    stepper.start([body])
    for k in range(steps):
        stepper.step([body], k * DT, DT)
    return body.particles


def distance(X):
    """Signed distance, in the largest norm, from the surface of the unit box [m]."""
    return np.max(abs(X - 0.5), axis=1) - 0.5


def quadrature(name, X, degree):
    """Quadrature of a body of points X that fill the unit box."""
    if name == "eulerian":
        return Eulerian(X, RHO, distance, X[::4], DX, degree)
    return lagrangian(X, *weights(*X.shape), DX, degree)


def reduced_steps(model, latent, count, steps=STEPS):
    """Latent state after steps with `count` samples, drawn anew each time."""
    n, rng = len(model.quadrature.X), np.random.default_rng(7)
    chosen = draw(n, count, model.field.r, model.field.dim)
    for k in range(steps):
        latent, report = model.step(latent, chosen(rng), k * DT, DT)
        assert report.rank == model.field.r
    return latent


def test_a_reduced_run_keeps_the_memory_that_it_frees(monkeypatch):
    asked, X = [], np.random.default_rng(1).uniform(size=(9, 2))
    monkeypatch.setattr(step, "keep_freed_memory", lambda: asked.append(True))
    ldm_stepper(Affine(2), lagrangian(X, *weights(9, 2), DX, 2), LAW, GRAVITY[:2])
    assert asked == [True]


def moving(xhat, vhat):
    """A reduced state that a step at these rates has led to."""
    return Latent(xhat, vhat, xhat - DT * vhat)


def largest_difference(map, latent, X, particles):
    """Of x, v and F of a reduced state from those of the full model's particles."""
    x, F, _ = map.derivatives(X, latent.xhat)
    v = map.velocity(X, latent.fitted_at, latent.vhat)
    pairs = zip((x, v, F), (particles.x, particles.v, particles.F), strict=True)
    return max(abs(a - b).max() for a, b in pairs)


@pytest.mark.parametrize("projection", ["linear", "nonlinear"])
@pytest.mark.parametrize("name", ["lagrangian", "eulerian"])
def test_a_stirred_body_moves_as_in_the_full_model(d, degree, name, projection):
    X, map, conditions = cloud(d, 150), Affine(d), Stirred(d)
    particles = full_steps(full(X, X, 0.0 * X), conditions, GRAVITY[:d], degree)
    model = ldm_stepper(map, quadrature(name, X, degree), LAW, GRAVITY[:d],
                        projection=projection, conditions=conditions)
    latent = reduced_steps(model, start_state(map.rest), 12)
    assert abs(particles.F - np.eye(d)).max() > 0.1
    assert largest_difference(map, latent, X, particles) < 1e-12


@pytest.mark.parametrize("projection", ["linear", "nonlinear"])
@pytest.mark.parametrize("name", ["lagrangian", "eulerian"])
def test_a_thrown_body_falls_as_in_the_full_model(d, degree, name, projection):
    """The grid decides here; Eulerian samples also read nodes that no quadrature point reaches."""
    X, map, v = cloud(d, 150), Affine(d), np.array([2.0, 4.0, -3.0])[:d]
    particles = full_steps(full(X, X, np.tile(v, (150, 1))), None, GRAVITY[:d], degree)
    model = ldm_stepper(map, quadrature(name, X, degree), LAW, GRAVITY[:d],
                    projection=projection)
    thrown = np.hstack([np.zeros((d, d)), v[:, None]]).ravel()
    latent = reduced_steps(model, start_state(map.rest, thrown), 12)
    assert abs(particles.x - X).max() > DX
    assert largest_difference(map, latent, X, particles) < 1e-12


@pytest.mark.parametrize("transfer", ["apic", "mls"])
@pytest.mark.parametrize("name", ["lagrangian", "eulerian"])
def test_a_body_without_stress_keeps_its_affine_velocity(d, degree, name, transfer):
    """As in the full model, where PIC would average it over nodes. A shear, whose C stays."""
    X, map, soft = cloud(d, 150), Affine(d), FixedCorotated(0.0, 0.0)
    C = np.outer([1.5, 2.0, 1.0][:d], [4.0, -3.0, 0.0][:d])
    rate = np.hstack([C, GRAVITY[:d, None]]).ravel()
    v = map.velocity(X, map.rest, rate)
    body = with_affine(full(X, X, v, law=soft), C, transfer)
    particles = full_steps(body, None, GRAVITY[:d], degree, transfer=transfer)
    model = ldm_stepper(map, quadrature(name, X, degree), soft, GRAVITY[:d], transfer=transfer)
    latent = reduced_steps(model, moving(map.rest, rate), 12)
    assert largest_difference(map, latent, X, particles) < 1e-11
    averaged = full_steps(full(X, X, v, law=soft), None, GRAVITY[:d], degree)
    assert abs(averaged.v - particles.v).max() > 1e-2


@pytest.mark.parametrize("transfer", ["apic", "mls"])
def test_a_start_has_no_affine_velocity_as_in_the_full_model(d, transfer):
    map, latent = anything(d)
    X, every = map.X, np.arange(len(map.X))
    x, F, G = map.derivatives(X, latent.xhat)
    v = G @ latent.vhat
    body = with_affine(full(X, x, v, F), 0.0, transfer)
    particles = full_steps(body, None, GRAVITY[:d], 2, 1, transfer)
    model = ldm_stepper(map, quadrature("lagrangian", X, 2), LAW, GRAVITY[:d], transfer=transfer)
    after, _ = model.step(latent, every, 0.0, DT)
    assert abs(G @ after.vhat - particles.v).max() < 1e-13 * abs(particles.v).max()


def test_gradient_of_the_velocity_is_the_rate_of_f(d):
    """Of a learned map, against differences in space."""
    (map, latent), X, h = swinging(d), cloud(d, 20), 1e-6
    field = ElasticMap(map, LAW)
    _, F, _ = map.derivatives(X, latent.xhat)
    slopes = [(map.velocity(X + step, latent.xhat, latent.vhat)
               - map.velocity(X - step, latent.xhat, latent.vhat)) / (2.0 * h)
              for step in h * np.eye(d)]
    expected = np.stack(slopes, axis=2) @ np.linalg.inv(F)
    found = field.velocity_gradient(X, latent.xhat, latent.vhat)
    np.testing.assert_allclose(found, expected, atol=1e-6 * abs(expected).max())
    assert not field.velocity_gradient(X, latent.xhat, 0.0 * latent.vhat).any()


# single steps from a stressed state

def anything(d, n=18):
    """A linear map on n points that reaches every position and velocity, and a stressed state."""
    X, rng = cloud(d, n), np.random.default_rng(1)
    x = X + 0.1 * rng.uniform(-1.0, 1.0, (n * d, n, d))
    F = np.eye(d) + 0.2 * rng.uniform(-1.0, 1.0, (n * d, n, d, d))
    map = modes(X, x, F, n * d)
    U = map.derivatives(X, np.zeros(n * d))[2].reshape(n * d, n * d)
    xhat = np.linalg.solve(U, (x[0] - X).ravel())
    return map, start_state(xhat, rng.normal(size=n * d))


@pytest.mark.parametrize("transfer", ["pic", "apic", "mls"])
@pytest.mark.parametrize("projection", ["linear", "nonlinear"])
def test_a_step_that_nothing_restrains_is_one_of_the_full_model(d, degree, projection, transfer):
    map, (xhat, vhat, *_) = anything(d)
    latent = moving(xhat, vhat)
    X, gravity, every = map.X, GRAVITY[:d], np.arange(len(map.X))
    x, F, G = map.derivatives(X, latent.xhat)
    v = G @ latent.vhat
    model = ldm_stepper(map, quadrature("lagrangian", X, degree), LAW, gravity,
                        projection=projection, transfer=transfer)
    bodies = [full(X, x, v, F), full(X, x, v)]
    if transfer != "pic":
        C = model.field.velocity_gradient(X, latent.before, latent.vhat)
        assert abs(C - model.field.velocity_gradient(X, xhat, vhat)).max() > 1e-3 * abs(C).max()
        bodies = [with_affine(body, C, transfer) for body in bodies]
    particles, relaxed = (full_steps(body, None, gravity, degree, 1, transfer) for body in bodies)
    after, report = model.step(latent, every, 0.0, DT)
    size = abs(particles.v).max()
    assert report.rank == map.r
    assert report.residual < 1e-13 * size
    assert abs(particles.v - relaxed.v).max() > 0.01 * size          # the stress acts
    assert abs(G @ after.vhat - particles.v).max() < 1e-13 * size
    assert abs(map.place(X, after.xhat) - particles.x).max() < 1e-14


class Watched(ReducedStepper):
    """Keeps the trial velocities of the samples."""

    def project(self, latent, at, trial, dt, weights=None):
        """Of `ReducedStepper`."""
        self.trial = trial.v.copy()
        return super().project(latent, at, trial, dt, weights)


class Recorded:
    """Keeps the nodes' masses and velocities."""

    def apply(self, grid, t, dt):
        """Nothing is changed."""
        self.m, self.v = grid.m.copy(), grid.v.copy()


def watched(stepper):
    """A `Watched` one with the options of a stepper."""
    return Watched(*(getattr(stepper, option.name) for option in dataclasses.fields(stepper)))


def swinging(d):
    """A learned map, and a stressed state with velocities."""
    rng = np.random.default_rng(3)
    return decoder(d, 4), start_state(rng.uniform(-1.0, 1.0, 4), rng.normal(size=4))


def learned(d, degree, n=400, **options):
    """A model of a body with a learned map."""
    body = quadrature(options.pop("name", "lagrangian"), cloud(d, n), degree)
    return watched(ldm_stepper(swinging(d)[0], body, LAW, GRAVITY[:d], **options))


def test_neighbours_are_enough_for_the_samples(d, degree):
    """The same velocities as with all points, from a share of them."""
    model, (_, latent) = learned(d, degree), swinging(d)
    model.step(latent, np.arange(400), 0.0, DT)
    everywhere = model.trial
    samples = np.sort(np.argsort(np.linalg.norm(cloud(d, 400) - 0.1, axis=1))[:4])
    _, report = model.step(latent, samples, 0.0, DT)
    assert report.points < 400
    np.testing.assert_allclose(model.trial, everywhere[samples], rtol=0.0, atol=ROUNDING)


def test_gravity_gives_the_grid_its_momentum(d, degree):
    """Mass is that of the points, momentum grows by m g dt in the second step, whatever the stress;
    the points' velocities are those that were fitted at the start of the first.
    """
    grid = Recorded()
    model, (map, latent) = learned(d, degree, conditions=grid), swinging(d)
    X, m, every = model.quadrature.X, model.quadrature.m, np.arange(400)
    later, _ = model.step(latent, every, 0.0, DT)
    model.step(later, every, DT, DT)
    before = m[:, None] * map.velocity(X, latent.xhat, later.vhat)
    after = grid.m[..., None] * grid.v
    gained = after.sum(axis=tuple(range(d))) - before.sum(axis=0)
    assert grid.m.sum() == pytest.approx(m.sum(), rel=1e-13)
    assert abs(gained - m.sum() * GRAVITY[:d] * DT).max() < 1e-13 * abs(after).sum()


def test_on_a_linear_manifold_all_velocities_are_one(d):
    """Under stress and with rotation, over several steps."""
    X, map = cloud(d, 150), Affine(d)
    rate = np.random.default_rng(4).normal(size=map.r)
    found = []
    for velocity in ("previous", "latest", "difference", "transported"):
        model = ldm_stepper(map, quadrature("lagrangian", X, 2), LAW, GRAVITY[:d],
                        velocity=velocity)
        found.append(reduced_steps(model, start_state(map.rest, rate), 40).xhat)
    assert abs(found[0] - map.rest).max() > 0.05
    assert abs(np.array(found) - found[0]).max() < 1e-13


# what is said

def test_a_report_tells_samples_points_and_rank(d):
    (map, latent), samples = swinging(d), np.array([3, 80, 200, 390])
    model = learned(d, 2)
    _, report = model.step(latent, samples, 0.0, DT)
    assert (report.samples, report.rank, report.iterations) == (4, 4, 0)
    assert report.points == len(model.quadrature.support(map, latent.xhat, samples))
    model = learned(d, 2, name="eulerian", projection="nonlinear")
    _, report = model.step(latent, samples, 0.0, DT)
    cloud = model.quadrature.cloud(map, latent.xhat, samples)
    assert report.points == len(cloud.points.x) > 0
    assert report.quadrature == cloud.report
    assert report.iterations >= 1


def test_samples_that_do_not_tell_all_coordinates_show_in_the_rank(d):
    """Points in a plane determine d of the d + 1 entries of every row."""
    X, map = cloud(d, 150), Affine(d)
    X[:6, -1] = 0.5
    model = ldm_stepper(map, quadrature("lagrangian", X, 2), LAW, GRAVITY[:d])
    _, report = model.step(start_state(map.rest), np.arange(6), 0.0, DT)
    assert report.rank == d * d < map.r


# threads

def digests():
    """sha256 of the latent state after steps of both quadratures."""
    sha = hashlib.sha256()
    for name in ("lagrangian", "eulerian"):
        model = learned(3, 2, name=name, projection="nonlinear")
        latent = reduced_steps(model, swinging(3)[1], 40, steps=3)
        for a in (latent.xhat, latent.vhat, latent.before):
            sha.update(a.tobytes())
    return sha.hexdigest()


THREADS = """
import json
from mpm_ref.core.jit import set_threads
from tests.rom.test_step import digests
found = []
for n in (1, 2):
    set_threads(n)
    found.append(digests())
print(json.dumps(found))
"""


def test_the_bits_do_not_depend_on_the_number_of_threads():
    assert run_python(THREADS, NUMBA_NUM_THREADS="2") == 2 * [digests()]
