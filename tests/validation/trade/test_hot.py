"""What a step's solve leaves in the particles, and how methods are compared by it."""

import numpy as np
import pytest

from mpm_ref.scene import Body, Box, Material, Regular, Scene, Scheme, Velocity, build
from validation.hot.iterates import initial_step
from validation.hot.one_step import ParticleErrors, difference, particle_errors
from validation.hot.stiffness import METHODS
from validation.hot.warm_states import START_TIMES
from validation.trade import hot_scenes as hot_methods
from validation.trade.hot import POINT_FIELDS, SolvePoint, bounded_below, times_for
from validation.trade.hot_scenes import (
    ALL_METHODS,
    CAPS,
    COMPARISONS,
    FEW_METHODS,
    SLOW,
    SceneTrial,
    ToleranceLadder,
    compared_error,
    descend_ladders,
    fastest,
    plan,
    ratios_to_hot,
    record_ranges,
    record_ranking,
    seconds,
    tolerance_ladders,
)


@pytest.fixture(scope="module")
def step():
    """The first step of a block that is thrown and falls: two-dimensional, a few particles."""
    block = Body(name="block", density=1000.0, shape=Box(lower=[0.0, 0.0], upper=[0.2, 0.2]),
                 sampling=Regular(per_cell=2), material=Material(law="neo_hookean", E=1e5, nu=0.3),
                 velocity=Velocity(linear=[3.0, 0.0]))
    scene = Scene(dim=2, dx=0.1, gravity=[0.0, -9.8], integrator="hot", cfl=0.6, longest=0.01,
                  end=0.1, every=1, scheme=Scheme(transfer="apic"), body=(block,))
    return initial_step(build(scene))


def fall(step):
    """The increment of a free fall."""
    return np.broadcast_to([0.0, -9.8 * step.dt], step.pose.unknowns.dv0.shape).copy()


def test_a_speed_that_all_have_too_much_is_every_error(step):
    extra = np.array([0.3, 0.4])
    found = particle_errors(step, fall(step) + extra, fall(step))
    assert found.velocity == pytest.approx(0.5 / (9.8 * step.dt))
    assert found.velocity_max == pytest.approx(found.velocity)
    assert found.cells == pytest.approx(0.5 * step.dt / 0.1)
    assert found.cells_max == pytest.approx(found.cells)
    assert difference(step, fall(step) + extra, fall(step)) == (found.velocity, found.cells_max)


def test_nothing_done_is_an_error_of_one(step):
    errors = particle_errors(step, np.zeros_like(fall(step)), fall(step))
    assert errors.velocity == pytest.approx(1.0)
    assert particle_errors(step, fall(step), fall(step)) == (0.0, 0.0, 0.0, 0.0)


def test_one_node_moves_the_particles_near_it_most(step):
    one = fall(step)
    one[0] += 1.0
    found = particle_errors(step, one, fall(step))
    assert found.velocity_max > 1.5 * found.velocity
    assert found.cells_max / found.cells == pytest.approx(found.velocity_max / found.velocity)
    assert found.cells_max < step.dt / 0.1


def made(method, eps, cpu, error, **others):
    """A `SolvePoint`, whose other errors are tenths of this one."""
    rest = dict.fromkeys(POINT_FIELDS, 0) | {
        "iterations": 1, "converged": True, "cells": 0.1 * error}
    return SolvePoint(**rest | {"method": method, "eps": eps, "cpu": cpu, "error": error} | others)


def test_no_error_is_known_better_than_the_reference():
    points = [made("pn-pcg", 1e-7, 1.0, 0.0), made("pn-pcg", 1e-6, 1.0, 1e-2, cells=1e-2,
                                                   error_max=2e-2, cells_rms=3e-3)]
    least = ParticleErrors(1e-4, 2e-4, 3e-5, 4e-5)
    small, large = bounded_below(points, least)
    assert (small.error, small.error_max, small.cells_rms, small.cells) == least
    assert large == points[1]


def test_times_are_read_between_solves_that_did_something():
    points = [made("hot", 1e-5, 1e-6, 1.0, iterations=0), made("hot", 1e-6, 1.0, 1e-1),
              made("hot", 1e-7, 4.0, 1e-3), made("hot", 1e-8, 9.0, 0.2, cells=1e-6)]
    assert times_for(points, ("hot", "pn-pcg"), 1e-2) == {"hot": pytest.approx(2.0), "pn-pcg": None}
    assert times_for(points, ("hot",), 0.5) == {"hot": 1.0}
    assert times_for(points, ("hot",), 1e-5, "cells")["hot"] > 4.0


