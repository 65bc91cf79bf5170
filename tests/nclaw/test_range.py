"""Strains that learned laws have seen: bounds, what is out of them, and that runs say so."""

import json

import neural_toys
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from nclaw_toys import cube

from mpm_ref.body import Body, particles_at, permute
from mpm_ref.materials import FixedCorotated, Fluid, NoFlow
from mpm_ref.materials.learned import weights
from mpm_ref.materials.learned.strain_range import (
    excess,
    stored_bounds,
    strain_bounds,
    strain_measures,
)
from mpm_ref.monitor import CHECK
from mpm_ref.nclaw import strain_watch as watching
from mpm_ref.nclaw.bodies import body_with_laws, copy_body
from mpm_ref.nclaw.strain_watch import (
    MAX_EXCESS,
    StrainWatch,
    poor_law_warnings,
    strain_report,
    strain_watch,
    time_step_warnings,
)
from mpm_ref.nclaw.study.training import run_error
from mpm_ref.nclaw.train.recipe import Recipe
from mpm_ref.nclaw.train.strains import MAX_STRETCH, segment_cuts, training_bounds
from mpm_ref.problem import Clock, Problem
from mpm_ref.scene import SceneError, build, load
from mpm_ref.simulate import State
from mpm_ref.store.results import Results
from mpm_ref.trajectories import observed

BOUNDS = {"low": [0.9, 0.8, 0.7], "high": [1.4, 1.0, 1.2], "dt": None}     # 2D: s_0, s_1, J
SCENE = """
title = "a learned block"
dim = 2
dx = 0.05
dt = 1e-3
steps = 60
every = 30
gravity = [0.0, -9.8]
walls = {{ low = [3, 3], high = [17, 17] }}

[[body]]
name = "learned"
density = 1000.0
shape = {{ type = "box", lower = [0.3, 0.2], upper = [0.5, 0.4] }}
velocity = {{ linear = [0.0, {speed}] }}
material = {{ law = "neural", weights = "laws.npz", guard = false }}
"""


def out(*rows):
    """How far strains (s_0, s_1, J) are out of BOUNDS."""
    return excess(np.array(rows), BOUNDS)


def body(*F, name="one"):
    """A body of points with these F (2, 2)."""
    n = len(F)
    q = particles_at(np.zeros((n, 2)), np.zeros((n, 2)), np.ones(n), np.ones(n))
    q.F[:] = F
    return Body(name, q, FixedCorotated(1.0, 1.0), NoFlow(), np.arange(n))


# what is out of bounds

def test_within_bounds_nothing_is_out():
    assert out([0.9, 0.8, 0.7], [1.4, 1.0, 1.2], [1.1, 0.9, 0.99]).tolist() == [0.0, 0.0, 0.0]


def test_distances_are_shares_of_the_width_on_either_side():
    """Widths are 0.5, 0.2, 0.5; the farthest measure counts."""
    assert out([1.6, 0.9, 1.0], [1.0, 1.1, 1.0], [1.0, 0.9, 0.45], [1.9, 0.7, 1.0]) \
        == pytest.approx([0.4, 0.5, 0.5, 1.0])


def test_inverted_points_are_infinitely_far_unless_training_saw_some():
    assert out([1.0, -0.9, -0.9], [1.0, 0.0, 0.0]).tolist() == [np.inf, np.inf]
    wide = {"low": [0.9, -1.0, -1.0], "high": [1.4, 1.0, 1.2]}
    assert excess(np.array([[1.0, -0.9, -0.9]]), wide).tolist() == [0.0]


@pytest.mark.parametrize("a", [np.nan, np.inf])
def test_what_is_not_finite_is_infinitely_far(a):
    F = np.eye(2)
    F[0, 1] = a
    sight = strain_report(body(np.eye(2), F), BOUNDS)
    assert (sight.particle, sight.excess, sight.count, sight.n) == (1, np.inf, 1, 2)


def test_laws_that_saw_rest_alone_have_narrow_bounds():
    rest = strain_bounds(np.eye(2)[None])
    assert excess(strain_measures(np.eye(2)[None]), rest).tolist() == [0.0]
    assert excess(strain_measures(1.001 * np.eye(2)[None]), rest)[0] > 1e5


