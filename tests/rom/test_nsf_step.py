"""Reduced steps with inferred stress against steps of the full model (NSF-sec5.2)."""

from itertools import pairwise

import numpy as np
import pytest

from mpm_ref.body import Body, particles_at
from mpm_ref.core.grid import OutOfRange
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.blocks import blocks
from mpm_ref.rom.kinematics import Kinematics, NoBody
from mpm_ref.rom.latent import Latent, nearest
from mpm_ref.rom.projection import PositionInversion
from mpm_ref.rom.quadrature import Cloud
from mpm_ref.rom.step import MaterialPoints, nsf_stepper

DX, DT, STEPS = 0.17, 0.004, 5
LAW = FixedCorotated(3e3, 4e3)
GRAVITY = np.array([1.0, -9.8, 3.0])


@pytest.fixture(params=(2, 3), ids=("quadratic", "cubic"))
def degree(request):
    """Of the splines."""
    return request.param


def body(n, d, seed=0, length=1.0):
    """Positions and `MaterialPoints` of n points in a box of unit sides but for its length."""
    rng = np.random.default_rng(seed)
    X, v = rng.uniform(size=(n, d)), rng.normal(size=(n, d))
    X[:, 0] *= length
    V0 = rng.uniform(0.5, 1.5, n) / n
    return X, MaterialPoints(800.0 * V0, V0, v)


class Wind:
    """Nodes that are blown more strongly as time goes on."""

    def apply(self, grid, t, dt):
        """At the end t [s] of a step of length dt [s]."""
        grid.v[..., 0] += 1e3 * t * dt


def full_run(X, matter, degree, steps=STEPS, conditions=None):
    """States x, v, tau, C of the full model with APIC, the start first."""
    q = particles_at(X, matter.v, matter.m, matter.V0, transfer="apic")
    whole = Body("full", q, LAW, NoFlow(), np.arange(len(X)))
    stepper = Stepper(Scheme(degree, "apic"), DX, X.shape[1], GRAVITY[:X.shape[1]], conditions)
    stepper.start((whole,))
    states = [tuple(a.copy() for a in (q.x, q.v, q.tau, q.C))]
    for k in range(steps):
        stepper.step((whole,), k * DT, DT)
        states.append(tuple(a.copy() for a in (q.x, q.v, q.tau, q.C)))
    return states


class Remembered:
    """Every position is a latent coordinate; stress and affine field are those of a full run."""

    def __init__(self, states):
        self.states = states
        self.n, self.dim = states[0][0].shape
        self.r = self.n * self.dim

    def of(self, xhat):
        """The state that the latent coordinates are nearest to."""
        return min(self.states, key=lambda s: np.abs(s[0].ravel() - xhat).max())

    def place(self, points, xhat):
        return xhat.reshape(self.n, self.dim)[points]

    def derivatives(self, points, xhat):
        G = np.eye(self.r).reshape(self.n, self.dim, self.r)
        return self.place(points, xhat), None, G[points]

    def stress(self, points, xhat, F=None):
        return self.of(xhat)[2][points]

    def affine(self, points, xhat):
        return self.of(xhat)[3][points]

    def near(self, xhat, x, distance):
        gap = np.abs(xhat.reshape(self.n, self.dim)[:, None] - x).max(axis=2).min(axis=1)
        return np.flatnonzero(gap <= distance)


class Free:
    """Affine motion without stress, whose velocities at rest's points never change."""

    def __init__(self, X, L):
        self.X, self.L, self.map = X, L, Affine(X.shape[1])
        self.dim, self.r = self.map.dim, self.map.r
        self.blocks = blocks(X, 2.0 * DX)

    def place(self, points, xhat):
        return self.map.place(self.X[points], xhat)

    def derivatives(self, points, xhat):
        return self.map.derivatives(self.X[points], xhat)

    def stress(self, points, xhat, F=None):
        return np.zeros((len(points), self.dim, self.dim))

    def affine(self, points, xhat):
        A = xhat.reshape(self.dim, self.dim + 1)[:, :self.dim]
        return np.tile(self.L @ np.linalg.inv(A), (len(points), 1, 1))

    def near(self, xhat, x, distance):
        return self.blocks.near(self.map, xhat, x, distance)


def model(fields, matter, degree=2, gravity=GRAVITY, **options):
    return nsf_stepper(fields, matter, DX, degree, np.asarray(gravity)[:fields.dim], **options)


