"""Von Mises flow inside the potential of an implicit step."""

import numpy as np
import pytest
from constitutive import LAW, evaluate, rate
from hot_cases import DT, Case, problem_of

from mpm_ref.body import Body, particles_at
from mpm_ref.core.law import kirchhoff_hat, project
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import SolverOptions, options_of
from mpm_ref.hot.potential import Potential
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import (
    DruckerPrager,
    FixedCorotated,
    FixedCorotatedVonMises,
    Hardening,
    Hencky,
    NoFlow,
    VonMises,
    YieldingHencky,
    lame,
    yielding_hencky,
)
from mpm_ref.plain import transfer
from mpm_ref.plain.spline import pairs

H = np.geomspace(1e-2, 1e-4, 5)
STEEL = Hencky(300.0, 500.0)


def yielding(d):
    """A problem of Hencky matter whose particles have yield stresses between 0.2 and 1 times what
    they bear, and those that the trial increment makes yield.
    """
    q = problem_of(Case(d, 2, ("hencky",)))
    body, rng = q.bodies[0], np.random.default_rng(7)
    y = 2.0 * STEEL.mu * rng.uniform(0.05, 0.5, len(body.id))
    body = body._replace(law=STEEL, flow=Hardening(1.0, 0.1, 0.0),
                         particles=body.particles._replace(y=y))
    potential = Potential((body,), q.unknowns, q.potential.stencil, DT, q.gravity, "implicit")
    return q._replace(bodies=(body,), potential=potential)


@pytest.fixture(params=[2, 3])
def q(request):
    return yielding(request.param)


def test_gradient_is_the_slope_of_the_energy(q):
    E, g = q.potential.evaluate(q.dv)
    remainder = [q.potential.energy(q.dv + h * q.w) - E - h * (g * q.w).sum() for h in H]
    assert rate(H, np.abs(remainder)) == pytest.approx(2.0, abs=0.05)


def test_hessian_is_the_slope_of_the_gradient(q):
    g = q.potential.evaluate(q.dv)[1]
    slope = q.potential.tangent(q.dv, projected=False).product(q.w)
    steps = 1e-2 * H            # so small that no particle begins to yield
    remainder = [np.abs(q.potential.evaluate(q.dv + h * q.w)[1] - g - h * slope).max()
                 for h in steps]
    assert rate(steps, remainder) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("d", [2, 3])
def test_stress_is_that_after_the_return(d, rng):
    """And psi, P are those of Hencky's law where nothing yields."""
    s = np.exp(0.3 * rng.standard_normal((50, d)))
    both = set()
    for row in s:
        law = YieldingHencky(STEEL.mu, STEEL.lam, 0.6 * STEEL.mu)
        returned, _ = project(tuple(row), 0.0, DT, STEEL, VonMises(law.tau_y, 0.0))
        expected = np.array(kirchhoff_hat(returned, STEEL))
        found = np.array(yielding_hencky.kirchhoff_hat(tuple(row), law))
        assert np.allclose(found, expected, rtol=1e-12, atol=1e-12 * STEEL.mu)
        both.add(returned == tuple(row))
        _, P = yielding_hencky.psi_and_pk1(tuple(map(tuple, np.diag(row))), law)
        assert np.allclose(np.diag(P) * row, found, rtol=1e-11, atol=1e-11 * STEEL.mu)
    assert both == {True, False}


def test_strong_matter_is_elastic(rng):
    s = np.exp(0.3 * rng.standard_normal((1, 3)))
    F = np.diag(s[0])
    strong = YieldingHencky(LAW["hencky"].mu, LAW["hencky"].lam, 1e9)
    psi, P = yielding_hencky.psi_and_pk1(tuple(map(tuple, F)), strong)
    expected = evaluate(LAW["hencky"], F[None], np.eye(3)[None])
    assert psi == pytest.approx(expected.psi[0], rel=1e-12)
    assert np.allclose(P, expected.P[0], rtol=1e-11)