def test_the_farthest_point_is_named_by_its_own_number():
    far, near = np.diag([1.8, 0.9]), np.diag([1.5, 0.9])
    one = body(np.eye(2), near, far)
    permute(one, np.array([2, 0, 1]))
    sight = strain_report(one, BOUNDS)
    assert (sight.particle, sight.count, sight.out_of_range) == (2, 1, True)
    assert sight.measures == pytest.approx((1.8, 0.9, 1.62))
    assert sight.J == sight.measures[-1]
    assert not strain_report(body(*[np.eye(2)] * 3, near), BOUNDS).out_of_range
    assert 0.0 < strain_report(body(np.eye(2), near), BOUNDS).excess <= MAX_EXCESS


def test_a_body_that_is_strained_as_a_whole_is_out_of_range():
    """Each of its points is within the bound of a single one."""
    near = np.diag([1.5, 0.9])                          # an excess of 0.2 of the width, ...
    found = strain_report(body(*[near] * 4), {**BOUNDS, "high": [1.4, 1.0, 1.4]})
    assert 0.1 < found.excess <= MAX_EXCESS             # ... less than it takes for one point
    assert (found.count, found.mean) == (0, pytest.approx(found.excess))
    assert found.out_of_range
    mixed = strain_report(body(near, *[np.eye(2)] * 3), {**BOUNDS, "high": [1.4, 1.0, 1.4]})
    assert mixed.mean == pytest.approx(0.25 * found.excess)
    assert not mixed.out_of_range
    bounds = {**BOUNDS, "high": [1.4, 1.0, 1.4]}
    (said,) = StrainWatch({"one": bounds}).news(State((body(*[near] * 4),), step=CHECK, t=0.5))
    assert ("particle 0 and most others, on average by 0.2 of the range's width, more than 0.1: "
            "principal stretches 1.5, 0.9") in said


def test_fluids_that_carry_J_are_looked_at():
    q = particles_at(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1), np.ones(1), fluid=True)
    q.F[:] = 0.49
    sight = strain_report(Body("f", q, Fluid(1.0), NoFlow(), np.arange(1)), BOUNDS)
    assert sight.measures == pytest.approx((0.7, 0.7, 0.49))


# what a run says

def far_body(name="one"):
    return body(np.eye(2), np.diag([3.0, 0.9]), np.diag([2.0, 0.9]), name=name)


def test_a_run_says_it_once_for_each_body():
    sight = StrainWatch({"one": BOUNDS, "two": BOUNDS})
    first = sight.news(State((far_body(), body(np.eye(2), name="two")), step=CHECK, t=0.5))
    assert len(first) == 1
    assert first[0] == (
        f"step {CHECK}, t = 0.5 s: body 'one': particle 1, and 1 others: principal stretches 3, "
        "0.9, J = 2.7, are outside what its learned law has seen in training: 0.9 to 1.4, 0.8 to 1,"
        " J 0.7 to 1.2; its answer there is a guess: train on a run that strains as much, or load "
        "this one less")
    again = sight.news(State((far_body(), far_body("two")), step=2 * CHECK))
    assert len(again) == 1
    assert "body 'two'" in again[0]
    assert sight.news(State((far_body(), far_body("two")), step=3 * CHECK)) == []


def test_a_run_is_looked_at_now_and_then():
    sight = StrainWatch({"one": BOUNDS})
    assert sight.news(State((far_body(),), step=CHECK - 1)) == []
    assert sight.news(State((far_body(),), step=CHECK)) != []


def test_bodies_of_other_laws_are_not_looked_at(monkeypatch):
    sight = StrainWatch({"two": BOUNDS})
    assert sight.news(State((far_body(), body(np.eye(2), name="two")), step=CHECK)) == []


def test_without_learned_laws_nothing_watches():
    problem = cube(3)
    assert strain_watch(problem) is None
    problem.strain_bounds["one"] = BOUNDS
    assert isinstance(strain_watch(problem), StrainWatch)


# what weights say

def test_weights_that_say_nothing_are_no_bounds():
    assert stored_bounds({"scene": "x"}, 3) is None


def test_bounds_and_time_step_are_read():
    about = {"seen": {"low": [0.9, 0.8, 0.7], "high": [1.4, 1.0, 1.2]}, "dt": 5e-4}
    assert stored_bounds(about, 2) == {**BOUNDS, "dt": 5e-4}
    del about["dt"]
    assert stored_bounds(about, 2) == BOUNDS


