"""The judge of implicit solves at the extremes: it must notice what a solve gets wrong."""

import numpy as np
import pytest

from mpm_ref.hot import step
from mpm_ref.hot.methods import METHODS, minimise
from validation.extremes import hot_every_method as every
from validation.extremes.blocks import DX, FRAME, brick, elastic, gravity, shake
from validation.extremes.hot_solve import CONVERGED, EPS, STOPPED, StepSetup, solve
from validation.extremes.hot_units import SYSTEMS, convert_units, solve_step


def setup():
    return StepSetup((shake(brick((3, 3))),), DX, FRAME, gravity(2))


class Records(dict):
    """What an experiment records: {target: (value, note)}."""

    def record(self, target, value, **given):
        self[target] = value, given["note"]


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
    stopped = solve(given, "hot", max_iterations=1)
    assert stopped.kind == STOPPED
    assert "the cap" in stopped.why
    assert np.array_equal(given.bodies[0].particles.x, before)


@pytest.mark.parametrize(("change", "said"), [
    (lambda dv, r: (np.zeros_like(dv), r), "converged, but its gradient is not small"),
    (lambda dv, r: (100.0 * dv, r), "energy rose"),
    (lambda dv, r: (np.nan * dv, r), "increment not finite"),
    (lambda dv, r: (dv, r._replace(converged=False, message="")), "no reason given"),
    (lambda dv, r: (dv, r._replace(iterations=501)), "more iterations than its caps"),
    (lambda dv, r: (dv, r._replace(evaluations=10**6)), "more evaluations than its caps"),
])
def test_unsound_solves_are_named(monkeypatch, change, said):
    spoilt(monkeypatch, change)
    assert solve(setup(), "pn-pcg").kind == said


def test_other_units_are_the_same_problem():
    given = setup()
    report, dv = solve_step(given, "lbfgs-h")
    there, dv_there = solve_step(convert_units(given, SYSTEMS["binary"]), "lbfgs-h")
    units = SYSTEMS["binary"]
    assert there.residuals == report.residuals
    assert np.array_equal(dv_there * units.T / units.L, dv)
    wrong = convert_units(given, units)._replace(gravity=given.gravity)
    assert solve_step(wrong, "lbfgs-h")[0].residuals[0] != report.residuals[0]


def test_every_method_is_tried_to_the_same_tolerance():
    soft = setup()._replace(bodies=(shake(brick((3, 3), elastic(10.0))),))
    found = every.solve_by_all_methods(soft)
    assert [end.method for end in found] == list(METHODS)
    assert {end.kind for end in found} == {CONVERGED}
    assert max(end.least for end in found) <= EPS


def test_hard_states_are_of_one_step_in_two_dimensions():
    made = every.setups(np.random.default_rng(0))
    assert {(s.dt, len(s.gravity)) for s in made.values()} == {(FRAME, 2)}
    assert set(every.QUICK) < set(made)
    J = np.linalg.det(made["inverted"].bodies[0].particles.F)
    assert J.max() < 0.0
    assert not np.linalg.det(made["collapsed"].bodies[0].particles.F).any()


def test_ends_of_a_method_are_counted_by_kind():
    good, lost = solve(setup(), "pn-pcg"), solve(setup(), "pn-pcg", max_iterations=1)
    rows = [("a", good), ("b", lost), ("c", good._replace(kind="energy rose")), ("d", good)]
    found = Records()
    every.record_method(found, "pn-pcg", rows)
    assert found["extremes.hot.every_method.pn-pcg.unsound"] == (1, "c: energy rose")
    converged, note = found["extremes.hot.every_method.pn-pcg.converged"]
    assert converged == 2
    assert "b: 1 iterations, the cap" in note
