"""Errors of laws on NCLaw's tasks: the measure, runs that break down, tables, untrained laws."""

from types import SimpleNamespace

import numpy as np
import pytest
from record_verdicts import expected, verdict

from mpm_ref.body import restore_order
from mpm_ref.materials import Fluid, NoFlow
from mpm_ref.materials.learned.response import Correction, Stress
from mpm_ref.scene import build
from mpm_ref.simulate import SORT, simulate
from validation.common import targets
from validation.common.judge import rounded
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.common.weights_needed import Untrained
from validation.nclaw import errors, evaluate, printed_ids, tables, trained_laws
from validation.nclaw.environments import ENVIRONMENTS
from validation.nclaw.evaluate import (
    ComparedError,
    RunBroken,
    body_with_laws,
    compare,
    copy_body,
    positions,
)
from validation.nclaw.initial_laws import untrained
from validation.nclaw.simulators import simulators
from validation.nclaw.tasks import reconstruction


def no_stress(body):
    return body_with_laws(body, Fluid(0.0), NoFlow())


def wild(body):
    return body_with_laws(body, Fluid(1e15), NoFlow())


def water(steps, **changes):
    return with_(reconstruction("water"), steps=steps, **changes)


# the measure

def test_a_law_is_not_off_from_itself():
    assert compare(water(SORT + 6), [copy_body, copy_body]) == [ComparedError(0.0)] * 2


def test_runs_are_those_of_simulate():
    problem = build(water(SORT + 6))
    shown = list(positions(problem, tuple(map(copy_body, problem.bodies))))
    frames = [restore_order(frame.state.bodies[0].particles.x, frame.state.bodies[0].id)
              for frame in simulate(problem)]
    assert len(shown) == len(frames) == 1 + (SORT + 6) // 5
    assert np.array_equal(shown, frames)


def test_the_first_frame_counts(monkeypatch):
    """Errors 0, 1, 4 of frames, of points off along one of two axes by 0, sqrt 2, sqrt 8."""
    off = {"true": (0.0, 0.0, 0.0), "other": (0.0, 2.0**0.5, 8.0**0.5)}
    problem = SimpleNamespace(bodies=(SimpleNamespace(particles=SimpleNamespace(x=np.zeros(4))),))
    monkeypatch.setattr(evaluate, "build", lambda scene: problem)
    monkeypatch.setattr(evaluate, "copy_body", lambda body: "true")
    monkeypatch.setattr(evaluate, "positions", lambda problem, bodies: (
        np.ones((4, 2)) + np.array([d, 0.0]) for d in off[bodies[0]]))
    found, = compare(None, [lambda body: "other"])
    assert found.error == pytest.approx(5.0 / 3.0)


def test_without_stress_the_error_is_the_printed_one_before_training():
    found, = compare(reconstruction("water"), [no_stress])
    low, high = rounded(targets.load()["nclaw.table1.ours-init.water"].value, 2)
    assert low < found.error < high


def test_points_of_several_bodies_stand_one_after_the_other():
    problem = build(water(5))
    body = problem.bodies[0]
    x = next(positions(problem, (copy_body(body), copy_body(body))))
    assert np.array_equal(x, np.tile(restore_order(body.particles.x, body.id), (2, 1)))


# breakdowns

def test_a_run_that_breaks_down_says_so_and_stops_no_other():
    broken, sound = compare(water(100), [wild, no_stress])
    assert broken.error == np.inf
    assert 0 < broken.step < 100
    assert "position" in broken.why
    assert 0.0 < sound.error < 1.0
    assert sound.why == ""


def test_a_run_that_goes_on_stays_in_the_upper_corner():
    found, = compare(water(100), [wild], goes_on=True)
    assert 0 < found.step < 100
    problem, ahead = build(water(100)), build(water(100))
    own_frames, off = positions(ahead, tuple(map(wild, ahead.bodies))), []
    for k, true in enumerate(positions(problem, tuple(map(copy_body, problem.bodies)))):
        place = next(own_frames) if 5 * k < found.step else 0.975
        off.append(np.mean((place - true) ** 2))
    assert found.error == pytest.approx(np.mean(off), rel=1e-12)


def test_a_true_run_may_not_break_down(monkeypatch):
    monkeypatch.setattr(evaluate, "copy_body", wild)
    with pytest.raises(RunBroken, match=r"step \d+: particle \d+ has position"):
        compare(water(100), [no_stress])


# untrained laws

def test_untrained_laws_are_as_many_numbers_as_printed():
    laws = untrained()
    assert sum(W.size for law in laws[:2] for W, _ in law.layers) == 11_008
    assert not any(b.any() for law in laws[:2] for _, b in law.layers)
    assert laws.elastic.kind == Stress()
    assert laws.plastic.kind == Correction()
    assert laws.elastic.layers[0][0][0, :2] == pytest.approx([-0.16193072, -0.21561851], abs=1e-8)


