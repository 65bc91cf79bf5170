"""The judge of implicit solves at the extremes: it must notice what a solve gets wrong."""

import numpy as np
import pytest

from mpm_ref.hot import step
from mpm_ref.hot.methods import minimise
from validation.extremes.hot_bodies import DX, FRAME, brick, gravity, shaken
from validation.extremes.hot_solve import CONVERGED, STOPPED, Setup, solve
from validation.extremes.hot_units import SYSTEMS, converted, solved


def setup():
    return Setup(shaken((brick((3, 3)),)), DX, FRAME, gravity(2))


def spoilt(monkeypatch, change):
    """Let solvers return what `change` makes of (dv, report)."""
    def lie(system, options):
        right = minimise(system, options)
        dv, report = change(right.dv, right.report)
        return right._replace(dv=dv, report=report)
    monkeypatch.setattr(step, "minimise", lie)


def test_sound_solves_pass_and_leave_the_bodies_alone():
    given = setup()
    before = given.bodies[0].particles.x.copy()
    assert solve(given, "pn-pcg").kind == CONVERGED
    stopped = solve(given, "hot", iterations=1)
    assert stopped.kind == STOPPED
    assert "the cap" in stopped.why
    assert np.array_equal(given.bodies[0].particles.x, before)


@pytest.mark.parametrize(("change", "said"), [
    (lambda dv, r: (np.zeros_like(dv), r), "converged, but its gradient is not small"),
    (lambda dv, r: (100.0 * dv, r), "energy rose"),
    (lambda dv, r: (np.nan * dv, r), "increment not finite"),
    (lambda dv, r: (dv, r._replace(converged=False, why="")), "no reason given"),
    (lambda dv, r: (dv, r._replace(iterations=501)), "more iterations than its caps"),
    (lambda dv, r: (dv, r._replace(evaluations=10**6)), "more evaluations than its caps"),
])
def test_unsound_solves_are_named(monkeypatch, change, said):
    spoilt(monkeypatch, change)
    assert solve(setup(), "pn-pcg").kind == said


def test_other_units_are_the_same_problem():
    given = setup()
    report, dv = solved(given, "lbfgs-h")
    there, dv_there = solved(converted(given, SYSTEMS["binary"]), "lbfgs-h")
    units = SYSTEMS["binary"]
    assert there.residuals == report.residuals
    assert np.array_equal(dv_there * units.T / units.L, dv)
    wrong = converted(given, units)._replace(gravity=given.gravity)
    assert solved(wrong, "lbfgs-h")[0].residuals[0] != report.residuals[0]