def cloud_of(stepper, points, x, count):
    """A `Cloud` of points of these numbers at x (n, d), of which the first are samples."""
    body = stepper.quadrature
    return Cloud(Kinematics(points, x), body.m[points], body.V0[points],
                 Kinematics(points[:count], x[:count]), {"points": len(points)})


def after_grid(stepper, latent, points, x, count, dt=DT):
    """Positions of the first points after a step of all on the grid."""
    body, samples = stepper.bodies(cloud_of(stepper, points, x, count), latent, dt)
    return stepper.on_grid(body, samples, 0.0, dt).x


def test_is_the_full_step_where_every_position_is_a_coordinate(d, degree):
    X, matter = body(30, d)
    states = full_run(X, matter, degree)
    stepper, at = model(Remembered(states), matter, degree), Latent(X.ravel())
    for k, (x, *_) in enumerate(states[1:]):
        at, report = stepper.step(at, np.arange(30), k * DT, DT)
        assert np.abs(at.xhat.reshape(30, d) - x).max() < 1e-12
        assert (report.samples, report.points, report.rank) == (30, 30, 30 * d)
        assert report.residual < 1e-12
        assert report.converged


def test_boundaries_are_those_of_the_full_step_in_time(d):
    X, matter = body(30, d)
    still, blown = (full_run(X, matter, 2, conditions=wind)[-1][0] for wind in (None, Wind()))
    assert np.abs(blown - still).max() > 1e-4
    stepper = model(Remembered(full_run(X, matter, 2, conditions=Wind())), matter,
                    conditions=Wind())
    at = Latent(X.ravel())
    for k in range(STEPS):
        at, _ = stepper.step(at, np.arange(30), k * DT, DT)
    assert np.abs(at.xhat.reshape(30, d) - blown).max() < 1e-12


def test_samples_move_as_when_all_points_are_stepped(d, degree, rng):
    X, matter = body(400, d, length=8.0)
    fields = Remembered(full_run(X, matter, degree, steps=1))
    stepper, at = model(fields, matter, degree), Latent(X.ravel())
    samples = np.sort(rng.choice(400, 3, replace=False))
    points, x = stepper.quadrature.integration_points(fields, X.ravel(), samples)
    assert np.array_equal(x, X[points])
    assert np.array_equal(points[:3], samples)
    assert len(points) < 400

    def moved(some):
        """Samples after a step of some points, the samples first."""
        return after_grid(stepper, at, some, X[some], 3)

    everything = moved(np.concatenate([samples, np.setdiff1d(np.arange(400), samples)]))
    assert np.abs(moved(points) - everything).max() < 1e-14
    others = points[3:]
    next_to_it = others[np.argmin(np.linalg.norm(X[others] - X[samples[0]], axis=1))]
    assert np.abs(moved(points[points != next_to_it]) - everything).max() > 1e-9


def test_integration_points_are_those_that_share_a_node(d, degree, rng):
    X, matter = body(300, d, length=8.0)
    stepper = model(Remembered(full_run(X, matter, degree, steps=0)), matter, degree)
    samples = np.sort(rng.choice(300, 4, replace=False))
    first = np.floor(X / DX - 0.5 * (degree - 1)).astype(int)
    nodes = [{tuple(b + o) for o in np.ndindex(*(degree + 1,) * d)} for b in first]
    wanted = set.union(*(nodes[p] for p in samples))
    expected = [p for p in range(300) if nodes[p] & wanted]
    points, _ = stepper.quadrature.integration_points(stepper.field, X.ravel(), samples)
    assert np.sort(points).tolist() == expected


@pytest.mark.parametrize("faster", [1.0, 2.5])
@pytest.mark.parametrize("inversion", ["nonlinear", "linear"])
def test_free_affine_motion_is_exact_with_steps_of_any_length(d, faster, inversion, rng):
    X, matter = body(500, d)
    L, c = rng.normal(size=(d, d)), rng.normal(size=d)
    matter = matter._replace(v=X @ L.T + c)
    stepper = model(Free(X, L), matter, gravity=np.zeros(3), inversion=PositionInversion(inversion))
    at, samples = Latent(Affine(d).rest), np.arange(0, 500, 60)
    for k in range(4):
        at, report = stepper.step(at, samples, k * faster * DT, faster * DT)
    x = X + 4 * faster * DT * matter.v
    assert np.abs(Affine(d).place(X, at.xhat) - x).max() < 1e-12
    assert report.points < 500
    assert report.rank == d * (d + 1)


