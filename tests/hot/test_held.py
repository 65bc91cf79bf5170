"""The stop by what a step hands on: particles are as near as asked, or the report says not."""

from dataclasses import replace
from math import isnan

import numpy as np
import pytest
from hot_cases import CASES, DEGREES, over, plain_bodies, problem_of
from hot_steps import DT, stepper_of

from mpm_ref.hot.lbfgs import LBFGS, PAYS
from mpm_ref.hot.linearization import Linear
from mpm_ref.hot.methods import METHODS, minimise, options_of
from mpm_ref.plain import transfer

LOOSE = 1e-2        # tolerance of the gradient that leaves much to do


@pytest.fixture(scope="module", params=(2, 3))
def step(request):
    """A system in 2D or 3D, and its minimiser."""
    stepper, bodies = stepper_of(request.param)
    pose = stepper.pose(bodies, 0.0, DT)
    return stepper.system(pose), minimise(stepper.system(pose), "pn-pcg", eps=1e-13).dv


@pytest.mark.parametrize("case", [*CASES, *DEGREES], ids=lambda case: case.name)
def test_reach_is_the_largest_velocity_of_a_particle(case):
    q = problem_of(case)
    v = [transfer.velocity(over(q, q.w), ip, box)
         for _, ip, box in plain_bodies(q, case.degree)]
    farthest = max(np.linalg.norm(v_p, axis=1).max() for v_p in v)
    assert q.potential.reach(q.w) == pytest.approx(farthest, rel=1e-13)


@pytest.mark.parametrize("word", sorted(METHODS))
def test_every_method_holds_the_error_that_is_asked(word, step):
    system, exact = step
    options = replace(options_of(word), eps=LOOSE, norm="characteristic")
    alone = minimise(system, options)
    for cells in (1e-2, 1e-4):
        found = minimise(system, options, cells=cells)
        assert found.report.converged
        assert found.report.off <= cells
        assert system.cells(found.dv - exact) <= cells
    assert isnan(alone.report.off)
    assert system.cells(alone.dv - exact) > 1e-4       # the gradient alone does not hold it


def test_estimate_is_near_the_error(step):
    """SAFETY times the length of a step of Newton that CG takes to 2 %."""
    system, exact = step
    report = minimise(system, "hot", eps=LOOSE, cells=10.0).report
    start = minimise(system, "hot", eps=LOOSE)
    error = system.cells(start.dv - exact)
    assert error <= report.off <= 4.0 * error


def test_the_step_of_the_check_is_taken(step):
    system, exact = step
    alone = minimise(system, "hot", eps=LOOSE)
    found = minimise(system, "hot", eps=LOOSE, cells=10.0)
    assert found.report.iterations == alone.report.iterations + 1
    assert system.cells(found.dv - exact) < 0.2 * system.cells(alone.dv - exact)


@pytest.mark.parametrize("word", ["hot", "pn-pcg"])
def test_what_round_off_does_not_allow_is_reported(word, step):
    report = minimise(step[0], word, cells=1e-30).report
    assert not report.converged
    assert report.off > 1e-30
    assert "particles may still be off by" in report.why
    assert "1e-30 were asked" in report.why


def test_iterations_are_bounded_over_all_rounds(step):
    report = minimise(step[0], "hot", eps=LOOSE, cells=1e-7, iterations=3).report
    assert not report.converged
    assert report.iterations <= 4       # and the step of the check
    assert "were asked" in report.why


def test_nothing_to_do_is_held_at_once(step):
    """From the minimiser on nothing moves but round-off."""
    system, exact = step
    system = type(system)(system.potential, system.unknowns, system.kappa, exact)
    report = minimise(system, "hot", cells=1e-6).report
    assert report.converged
    assert report.off < 1e-9


def test_what_is_no_number_is_not_held(step):
    """Nothing tells how far off it is."""
    stepper, bodies = stepper_of(step[1].shape[1])
    bodies[0].particles.F[3] = np.nan
    broken = stepper.system(stepper.pose(bodies, 0.0, DT))
    for word in ("hot", "pn-pcg"):
        report = minimise(broken, word, cells=1e3).report
        assert not report.converged
        assert report.off == np.inf


@pytest.mark.parametrize("cells", [-1.0, np.inf, np.nan])
def test_impossible_errors_are_refused(cells):
    with pytest.raises(ValueError, match=r"cells = .*expected"):
        options_of("hot", cells=cells)


@pytest.mark.parametrize(("renew", "curvature", "full", "anew"), [
    ("never", 0.1, False, False), ("shortened", 0.1, True, False), ("shortened", 1.0, False, True),
    ("stale", 1.0, True, False), ("stale", 1.0, False, True), ("stale", 0.7, True, True),
    ("stale", 0.8, True, False), ("stale", 1.4, True, True), ("stale", 1.3, True, False)])
def test_a_hessian_is_renewed_where_it_was_seen_to_be_wrong(renew, curvature, full, anew):
    """One that says 2 s.s."""
    method = LBFGS(lambda dv: Linear(lambda s: 2.0 * s, lambda r: 0.5 * r), window=3, renew=renew)
    method.first(None)
    s = np.ones((1, 2))
    for _ in range(PAYS - 1):
        method.learn(s, 2.0 * s)
    method.learn(s, 2.0 * curvature * s, full)
    assert (method.linear is None, len(method.pairs)) == ((True, 0) if anew else (False, 3))


@pytest.mark.parametrize(("renew", "full", "anew"), [
    ("shortened", False, True), ("stale", False, False), ("stale", True, False)])
def test_first_step_of_a_hessian_says_little(renew, full, anew):
    """It may be too long for any Hessian, and another one would not have paid yet."""
    method = LBFGS(lambda dv: Linear(lambda s: 2.0 * s, lambda r: 0.5 * r), window=3, renew=renew)
    method.first(None)
    method.learn(np.ones((1, 2)), 0.2 * np.ones((1, 2)), full)
    assert (method.linear is None) == anew


@pytest.mark.parametrize("renew", ["shortened", "stale"])
def test_renewed_hessians_find_the_same_minimiser(renew, step):
    system, exact = step
    found = minimise(system, "hot", renew=renew, eps=1e-11)
    assert found.report.converged
    assert system.cells(found.dv - exact) < 1e-8
