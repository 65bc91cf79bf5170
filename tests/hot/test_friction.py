"""Friction of an implicit step: its potential, its place in the step, Coulomb's law at the end."""

import numpy as np
import pytest
from constitutive import rate
from hot_cases import CASES, DT, SPEED, problem_of
from threads import MOST, by_threads

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.explicit import Scheme
from mpm_ref.hot import friction
from mpm_ref.hot.friction import Friction, dissipation
from mpm_ref.hot.methods import SolverOptions, options_of
from mpm_ref.hot.rigid import RigidMotions
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import NoFlow, make_law

H = np.geomspace(1e-1, 1e-3, 5)
EPS = 0.5           # [m/s] speed of creep in units of SPEED: half of the nodes creep, about
DX, DOWN, MU, HEIGHT = 0.1, 9.8, 0.5, 0.2
CREEP = SolverOptions().creep


def rubbing(case):
    """A problem with friction at every third node, on planes or along lines."""
    q, rng = problem_of(case), np.random.default_rng(5)
    node = np.arange(0, len(q.unknowns.m), 3)
    n = rng.normal(size=(len(node), case.d))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    B = np.eye(case.d) - n[:, :, None] * n[:, None, :]
    w, c = rng.uniform(0.5, 1.5, len(node)), SPEED * rng.normal(size=n.shape)
    rub = Friction(node, w * np.abs(q.potential.evaluate(q.dv)[1]).max(), c, B, EPS * SPEED)
    return q._replace(potential=q.potential.with_friction(rub)), rub


@pytest.fixture(params=[CASES[0], CASES[2]], ids=lambda case: case.name, scope="module")
def at(request):
    return rubbing(request.param)


def largest(a):
    return np.abs(a).max()


def test_dissipation_is_coulombs_beyond_creep_and_smooth():
    for y in (EPS, 1.1 * EPS, 7.0):
        assert dissipation(y, EPS) == (pytest.approx(y, rel=1e-15), pytest.approx(1.0 / y), 0.0)
    y, h = np.linspace(0.01, 0.99, 20) * EPS, 1e-6 * EPS
    f = np.array([[dissipation(a + s, EPS)[0] for a in y] for s in (-h, h)])
    slopes = np.array([[a * dissipation(a, EPS)[1] for a in y + s] for s in (-h, h)])
    assert np.allclose((f[1] - f[0]) / (2 * h), slopes.mean(axis=0), rtol=1e-6)
    assert np.allclose((slopes[1] - slopes[0]) / (2 * h), [dissipation(a, EPS)[2] for a in y],
                       rtol=1e-6)
    assert dissipation(0.0, EPS) == (EPS / 3.0, 2.0 / EPS, 2.0 / EPS)


def test_gradient_is_the_slope_of_the_energy(at):
    q, _ = at
    E, g = q.potential.evaluate(q.dv)
    remainder = [q.potential.energy(q.dv + h * q.w) - E - h * (g * q.w).sum() for h in H]
    assert rate(H, np.abs(remainder)) == pytest.approx(2.0, abs=0.05)


def test_hessian_is_the_slope_of_the_gradient(at):
    """Where no node passes from creep to sliding, at which the slope has a kink."""
    q, rub = at
    far = q.potential.with_friction(rub._replace(eps=9.0 * SPEED))
    for potential in (far, q.potential.with_friction(rub._replace(eps=1e-3 * SPEED))):
        g = potential.evaluate(q.dv)[1]
        slope = potential.tangent(q.dv, projected=False).product(q.w)
        steps = 1e-2 * H
        remainder = [largest(potential.evaluate(q.dv + h * q.w)[1] - g - h * slope)
                     for h in steps]
        assert rate(steps, remainder) == pytest.approx(2.0, abs=0.05)


def test_matrix_and_diagonal_are_those_of_the_product(at):
    q, _ = at
    tangent = q.potential.tangent(q.dv)
    H = tangent.matrix()
    Hw = tangent.product(q.w)
    assert largest((H @ q.w.reshape(-1)).reshape(q.w.shape) - Hw) <= 1e-13 * largest(Hw)
    dense = H.toarray()
    d = q.dv.shape[1]
    for i, block in enumerate(tangent.diagonal()):
        part = slice(i * d, (i + 1) * d)
        assert largest(dense[part, part] - block) <= 1e-12 * largest(dense)
    assert np.linalg.eigvalsh(dense)[0] > 0.0


def test_friction_pulls_against_the_slip_and_not_along_the_normal(at):
    q, rub = at
    u, g = q.unknowns.v + q.dv, np.zeros_like(q.dv)
    friction.add_gradient(rub, u, g)
    t = np.einsum("kab,kb->ka", rub.B, u[rub.node] - rub.c)
    assert np.allclose(np.linalg.norm(g[rub.node], axis=1)
                       / np.minimum(np.linalg.norm(t, axis=1) / rub.eps, 1.0) >= rub.w * 0.99, True)
    assert ((g[rub.node] * t).sum(axis=1) > 0.0).all()
    assert np.allclose(np.einsum("kab,kb->ka", rub.B, g[rub.node]), g[rub.node], atol=1e-15)
    free = np.setdiff1d(np.arange(len(g)), rub.node)
    assert not g[free].any()


