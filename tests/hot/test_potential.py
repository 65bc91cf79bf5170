"""The incremental potential and its gradient (HOT-eq1, HOT-eq2)."""

import numpy as np
import pytest
from constitutive import rate
from hot_cases import CASES, DEGREES, DT, MLS, over, plain_bodies, problem_of
from threads import by_threads

from mpm_ref.hot import transfer
from mpm_ref.hot.potential import Potential
from mpm_ref.materials import Softening
from mpm_ref.plain import potential

H = np.geomspace(1e-1, 1e-3, 5)
LONG = 200.0        # cells: many slabs, for threads to meet in
ALL = CASES + DEGREES + MLS


@pytest.fixture(params=ALL, ids=lambda case: case.name, scope="module")
def at(request):
    return request.param, problem_of(request.param)


def potential_like(problem, bodies=None, gravity=None):
    q = problem.potential
    return Potential(q.bodies if bodies is None else bodies, problem.unknowns, q.stencil, q.dt,
                     problem.gravity if gravity is None else gravity)


def test_equals_the_plain_twin(at):
    case, q = at
    v = over(q, q.unknowns.v)
    expected = potential.evaluate(plain_bodies(q, case), q.grid.m, v, over(q, q.dv), DT,
                                  q.gravity)
    E, g = q.potential.evaluate(q.dv)
    assert E == pytest.approx(expected[0], rel=1e-13)
    assert np.abs(over(q, g) - expected[1]).max() <= 1e-13 * np.abs(g).max()


def test_energy_is_the_one_that_evaluate_returns(at):
    _, q = at
    assert q.potential.energy(q.dv) == q.potential.evaluate(q.dv)[0]


def test_gradient_is_the_slope_of_the_energy(at):
    """Remainder of first order, as h^2."""
    _, q = at
    E, g = q.potential.evaluate(q.dv)
    remainder = [q.potential.energy(q.dv + h * q.w) - E - h * (g * q.w).sum() for h in H]
    assert rate(H, np.abs(remainder)) == pytest.approx(2.0, abs=0.05)


def test_a_translation_changes_only_the_inertia_and_the_height(at):
    """No body feels it, however strained: E(dv + t) - E(dv) is that of the masses (HOT-eq1)."""
    _, q = at
    t, m = np.arange(1.0, 1.0 + q.dv.shape[1]), q.unknowns.m[:, None]
    E, g = q.potential.evaluate(q.dv)
    E_t, g_t = q.potential.evaluate(q.dv + t)
    assert E_t - E == pytest.approx((m * t * (q.dv + t / 2 - DT * q.gravity)).sum(), rel=1e-12)
    assert np.abs(g_t - g - m * t).max() <= 1e-12 * m.max()


def test_gravity_is_the_force_of_the_masses(at):
    _, q = at
    E, g = q.potential.evaluate(q.dv)
    E_0, g_0 = potential_like(q, gravity=0 * q.gravity).evaluate(q.dv)
    impulse = DT * q.unknowns.m[:, None] * q.gravity
    assert E - E_0 == pytest.approx(-(impulse * (q.unknowns.v + q.dv)).sum(), rel=1e-12)
    assert np.abs(g - g_0 + impulse).max() <= 1e-14 * np.abs(g).max()


def test_bodies_add_up():
    q = problem_of(CASES[0])
    inertia = (q.unknowns.m[:, None] * q.dv * q.dv).sum() / 2
    parts = [potential_like(q, bodies=(body,), gravity=0 * q.gravity).evaluate(q.dv)
             for body in q.bodies]
    E, g = potential_like(q, gravity=0 * q.gravity).evaluate(q.dv)
    assert E == pytest.approx(sum(E_b for E_b, _ in parts) - inertia, rel=1e-13)
    apart = sum(g_b for _, g_b in parts) - q.unknowns.m[:, None] * q.dv
    assert np.abs(g - apart).max() <= 1e-14 * np.abs(g).max()


@pytest.mark.parametrize("case", [CASES[2], MLS[2]], ids=lambda case: case.name)
def test_the_fast_exchange_equals_the_plain_one(case, rng):
    """Lines of nodes instead of nodes: the same sums in another order."""
    q = problem_of(case)
    points, box, stencil = q.potential.points[0], q.potential.box, q.potential.stencil
    box.v[:] = rng.normal(size=box.v.shape)
    transfer.gradients(points, box, stencil)
    T = points.T.copy()
    transfer.gather(points, box, stencil, (0, len(T)))
    assert np.abs(points.T - T).max() <= 1e-14 * np.abs(T).max()
    box.f[:] = 0.0
    transfer.add_forces(points, box, stencil)
    f = box.f.copy()
    box.f[:] = 0.0
    transfer.scatter(points, box, stencil, (0, len(T)))
    assert np.abs(box.f - f).max() <= 1e-14 * np.abs(f).max()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_bits_do_not_depend_on_the_number_of_threads(case):
    def evaluate():
        q = problem_of(case, length=LONG)
        E, g = q.potential.evaluate(q.dv)
        return E, g.tobytes()

    one, two = by_threads(evaluate)
    assert one == two


def test_energy_is_infinite_where_a_law_refuses():
    """An increment that turns a particle inside out: Hencky has no energy there."""
    q = problem_of(CASES[1])
    x = q.unknowns.index * q.unknowns.dx
    inverting = -2.0 / DT * (x - x.mean(axis=0)) * (1.0, 0.0, 0.0)
    assert q.potential.energy(inverting) == np.inf


def test_the_particles_are_not_changed_and_their_order_does_not_matter():
    q = problem_of(CASES[0])
    before = [b.particles.F.copy() for b in q.bodies]
    E, g = q.potential.evaluate(q.dv)
    assert all(np.array_equal(F, b.particles.F) for F, b in zip(before, q.bodies))
    shuffled = tuple(b._replace(particles=b.particles._replace(
        **{k: getattr(b.particles, k)[::-1].copy() for k in ("x", "F", "V0")})) for b in q.bodies)
    E_2, g_2 = potential_like(q, bodies=shuffled).evaluate(q.dv)
    assert pytest.approx(E, rel=1e-13) == E_2
    assert np.abs(g - g_2).max() <= 1e-13 * np.abs(g).max()


def test_failed_particles_carry_nothing():
    """Yield stress 0 of a softening material: mass without stress, whatever its F."""
    q = problem_of(CASES[2])
    body = q.bodies[0]
    y = np.ones(len(body.id))
    y[::3] = 0.0
    body.particles.F[::3] = np.nan
    worn = body._replace(flow=Softening(1.0, 0.1, 0.0), particles=body.particles._replace(y=y))
    kept = body.particles._replace(**{k: getattr(body.particles, k)[y > 0.0]
                                      for k in ("x", "F", "V0")})
    E, g = potential_like(q, bodies=(worn,)).evaluate(q.dv)
    E_kept, g_kept = potential_like(q, bodies=(body._replace(particles=kept),)).evaluate(q.dv)
    assert np.isfinite(E)
    assert (E, g.tobytes()) == (E_kept, g_kept.tobytes())