def test_without_the_affine_field_that_motion_is_damped(d, rng):
    X, matter = body(500, d)
    L = rng.normal(size=(d, d))
    matter = matter._replace(v=X @ L.T)
    fields = Free(X, L)
    fields.affine = lambda points, xhat: np.zeros((len(points), d, d))
    at = Latent(Affine(d).rest)
    stepper = model(fields, matter, gravity=np.zeros(3))
    for k in range(2):
        at, _ = stepper.step(at, np.arange(500), k * DT, DT)
    x = X + 2 * DT * matter.v
    assert np.abs(Affine(d).place(X, at.xhat) - x).max() > 1e-4


def test_velocity_is_a_difference_over_the_step_and_prescribed_at_the_start(d):
    X, matter = body(40, d)
    fields = Free(X, np.eye(d))
    stepper = model(fields, matter)
    y = Affine(d).rest
    some = np.array([3, 7])
    first, _ = stepper.bodies(cloud_of(stepper, some, X[some], 2), Latent(y), 0.5)
    assert np.array_equal(first.particles.v, matter.v[some])
    later, _ = stepper.bodies(cloud_of(stepper, some, 1.5 * X[some], 2),
                              Latent(1.5 * y, before=y), 0.5)
    assert np.allclose(later.particles.v, X[[3, 7]], rtol=1e-14)


def test_start_is_searched(d):
    X, _ = body(40, d)
    fields = Free(X, np.eye(d))
    away = Affine(d).rest + 0.3
    assert np.abs(nearest(fields, np.arange(40), X, away) - Affine(d).rest).max() < 1e-12


def test_latent_coordinates_that_are_lost_end_a_run(d):
    X, matter = body(40, d)
    stepper = model(Free(X, np.eye(d)), matter)
    lost = np.full(d * (d + 1), np.nan)
    with pytest.raises(NoBody, match="not finite"):
        stepper.step(Latent(lost), np.arange(5), 0.0, DT)
    with pytest.raises(OutOfRange):
        stepper.step(Latent(1e12 * Affine(d).rest), np.arange(5), 0.0, DT)


def test_unknown_inversion_is_refused():
    X, matter = body(40, 2)
    with pytest.raises(ValueError, match="inversion = 'quick': expected nonlinear or linear"):
        model(Free(X, np.eye(2)), matter, inversion=PositionInversion("quick"))


def test_states_of_a_full_run_differ():
    X, matter = body(30, 2)
    states = full_run(X, matter, 2)
    assert all(np.abs(a[0] - b[0]).max() > 1e-4 for a, b in pairwise(states))


@pytest.mark.parametrize("inversion", ["nonlinear", "linear"])
def test_a_sample_of_weight_two_counts_as_two(d, inversion, rng):
    X, matter = body(40, d)
    stepper = model(Free(X, np.eye(d)), matter, inversion=PositionInversion(inversion))
    some = np.arange(0, 40, 5)
    x = X[some] + 0.1 * rng.normal(size=(8, d))
    twice = np.concatenate([some[:1], some])
    weight = np.array([2.0, *np.ones(7)])
    rest = Affine(d).rest

    def inverted(points, x, weights=None):
        """Latent coordinates of samples that the grid has taken to x."""
        trial = particles_at(x, 0.0 * x, np.ones(len(x)), np.ones(len(x)), "pic")
        return stepper.project(Latent(rest), Kinematics(points, x), trial, DT, weights).xhat

    weighed, repeated = inverted(some, x, weight), inverted(twice, np.concatenate([x[:1], x]))
    plain = inverted(some, x)
    assert np.abs(weighed - repeated).max() < 1e-9
    assert np.abs(weighed - plain).max() > 1e-4


def test_samples_without_a_place_after_the_step_are_told(d):
    X, matter = body(40, d)
    fields = Free(X, np.eye(d))
    fields.stress = lambda points, xhat, F=None: np.full((len(points), d, d), np.nan)
    stepper = model(fields, matter)
    with pytest.raises(NoBody, match="t = 0 s: 8 of 8 samples have no finite place after the step, "
                                     "the first is point 0"):
        stepper.step(Latent(Affine(d).rest), np.arange(0, 40, 5), 0.0, DT)