def pressed(return_map, dt):
    """Imbalance of momentum after a step of a square that is pressed together and yields, relative
    to the stress' largest impulse.
    """
    dx, n = 0.1, 12
    x = dx / 2 * np.stack(np.meshgrid(*(np.arange(n) + 0.5,) * 2, indexing="ij"), -1).reshape(-1, 2)
    V0 = np.full(len(x), dx * dx / 4)
    v = (x - x.mean(axis=0)) @ np.diag((-30.0, 10.0))
    body = Body("square", particles_at(x, v, 1000.0 * V0, V0, "apic"), Hencky(4e6, 4e6),
                VonMises(2e4, 0.0), np.arange(len(x)))
    stepper = ImplicitStepper(Scheme(transfer="apic"), dx, 2, (0.0, 0.0), None,
                              options_of("pn-pcg", eps=1e-10, return_map=return_map))
    stepper.start([body])
    ip = pairs(body.particles.x, dx, 2)
    problem = stepper.problem([body], 0.0, dt)
    grid = stepper.step([body], 0.0, dt)
    assert stepper.report.converged, stepper.report.message
    box = transfer.NodeBox(grid.origin, grid.m.shape)
    A = np.eye(2) + dt * body.particles.L
    T = np.linalg.solve(A, np.swapaxes(body.particles.tau, 1, 2))       # (P F_n^T)^T
    f = transfer.internal_force(V0, np.swapaxes(T, 1, 2), ip, box)
    number = problem.unknowns.number
    dv = grid.v[number >= 0] - problem.unknowns.v
    impulse = dt * f[number >= 0]
    return np.abs(problem.unknowns.m[:, None] * dv - impulse).max() / np.abs(impulse).max()


def test_nodes_are_in_balance_with_the_stress_after_the_return():
    assert pressed("implicit", 0.005) < 1e-6
    assert pressed("lagged", 0.005) > 0.1


def returned_tau(eps, law, flow):
    """Principal Kirchhoff stresses after the return, of principal trial strains."""
    s, _ = project(tuple(np.exp(eps)), 0.0, DT, law, flow)
    return np.array(kirchhoff_hat(s, law))


@pytest.mark.parametrize(("law", "flow", "least", "most"), [
    (FixedCorotated(*lame(6.9e10, 0.33)), FixedCorotatedVonMises(2.4e8), 1e-2, 5e-2),
    (FixedCorotated(*lame(2.07e5, 0.33)), FixedCorotatedVonMises(720.0), 1e-2, 5e-2),
    (Hencky(*lame(6.9e10, 0.33)), VonMises(2.4e8, 0.0), 0.0, 1e-7)])
def test_only_the_return_on_hencky_has_a_symmetric_slope(law, flow, least, most):
    """d tau/d eps is symmetric where tau is the slope of an energy."""
    direction = np.array([1.0, 0.2, -1.2]) / np.linalg.norm([1.0, 0.2, -1.2])
    eps, h = 2.0 * flow.tau_y / (2.0 * law.mu) * direction, 1e-7
    slope = np.array([(returned_tau(eps + h * e, law, flow) - returned_tau(eps - h * e, law, flow))
                      / (2.0 * h) for e in np.eye(3)])
    assert least <= np.linalg.norm(slope - slope.T) / np.linalg.norm(slope) <= most


def test_what_has_no_potential_is_refused():
    q = yielding(2)
    sand = q.bodies[0]._replace(flow=DruckerPrager(0.3, 0.0))
    soft = q.bodies[0]._replace(law=FixedCorotated(1.0, 1.0), flow=VonMises(1.0, 0.0))
    options = options_of("hot", return_map="implicit")
    for body, match in ((sand, "DruckerPrager on Hencky"), (soft, "VonMises on FixedCorotated")):
        stepper = ImplicitStepper(Scheme(transfer="pic"), 0.1, 2, (0.0, 0.0), None, options)
        with pytest.raises(ValueError, match=f"{match} with return_map = 'implicit'"):
            stepper.start([body])
    with pytest.raises(ValueError, match="'admm', which splits an elastic energy"):
        SolverOptions("admm", "admm", inverse="jacobi", return_map="implicit")
    lifted = q.bodies[0]._replace(flow=VonMises(1.0, 0.05))
    with pytest.raises(ValueError, match=r"s_min = 0.05 with return_map = 'implicit'"):
        stepper.start([lifted])
    stepper.start([q.bodies[0]._replace(flow=NoFlow())])