@pytest.mark.parametrize("given", [
    None, [1, 2], {"low": [0.9, 0.8, 0.7]}, {"low": [1.0], "high": [1.0]},
    {"low": [0.9, 0.8, "a"], "high": [1.4, 1.0, 1.2]},
    {"low": [1.5, 0.8, 0.7], "high": [1.4, 1.0, 1.2]},
    {"low": [None, 0.8, 0.7], "high": [1.4, 1.0, 1.2]}])
def test_what_are_no_bounds_is_refused(given):
    with pytest.raises(ValueError, match=r"strains seen in training: .*; expected low and high, "
                                         "for 2 stretches and J; train again"):
        stored_bounds({"seen": given}, 2)


@pytest.mark.parametrize("dt", ["fast", -1.0, 0.0, [1.0]])
def test_what_is_no_time_step_is_refused(dt):
    with pytest.raises(ValueError, match=r"time step of training: .*; expected a number above 0"):
        stored_bounds({"seen": {"low": [0.9, 0.8, 0.7], "high": [1.4, 1.0, 1.2]}, "dt": dt}, 2)


@pytest.mark.parametrize(("clock", "said"), [
    (Clock(dt=1e-3, steps=1), []), (Clock(dt=2e-3, steps=1), ["dt = 0.002 s"]),
    (Clock(steps=1), ["an adaptive one"])])
def test_other_time_steps_are_told(clock, said):
    problem = Problem((body(np.eye(2)),), 0.1, clock, np.zeros(2),
                      strain_bounds={"one": {**BOUNDS, "dt": 1e-3}, "two": BOUNDS})
    found = list(time_step_warnings(problem))
    assert len(found) == len(said)
    assert all("trained in steps of 0.001 s" in one and words in one
               for one, words in zip(found, said, strict=True))


@pytest.mark.parametrize(("error", "said"), [
    (0.1, []), (0.3, ["missed 30% of the motion"]), (None, ["broke down on"]), ("none", [])])
def test_poor_laws_are_told(error, said):
    """Of weights without the entry nothing is known."""
    bounds = BOUNDS if error == "none" else {**BOUNDS, "run_error": error}
    problem = Problem((body(np.eye(2)),), 0.1, Clock(dt=1e-3, steps=1), np.zeros(2),
                      strain_bounds={"one": bounds})
    found = list(poor_law_warnings(problem))
    assert len(found) == len(said)
    assert all(words in one for one, words in zip(found, said, strict=True))


def test_the_error_on_the_own_run_is_read_where_it_is_stored():
    about = {"seen": {"low": [0.9, 0.8, 0.7], "high": [1.4, 1.0, 1.2]}, "run_error": None}
    assert stored_bounds(about, 2) == {**BOUNDS, "run_error": None}


def test_the_error_of_a_run_is_over_its_motion():
    """The same laws have none, softer ones some, hopeless ones no number."""
    run = observed(cube(12))
    assert run_error(cube(12), copy_body, run.x) == 0.0
    moved = np.concatenate([run.x[:1], run.x[1:] + 0.1])
    assert run_error(cube(12), copy_body, moved) == pytest.approx(
        np.sqrt(0.01 * 12 / 13 / np.mean((moved - moved[0]) ** 2)))
    assert 0.0 < run_error(cube(12), soft, run.x) < 1.0
    assert run_error(cube(12), stiff(1e200, 1e200), run.x) is None


# what a training has met

def soft(one):
    """A body of a softer law."""
    return body_with_laws(one, FixedCorotated(4e2, 3e2), one.flow)


def test_what_is_met_is_of_the_run_and_of_segments():
    """With the true laws, segments are the run; with others they strain otherwise."""
    run = observed(cube(40))
    alone = strain_bounds(run.F)
    same = training_bounds(cube(40), run, copy_body, [0, 5, 40])
    assert all(same[end] == pytest.approx(alone[end]) for end in alone)
    other = training_bounds(cube(40), run, soft, [0, 40])
    assert other["low"][-1] < 0.95 * alone["low"][-1]
    assert all(a <= b for a, b in zip(other["low"], alone["low"], strict=True))
    assert all(a >= b for a, b in zip(other["high"], alone["high"], strict=True))
    assert training_bounds(cube(40), run, soft, []) == alone