def test_untrained_laws_are_those_that_pytorch_draws():
    pytest.importorskip("torch")
    law = pytest.importorskip("mpm_ref.nclaw.train.neural_laws")
    for seed in (0, 3):
        for theirs, ours in zip(law.neural_laws(seed, Stress(), Correction()), untrained(seed)[:2],
                                strict=True):
            for (W, b), (V, c) in zip(theirs.weights().layers, ours.layers, strict=True):
                assert np.array_equal(W, V)
                assert np.array_equal(b, c)


# tables

@pytest.mark.parametrize(("name", "environment", "method"), [
    ("sand", "sand", "ours"), ("spline-sand", "sand", "spline"), ("sand-spline", "sand", "spline"),
    ("plasticine-no-rotation", "plasticine", "no-rotation"), ("sys-id-water", "water", "sys-id")])
def test_methods_are_told_by_the_names_of_nets(name, environment, method):
    assert tables.method_of(name, trained_laws.LawNet(environment)) == method


@pytest.mark.parametrize(("value", "low", "high"), [
    (0.11, 0.105, 0.115), (0.048, 0.0475, 0.0485), (0.3, 0.295, 0.305), (1.1, 1.05, 1.15)])
def test_printed_errors_have_two_digits(value, low, high):
    assert rounded(value, 2) == pytest.approx((low, high))


@pytest.mark.parametrize(("method", "task", "id"), [
    ("ours", "reconstruction", "nclaw.table1.ours.jello"),
    ("spline", "reconstruction", "nclaw.table1.spline.jello.repaired"),
    ("spline-released", "reconstruction", "nclaw.table1.spline.jello"),
    ("neural-released", "time", "nclaw.table1.neural.jello.time"),
    ("admissible", "reconstruction", "nclaw.table1.ours.jello.admissible"),
    ("gnn", "time", "nclaw.table1.gnn.jello.time.narrow"),
    ("seed-1", "time", "nclaw.table1.seed-1.jello.time")])
def test_the_papers_ids_belong_to_the_papers_methods(method, task, id):
    """Printed splines and stretches are those of the release, with its faults."""
    assert printed_ids.error_id("nclaw.table1", method, "jelly", task) == id
    other = printed_ids.error_id("nclaw.table1", method, "jelly", task, ("stand-in",))
    assert other == f"{id}.stand-in"
    assert printed_ids.is_printed(method) is (method != "seed-1")


@pytest.fixture
def made_up(monkeypatch):
    """Errors of runs without running: 1, 2, .. in their order; which nets have weights."""
    count, there = iter(range(1, 99)), set(ENVIRONMENTS)

    def trained(name):
        if name not in there:
            raise Untrained(f"no weights {name}.npz: train {name}")
        return name

    def compared(scene, laws, goes_on):
        return [ComparedError(float(next(count))) for _ in laws]

    known = {name: trained_laws.LawNet(name) for name in ENVIRONMENTS}
    for name, value in {"compare": compared, "body_maker": lambda laws: laws}.items():
        monkeypatch.setattr(errors, name, value)
    for name, value in {"trained": trained, "nets": lambda: known, "RIVALS": {}}.items():
        monkeypatch.setattr(tables, name, value)
    return there


def recorded(folder, experiment, profile="standard"):
    setting = RunSetting(profile, folder, targets=targets.load())
    failed = run_all([experiment.experiment], setting)
    return failed, {r.target: r for r in ProfileResults(folder).records(experiment.experiment.id)}


def test_table_1_has_the_mean_and_the_sample_deviation_of_four(tmp_path, made_up):
    failed, found = recorded(tmp_path, tables.table1)
    assert failed == []
    assert found["nclaw.table1.ours.jello"].value == 1.0
    assert expected(found["nclaw.table1.ours.jello"]) == 2.4e-4
    assert verdict(found["nclaw.table1.ours.jello"]) == "miss"
    assert found["nclaw.table1.ours.overall_mean"].value == 2.5
    assert found["nclaw.table1.ours.overall_std"].value == pytest.approx(np.sqrt(5.0 / 3.0))


def test_table_2_counts_each_velocity(tmp_path, made_up):
    _, found = recorded(tmp_path, tables.table2)
    assert found["nclaw.table2.ours.jello.time"].value == 1.0
    assert found["nclaw.table2.ours.jello.velocity"].value == 3.0       # of 2, 3, 4
    other_body = found["nclaw.table2.ours.water.geometry.stand-in"]
    assert (other_body.value, verdict(other_body)) == (20.0, "miss")
    assert "a stand-in for spot" in other_body.scale
    assert found["nclaw.table2.ours.overall_mean"].value == np.mean(range(1, 21))
    assert found["nclaw.table2.ours.overall_std"].value == pytest.approx(
        np.std(range(1, 21), ddof=1))
    assert "20 runs" in found["nclaw.table2.ours.overall_mean"].scale


