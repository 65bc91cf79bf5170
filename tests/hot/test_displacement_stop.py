"""The stop by what a step hands on: particles are as near as asked, or the report says not."""

from dataclasses import replace
from math import inf, isnan

import numpy as np
import pytest
from hot_cases import CASES, DEGREES, over, plain_bodies, problem_of
from hot_steps import DT, stepper_of

from mpm_ref.hot.displacement_stop import FEWEST, SAFETY, newton_check
from mpm_ref.hot.lbfgs import LBFGS, REBUILD_COST
from mpm_ref.hot.line_search import Iterate
from mpm_ref.hot.linearization import Linearization
from mpm_ref.hot.methods import METHODS, minimise, options_of
from mpm_ref.hot.report import Profiler
from mpm_ref.plain import transfer

LOOSE = 1e-2        # tolerance of the gradient that leaves much to do


@pytest.fixture(scope="module", params=(2, 3))
def step(request):
    """A system in 2D or 3D, and its minimiser."""
    stepper, bodies = stepper_of(request.param)
    pose = stepper.problem(bodies, 0.0, DT)
    return stepper.system(pose), minimise(stepper.system(pose), "pn-pcg", eps=1e-13).dv


@pytest.mark.parametrize("case", [*CASES, *DEGREES], ids=lambda case: case.name)
def test_largest_velocity_is_that_of_a_particle(case):
    q = problem_of(case)
    v = [transfer.velocity(over(q, q.w), ip, box)
         for _, ip, box in plain_bodies(q, case)]
    farthest = max(np.linalg.norm(v_p, axis=1).max() for v_p in v)
    assert q.potential.largest_velocity(q.w) == pytest.approx(farthest, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("word", sorted(METHODS))
def test_every_method_holds_the_error_that_is_asked(word, step):
    system, exact = step
    options = replace(options_of(word), eps=LOOSE, norm="characteristic")
    alone = minimise(system, options)
    for cells in (1e-2, 1e-4):
        found = minimise(system, options, displacement_tolerance=cells)
        assert found.report.converged
        assert found.report.particle_error <= cells
        assert system.particle_displacement(found.dv - exact) <= cells
    assert isnan(alone.report.particle_error)
    assert system.particle_displacement(alone.dv - exact) > 1e-4   # the gradient alone misses it


def test_estimate_is_near_the_error(step):
    """SAFETY times the length of a step of Newton that CG takes to 2 %."""
    system, exact = step
    report = minimise(system, "hot", eps=LOOSE, displacement_tolerance=10.0).report
    start = minimise(system, "hot", eps=LOOSE)
    error = system.particle_displacement(start.dv - exact)
    assert error <= report.particle_error <= 4.0 * error


def test_the_step_of_the_check_is_taken(step):
    system, exact = step
    alone = minimise(system, "hot", eps=LOOSE)
    found = minimise(system, "hot", eps=LOOSE, displacement_tolerance=10.0)
    assert found.report.iterations == alone.report.iterations + 1
    assert (system.particle_displacement(found.dv - exact)
            < 0.2 * system.particle_displacement(alone.dv - exact))


class Springs:
    """Nodes (n, d) on springs to the origin, each with a particle that rides on it."""

    def __init__(self, K):
        self.K = K

    def evaluate(self, dv):
        return 0.5 * float(np.sum(self.K * dv**2)), self.K * dv

    def project(self, u):
        return u

    def particle_displacement(self, u):
        return float(np.linalg.norm(u, axis=1).max())

    def product(self, dv, projected=True):
        """A Hessian that is 8 times too stiff if it is projected."""
        return lambda u: (8.0 if projected else 1.0) * self.K * u


def checked(system, dv, asked):
    """The profiler and the next `Iterate` of a check of dv, with CG without preconditioner."""
    profiler, options = Profiler(), options_of("hot", displacement_tolerance=asked)
    point = Iterate(dv, *system.evaluate(dv))
    return profiler, newton_check(system, point, lambda r: r.copy(), options, profiler)


@pytest.mark.parametrize("d", [2, 3])
def test_check_is_by_the_exact_hessian(d):
    """On HOT's Twist the projected one made the step of the check 8 times too short."""
    system, dv = Springs(np.ones((5, d))), np.random.default_rng(1).normal(size=(5, d))
    profiler, better = checked(system, dv, 100.0)
    assert profiler.particle_error == pytest.approx(SAFETY * system.particle_displacement(dv))
    assert system.particle_displacement(better.dv) < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_check_waits_for_soft_modes_that_cg_finds_late(d):
    """The error is in them; after 50 iterations CG has a tenth of it."""
    K = np.logspace(-5.0, 0.0, 300 * d).reshape(300, d)
    system, dv = Springs(K), K**-0.75
    error = system.particle_displacement(dv)
    early, _ = checked(system, dv, 1e-9 * error)            # is too long at once
    assert early.cg_iterations == FEWEST
    assert early.particle_error < SAFETY * 0.1 * error
    for asked in (0.5 * error, 10.0 * error):
        late, better = checked(system, dv, asked)
        assert late.cg_iterations > FEWEST
        assert (late.particle_error <= asked) == (error <= asked)
    assert error <= late.particle_error <= 2.0 * SAFETY * error
    assert system.particle_displacement(better.dv) < 0.6 * error


@pytest.mark.parametrize("d", [2, 3])
def test_check_where_the_energy_is_no_minimum_tells_nothing(d):
    """However short the step; it still lowers the energy."""
    K = np.ones((5, d))
    K[2] = -0.5
    system, dv = Springs(K), np.full((5, d), 1e-9)
    profiler, better = checked(system, dv, 1.0)
    assert profiler.particle_error == inf
    assert better.E < system.evaluate(dv)[0]


@pytest.mark.parametrize("word", ["hot", "pn-pcg"])
def test_what_round_off_does_not_allow_is_reported(word, step):
    report = minimise(step[0], word, displacement_tolerance=1e-30).report
    assert not report.converged
    assert report.particle_error > 1e-30
    assert "particles may still be off by" in report.message
    assert "1e-30 were asked" in report.message


def test_iterations_are_bounded_over_all_rounds(step):
    report = minimise(step[0], "hot", eps=LOOSE, displacement_tolerance=1e-7,
                      max_iterations=3).report
    assert not report.converged
    assert report.iterations <= 4       # and the step of the check
    assert "were asked" in report.message


def test_nothing_to_do_is_held_at_once(step):
    """From the minimiser on nothing moves but round-off."""
    system, exact = step
    system = type(system)(system.potential, system.unknowns, system.kappa, exact)
    report = minimise(system, "hot", displacement_tolerance=1e-6).report
    assert report.converged
    assert report.particle_error < 1e-9


def test_what_is_no_number_is_not_held(step):
    """Nothing tells how far off it is."""
    stepper, bodies = stepper_of(step[1].shape[1])
    bodies[0].particles.F[3] = np.nan
    broken = stepper.system(stepper.problem(bodies, 0.0, DT))
    for word in ("hot", "pn-pcg"):
        report = minimise(broken, word, displacement_tolerance=1e3).report
        assert not report.converged
        assert report.particle_error == np.inf


@pytest.mark.parametrize("cells", [-1.0, np.inf, np.nan])
def test_impossible_errors_are_refused(cells):
    with pytest.raises(ValueError, match=r"displacement_tolerance = .*expected"):
        options_of("hot", displacement_tolerance=cells)


@pytest.mark.parametrize(("rule", "curvature", "full", "anew"), [
    ("never", 0.1, False, False), ("shortened", 0.1, True, False), ("shortened", 1.0, False, True),
    ("stale", 1.0, True, False), ("stale", 1.0, False, True), ("stale", 0.7, True, True),
    ("stale", 0.8, True, False), ("stale", 1.4, True, True), ("stale", 1.3, True, False)])
def test_a_hessian_is_rebuilt_where_a_step_shows_it_wrong(rule, curvature, full, anew):
    """One that says 2 s.s."""
    method = LBFGS(lambda dv: Linearization(lambda s: 2.0 * s, lambda r: 0.5 * r), window=3,
                   rebuild_when=rule)
    method.initial_inverse(None)
    s = np.ones((1, 2))
    for _ in range(REBUILD_COST - 1):
        method.update(s, 2.0 * s)
    method.update(s, 2.0 * curvature * s, full)
    assert (method.linear is None, len(method.pairs)) == ((True, 0) if anew else (False, 3))


@pytest.mark.parametrize(("rule", "full", "anew"), [
    ("shortened", False, True), ("stale", False, False), ("stale", True, False)])
def test_first_step_of_a_hessian_says_little(rule, full, anew):
    """It may be too long for any Hessian, and another one would not have paid yet."""
    method = LBFGS(lambda dv: Linearization(lambda s: 2.0 * s, lambda r: 0.5 * r), window=3,
                   rebuild_when=rule)
    method.initial_inverse(None)
    method.update(np.ones((1, 2)), 0.2 * np.ones((1, 2)), full)
    assert (method.linear is None) == anew


@pytest.mark.parametrize("rule", ["shortened", "stale"])
def test_rebuilt_hessians_find_the_same_minimiser(rule, step):
    system, exact = step
    found = minimise(system, "hot", rebuild_when=rule, eps=1e-11)
    assert found.report.converged
    assert system.particle_displacement(found.dv - exact) < 1e-8