def test_segments_begin_in_the_observed_state():
    """The short one of the late run strains otherwise than the long one."""
    run = observed(cube(40))
    late = training_bounds(cube(40), run, soft, [30, 40])
    whole = training_bounds(cube(40), run, soft, [0, 40])
    alone = strain_bounds(run.F)
    assert late["high"][0] > 1.01 * alone["high"][0]
    assert late["low"] == alone["low"]
    assert whole["low"][-1] < 0.95 * alone["low"][-1]


def stiff(mu, lam):
    return lambda body: body_with_laws(body, FixedCorotated(mu, lam), body.flow)


def test_segments_that_break_down_count_as_far_as_they_went():
    run = observed(cube(12))
    found = training_bounds(cube(12), run, stiff(4e6, 3e6), [0, 12])
    assert max(map(abs, found["low"] + found["high"])) <= MAX_STRETCH
    assert found["high"][0] > 1.1 * strain_bounds(run.F)["high"][0]
    hopeless = training_bounds(cube(12), run, stiff(1e200, 1e200), [0, 12])
    assert hopeless == strain_bounds(run.F)


def test_frames_that_were_not_seen_are_left_out():
    run = observed(cube(6))
    run.F[3] = np.nan
    assert np.isfinite(training_bounds(cube(6), run, lambda one: one, [])["low"]).all()


def test_cuts_are_those_of_an_epoch():
    recipe = Recipe(epochs=10)
    assert len(segment_cuts(recipe, 1000, 1)) == 41
    assert len(segment_cuts(recipe, 1000)) < len(segment_cuts(recipe, 1000, 5)) < 41
    assert segment_cuts(recipe, 1000)[-1] == 1000


# scenes and the command line

NARROW = {"low": [0.999, 0.999, 0.998], "high": [1.001, 1.001, 1.002]}
WIDE = {"low": [0.0, 0.0, 0.0], "high": [9.0, 9.0, 81.0]}


def made(folder, about, speed=-3.0):
    """A scene with weights of which this is known."""
    weights.save(folder / "laws.npz", neural_toys.laws(2)._replace(about=about))
    (folder / "scene.toml").write_text(SCENE.format(speed=speed))
    return folder / "scene.toml"


def test_a_scene_takes_bounds_from_its_weights(tmp_path):
    scene = made(tmp_path, {"seen": NARROW, "dt": 1e-3})
    assert build(load(scene)).strain_bounds == {"learned": {**NARROW, "dt": 1e-3}}
    assert build(load(made(tmp_path, {}))).strain_bounds == {}
    with pytest.raises(SceneError, match=r"body\[0\].material.weights.*strains seen in training"):
        build(load(made(tmp_path, {"seen": {"low": [1.0]}})))


def test_the_command_says_it_once_and_the_results_keep_it(tmp_path):
    scene, out = made(tmp_path, {"seen": NARROW, "dt": 1e-3}), tmp_path / "run.h5"
    done = mpm_ref("run", scene, "--out", out)
    assert_told(done, 0, "warning: step 20, t = 0.02 s: body 'learned': particle", "is a guess")
    with Results(out) as results:
        assert len(results.manifest["parts"][0]["strain_warnings"]) == 1
    info = mpm_ref("info", out)
    assert_told(info, 0, "warning: step 20", "is a guess")
    facts = json.loads(mpm_ref("info", out, "--json").stdout)
    assert len(facts["warnings"]) == 1


def test_a_run_within_bounds_says_nothing(tmp_path):
    scene = made(tmp_path, {"seen": WIDE, "dt": 1e-3})
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5")
    assert (done.exit_code, done.stderr) == (0, "")


def test_another_time_step_is_told_before_the_run(tmp_path):
    scene = made(tmp_path, {"seen": WIDE, "dt": 5e-4})
    assert_told(mpm_ref("run", scene, "--out", tmp_path / "run.h5"), 0,
                "warning: body 'learned': its laws were trained in steps of 0.0005 s")


def test_a_run_without_learned_laws_is_never_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(watching, "strain_report", None)
    text = SCENE.format(speed=-3.0).replace('law = "neural", weights = "laws.npz", guard = false',
                                            'law = "fixed_corotated", E = 1e5, nu = 0.3')
    (tmp_path / "scene.toml").write_text(text)
    done = mpm_ref("run", tmp_path / "scene.toml", "--out", tmp_path / "run.h5")
    assert (done.exit_code, done.stderr) == (0, "")