def paired():
    """HOT and a Newton that is faster at equal tolerance, slower at equal error."""
    return [made("hot", 1e-6, 1.0, 1e-1), made("hot", 1e-7, 2.0, 1e-2, cells=5e-4),
            made("pn-pcg", 1e-6, 1.0, 1.0), made("pn-pcg", 1e-7, 1.5, 1e-1),
            made("pn-pcg", 1e-8, 6.0, 1e-3), made("pn-mgpcg", 1e-7, 9.0, 0.4)]


def test_equal_error_is_that_of_hot_at_the_papers_tolerance():
    assert compared_error(paired()) == 1e-2
    times = seconds(paired())
    assert times["equal-eps"] == {"hot": 2.0, "pn-pcg": 1.5, "pn-mgpcg": 9.0}
    assert times["equal-error"] == {"hot": 2.0, "pn-pcg": pytest.approx(3.0)}   # logarithmic scales
    assert times["cells"]["pn-pcg"] == pytest.approx(3.0)
    assert 1.0 < times["cells"]["hot"] < 2.0
    over = ratios_to_hot(times)
    assert over["equal-eps"] == {"pn-pcg": 0.75, "pn-mgpcg": 4.5}
    assert over["equal-error"] == {"pn-pcg": pytest.approx(1.5)}


def test_the_fastest_is_another_one_only_where_it_is_no_tie():
    times = seconds(paired())
    assert fastest(times) == {"equal-eps": "pn-pcg", "equal-error": "hot", "cells": "hot"}
    times["equal-error"]["hot"] = 2.9
    assert fastest(times)["equal-error"] == "pn-pcg"


def test_solves_cut_short_are_not_fast():
    points = [made("hot", 1e-7, 2.0, 1e-2, converged=False), made("lbfgs-h", 1e-7, 3.0, 1e-3),
              made("hot", 1e-8, 9.0, 1e-6, converged=False),
              made("pn-pcg", 1e-7, 1.0, 1e-2, converged=False)]
    times = seconds(points)
    assert set(times["equal-eps"]) == {"hot", "lbfgs-h"}
    assert times["equal-error"] == {"hot": 2.0, "lbfgs-h": 3.0}     # below it from its first point
    assert times["cells"] == {"hot": 2.0, "lbfgs-h": 3.0}


def test_an_error_of_a_solve_that_has_hardly_begun_is_not_compared():
    times = seconds([made("hot", 1e-7, 2.0, 0.6), made("pn-pcg", 1e-7, 1.0, 0.4)])
    assert times["equal-error"] == {}
    assert set(ratios_to_hot(times)) == {"equal-eps"}       # none is within a thousandth of a cell
    assert fastest(times) == {"equal-eps": "pn-pcg", "equal-error": None, "cells": None}


def stepped(monkeypatch, solve):
    """`descend_ladders`'s (method, eps), where solve(method, eps) -> CPU seconds, converged."""
    def point(step, exact, way, repeats, **options):
        assert options.items() >= CAPS.items()
        cpu, converged = solve(*way)
        return made(*way, cpu, 0.1, converged=converged)
    monkeypatch.setattr(hot_methods, "measured_point", point)
    tried = [ToleranceLadder("hot", (1e-5, 1e-6, 1e-7, 1e-8)),
             ToleranceLadder("pn-pcg", (1e-5, 1e-6, 1e-7, 1e-8)),
             ToleranceLadder("gast15", (1.0, 0.1))]
    return [(p.method, p.eps) for p in descend_ladders(None, None, tried)]


def test_ways_take_turns_down_their_ladders(monkeypatch):
    assert stepped(monkeypatch, lambda method, eps: (1.0, True)) == [
        ("hot", 1e-5), ("pn-pcg", 1e-5), ("gast15", 1.0), ("hot", 1e-6), ("pn-pcg", 1e-6),
        ("gast15", 0.1), ("hot", 1e-7), ("pn-pcg", 1e-7), ("hot", 1e-8), ("pn-pcg", 1e-8)]


@pytest.mark.parametrize("answer", [(1.0, False), (2.0 * SLOW, True)])
def test_a_solve_cut_short_or_slow_is_a_ways_last(monkeypatch, answer):
    """But HOT goes on to the paper's tolerance."""
    tried = stepped(monkeypatch, lambda method, eps: answer if eps < 5e-6 else (1.0, True))
    assert [eps for method, eps in tried if method == "pn-pcg"] == [1e-5, 1e-6]
    assert [eps for method, eps in tried if method == "hot"] == [1e-5, 1e-6, 1e-7]