@pytest.mark.parametrize("strength", [1e-3, 1.0, 1e3])
def test_rigid_motions_balance_with_friction(strength):
    """Also where friction is so strong that a whole step of Newton's method passes its kink."""
    q, rub = rubbing(CASES[2])
    assert rub.eps > 0.0
    potential = q.potential.with_friction(rub._replace(w=strength * rub.w))
    rigid = RigidMotions(potential, q.unknowns)
    dv = rigid.balanced(q.dv)
    impulse = q.unknowns.m[:, None] * dv - DT * potential.weight
    potential.add_friction(dv, impulse)
    sums = rigid.sums(np.einsum("naq,na->nq", rigid.motions(dv), impulse))
    size = max(largest(q.unknowns.m[:, None] * q.dv), largest(potential.friction.w))
    assert largest(sums) <= 1e-9 * size


def block(v, d=2, E=1e7):
    """A stiff block on the floor z = 0, 4 cells wide and 2 high, that slides with v."""
    axes = [np.arange(0.5, n) * DX / 2 for n in (*(8,) * (d - 1), 4)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, d)
    V0 = np.full(len(x), (DX / 2) ** d)
    velocity = np.zeros_like(x)
    velocity[:, 0] = v
    q = particles_at(x, velocity, 1000.0 * V0, V0, "apic")
    return Body("block", q, make_law("fixed_corotated", E=E, nu=0.3), NoFlow(),
                np.arange(len(x)))


def stepped(v, pull, method="hot-plus", steps=5, dt=0.01, speed=0.0):
    """Mean velocities after each step of a block under gravity and a pull along the floor, which
    moves with a speed.
    """
    body = block(v)
    motion = Motion(Steady((speed, 0.0)))
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate", MU, motion)
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, 2, (pull, -DOWN),
                              Conditions((floor,)), options_of(method, eps=1e-9))
    stepper.start([body])
    means = []
    for k in range(steps):
        stepper.step([body], k * dt, dt)
        assert stepper.report.converged, stepper.report.message
        means.append(body.particles.v.mean(axis=0))
    return np.array(means)


@pytest.mark.parametrize("method", ["hot", "hot-plus", "pn-pcg", "pn-mgpcg"])
def test_a_sliding_block_obeys_coulomb(method):
    """The momentum along the floor and mu times that away from it: exact in every step."""
    v = stepped(1.0, 2.0, method)
    t = 0.01 * np.arange(1, 6)
    assert np.allclose(v[:, 0] + MU * v[:, 1], 1.0 + (2.0 - MU * DOWN) * t, rtol=1e-4)


def test_friction_is_relative_to_what_moves():
    """A block at rest on a floor that moves is dragged along, as one that slides is stopped."""
    dragged, braked = stepped(0.0, 0.0, speed=1.0), stepped(-1.0, 0.0)
    assert np.allclose(dragged[:, 0] - 1.0, braked[:, 0], atol=1e-6)
    assert dragged[-1, 0] > 0.1


def test_a_block_sticks_below_coulombs_limit():
    """It creeps at most by `creep` dx in a step, however long the pull lasts."""
    v = stepped(0.0, 0.6 * MU * DOWN, steps=20)
    assert np.abs(v[5:, 0]).max() < CREEP * DX / 0.01


def sticking(d, E, corner=False):
    """Velocities (N, d) of a block that sticks on a floor, or in a corner, with default options."""
    body = block(0.0, d, E)
    up, pull = np.eye(d)[-1], 0.6 * MU * DOWN * np.eye(d)[0]
    parts = [Collider(half_space((0.0,) * d, tuple(up)), "separate", MU)]
    if corner:
        parts.append(Collider(half_space((0.0,) * d, tuple(np.eye(d)[1])), "separate", MU))
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, d, tuple(pull - DOWN * up),
                              Conditions(tuple(parts)), options_of("hot-plus"))
    stepper.start([body])
    for k in range(3):
        stepper.step([body], 0.01 * k, 0.01)
        assert stepper.report.converged, stepper.report.message
    return body.particles.v


@pytest.mark.parametrize("E", [1e6, 1e8, 1e10])
def test_stiff_blocks_stick_with_default_options(E):
    """Their weight is far below the tolerance of the gradient (HOT-eq9)."""
    shaken = 2.0 * DOWN * HEIGHT / np.sqrt(E / 1000.0)      # speed of the elastic settling, about
    assert np.abs(sticking(2, E).mean(axis=0)).max() < CREEP * DX / 0.01 + shaken


def test_blocks_stick_in_3d_and_in_corners():
    for corner in (False, True):
        assert np.abs(sticking(3, 1e8, corner).mean(axis=0)).max() < 0.02


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_threads_do_not_change_a_bit():
    one, two = by_threads(lambda: sticking(3, 1e8, corner=True).tobytes())
    assert one == two