def test_variants_of_ours_are_in_large_bodies_at_the_papers_profile_alone():
    runs = [SimpleNamespace(profile=profile) for profile in ("standard", "paper")]
    assert [[errors.is_compared(run, method, task) for method in ("ours", "spline", "seed-1")]
            for run in runs for task in ("time", "geometry")] == [
        [True, True, True], [True, True, False], [True, True, True], [True, True, True]]


@pytest.fixture
def beside(made_up, monkeypatch):
    """Of two environments ours and another method, as Table 7 has them."""
    known = {name: trained_laws.LawNet(name.split("-")[0]) for name in
             ("plasticine", "plasticine-gnn", "water", "water-velocity")}
    known["plasticine-gnn"] = simulators()["plasticine-gnn"]
    made_up.update(known)
    monkeypatch.setattr(tables, "nets", lambda: known)


def test_table_7_has_what_tables_1_and_2_have_not(tmp_path, beside):
    """The others of its numbers, and all of Table 4, repeat those tables and are not recorded."""
    found = recorded(tmp_path, tables.table1)[1] | recorded(tmp_path, tables.table2)[1]
    mine = {target: one for target, one in found.items()
            if target.startswith(("nclaw.table4", "nclaw.table7"))}
    assert mine.keys() == {f"nclaw.table7.{task}.with" for task in
                           ("reconstruction", "time", "velocity")} | {
        "nclaw.table7.geometry.with.stand-in"}
    for task in ("time", "velocity", "geometry"):
        word = ".stand-in" * (task == "geometry")
        one = mine[f"nclaw.table7.{task}.with{word}"]
        assert (one.value, one.scale) == (found[f"nclaw.table2.velocity.water.{task}"].value,
                                          found[f"nclaw.table2.velocity.water.{task}"].scale)
        assert verdict(one) == "miss"
    notes = [r.note for r in ProfileResults(tmp_path).records("nclaw.table1")]
    assert sum("another paper's" in note for note in notes) == 1


def test_the_size_of_a_graph_network_is_told_and_its_id_says_that_it_is_another(tmp_path, beside):
    _, found = recorded(tmp_path, tables.table2)
    assert "a graph network 32 wide" in found["nclaw.table2.gnn.plasticine.time.narrow"].note
    assert found["nclaw.table2.ours.plasticine.time"].note == ""
    assert not [target for target in found if target.startswith("nclaw.table2.gnn")
                and "geometry" in target]


def test_missing_weights_are_told(tmp_path, made_up):
    made_up.remove("sand")
    failed, found = recorded(tmp_path, tables.table1)
    assert failed == []
    waiting = found["nclaw.table1.untrained"]
    assert (waiting.value, waiting.note) == (1, "no weights sand.npz: train sand")
    assert found["nclaw.table1.ours.water"].value == 3.0
    assert "nclaw.table1.ours.overall_mean" not in found


def test_breakdowns_are_recorded_as_misses(tmp_path, made_up, monkeypatch):
    monkeypatch.setattr(errors, "compare", lambda *args: [
        ComparedError(np.inf, 7, "particle 3 is lost")])
    _, found = recorded(tmp_path, tables.table1)
    one = found["nclaw.table1.ours.jello"]
    assert (one.value, verdict(one)) == (None, "miss")
    assert "step 7: particle 3 is lost" in one.note


def test_before_training_errors_must_be_the_printed_digits(tmp_path, made_up, monkeypatch):
    printed = targets.load()
    values = iter(printed[f"nclaw.table1.ours-init.{printed_ids.PRINTED[name]}"].value + shift
                  for name, shift in zip(ENVIRONMENTS, (0.004, 0.0004, 0.0006, -0.0004),
                                         strict=True))
    monkeypatch.setattr(errors, "scenes", lambda task, name: [reconstruction(name)]
                        if task == "reconstruction" else [])
    monkeypatch.setattr(errors, "compare", lambda *args: [ComparedError(next(values))])
    _, found = recorded(tmp_path, tables.init)
    verdicts = [verdict(found[f"nclaw.table1.ours-init.{name}"])
                for name in printed_ids.PRINTED.values()]
    assert verdicts == ["pass", "pass", "miss", "pass"]


def test_quick_runs_are_short_and_partial(tmp_path, made_up, monkeypatch):
    steps = []
    monkeypatch.setattr(errors, "compare", lambda scene, laws, goes_on: [
        ComparedError(9.0 + (steps.append(scene.steps) or 0.0)) for _ in laws])
    _, found = recorded(tmp_path, tables.table1, "quick")
    assert set(steps) == {errors.SHORT}
    assert "nclaw.table1.ours.jello" not in found
    assert "only the first 100 steps" in found["nclaw.table1.ours.jello.partial"].scale