def test_every_method_is_tried_and_newton_with_multigrid_bears_its_cycle():
    quick, standard = plan("quick"), plan("standard")
    assert {trial.methods for trial in quick} == {METHODS}
    assert {(t.size, t.methods) for t in standard} == {
        ("quick", ALL_METHODS), ("standard", FEW_METHODS)}
    assert {t.scene for t in standard if t.size == "quick"} == set(START_TIMES)
    found = {way.method: way for way in tolerance_ladders(ALL_METHODS, (1e-3, 1e-4))}
    assert {name for name, way in found.items() if "flexible" in way.options} == {
        "pn-mgpcg", "pn-gmg-pcg"}
    assert [name for name, way in found.items() if way.ladder != (1e-3, 1e-4)] == ["gast15"]


class Records(dict):
    """What an experiment records: {target: (value, note)}, and the bounds of what is judged."""

    def __init__(self, profile="standard"):
        self.profile, self.bounds = profile, {}

    def record(self, target, value, *, note, **given):
        self[target] = value, note
        if "bound" in given:
            self.bounds[target] = given["bound"]


def test_ranges_name_their_scenes_and_where_a_method_changes_places_with_hot():
    run = Records()
    record_ranges(run, {
        "wheel": {"equal-eps": {"pn-pcg": 0.5, "admm": 3.0}, "equal-error": {"pn-pcg": 2.0}},
        "boxes": {"equal-eps": {"pn-pcg": 4.0}, "cells": {"pn-pcg": 1.5}},
        "sauce": {"equal-eps": {"pn-pcg": 3.0}, "equal-error": {"pn-pcg": 6.0}}})
    short = {t.removeprefix("trade.hot.scenes.range."): (value, note.split(";")[0])
             for t, (value, note) in run.items()}
    assert short["pn-pcg.equal-eps.min"] == (0.5, "wheel")
    assert short["pn-pcg.equal-eps.max"] == (4.0, "boxes")
    assert short["pn-pcg.equal-error.max"] == (6.0, "sauce")
    assert short["pn-pcg.cells.min"] == short["pn-pcg.cells.max"] == (1.5, "boxes")
    assert "admm.equal-error.min" not in short
    value, note = run["trade.hot.scenes.range.pn-pcg.turned"]
    assert value == 1
    assert note.endswith("wheel (0.5 -> 2)")
    assert "the paper, at equal tolerance: 1.98" in run[
        "trade.hot.scenes.range.pn-pcg.equal-eps.min"][1]


@pytest.mark.parametrize(("profile", "bounds"), [
    ("standard", {"trade.hot.scenes.range.hot-plus.equal-error.mean": 0.7}), ("quick", {})])
def test_the_mean_of_hot_plus_at_equal_error_is_judged(profile, bounds):
    run = Records(profile)
    ratios = {"hot-plus": 0.5, "pn-pcg": 4.0}
    record_ranges(run, {"wheel": {"equal-eps": ratios, "equal-error": ratios},
                        "boxes": {"equal-eps": ratios, "equal-error": {"hot-plus": 2.0}}})
    assert run.bounds == bounds
    assert run["trade.hot.scenes.range.hot-plus.equal-error.mean"][0] == pytest.approx(1.0)
    assert run["trade.hot.scenes.range.pn-pcg.equal-eps.mean"][0] == pytest.approx(4.0)


def test_ranking_counts_trials_that_can_be_compared():
    run = Records()
    record_ranking(run, {
        SceneTrial("wheel", "quick", (), ()): seconds(paired()),
        SceneTrial("wheel", "standard", (), ()): seconds([made("hot", 1e-7, 2.0, 0.9),
                                                     made("pn-pcg", 1e-7, 3.0, 0.9)])})
    short = {t.removeprefix("trade.hot.scenes."): value for t, (value, _) in run.items()}
    assert short["reordered"] == short["hardly-begun"] == 1
    assert run["trade.hot.scenes.hardly-begun"][1].endswith("wheel.fine")
    assert [short[f"first.hot.{what}"] for what in COMPARISONS] == [1, 1, 1]
    assert [short[f"first.pn-pcg.{what}"] for what in COMPARISONS] == [1, 0, 0]
