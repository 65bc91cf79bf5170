"""Errors of laws on NCLaw's tasks: the measure, runs that break down, tables, untrained laws."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.body import restore_order
from mpm_ref.materials import Fluid, NoFlow
from mpm_ref.materials.learned.response import Correction, Stress
from mpm_ref.scene import build
from mpm_ref.simulate import SORT, simulate
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.common.weights_needed import Untrained
from validation.nclaw import errors, evaluate, tables, trained_laws
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
    low, high = errors.rounded_to(targets.load()["nclaw.table1.ours-init.water"].value)
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
    assert errors.rounded_to(value) == pytest.approx((low, high))


@pytest.mark.parametrize(("target", "rule"), [
    ("nclaw.table1.ours.jello", {}), ("nclaw.table1.spline.jello", {"comparator": "info"}),
    ("nclaw.table1.spline-released.jello", {"comparator": "~", "paper": 0.24}),
    ("nclaw.table2.neural-released.sand.time", {"comparator": "~", "paper": 0.047}),
    ("nclaw.table1.admissible.jello", {"comparator": "info"}),
    ("nclaw.table2.spline-released.unheard", {"comparator": "info"})])
def test_printed_numbers_are_those_of_the_released_readings(target, rule):
    assert errors.as_printed(target) == rule


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
    for name, value in {"trained": trained, "nets": lambda: known}.items():
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
    assert found["nclaw.table1.ours.jello"].paper == 2.4e-4
    assert found["nclaw.table1.ours.jello"].verdict == "miss"
    assert found["nclaw.table1.ours.overall_mean"].value == 2.5
    assert found["nclaw.table1.ours.overall_std"].value == pytest.approx(np.sqrt(5.0 / 3.0))


def test_table_2_counts_each_velocity(tmp_path, made_up):
    _, found = recorded(tmp_path, tables.table2)
    assert found["nclaw.table2.ours.jello.time"].value == 1.0
    assert found["nclaw.table2.ours.jello.velocity"].value == 3.0       # of 2, 3, 4
    assert found["nclaw.table2.ours.water.geometry"].value == 20.0
    assert found["nclaw.table2.ours.water.geometry"].verdict == "info"
    assert "a stand-in for spot" in found["nclaw.table2.ours.water.geometry"].scale
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
    """Of two environments ours and another method, as Tables 4 and 7 have them."""
    known = {name: trained_laws.LawNet(name.split("-")[0]) for name in
             ("plasticine", "plasticine-gnn", "water", "water-velocity")}
    known["plasticine-gnn"] = simulators()["plasticine-gnn"]
    made_up.update(known)
    monkeypatch.setattr(tables, "nets", lambda: known)


def test_tables_4_and_7_have_rows_of_table_1(tmp_path, beside):
    _, found = recorded(tmp_path, tables.table1)
    assert {target: (one.value, one.paper) for target, one in found.items()
            if target.startswith(("nclaw.table4", "nclaw.table7"))} == {
        "nclaw.table4.reconstruction.ours": (1.0, 6.5e-5),
        "nclaw.table4.reconstruction.gnn": (2.0, 8.7e-3),
        "nclaw.table7.reconstruction.without": (3.0, 2.0e-5),
        "nclaw.table7.reconstruction.with": (4.0, 1.3e-5)}
    assert found["nclaw.table7.reconstruction.with"].verdict == "miss"
    records = ProfileResults(tmp_path).records("nclaw.table1")
    assert sum("another paper's" in r.note for r in records) == 1


def test_tables_4_and_7_have_rows_of_table_2(tmp_path, beside):
    """Each run gives one row: 1, 2 in time, 3 to 8 in three velocities, 9 in geometry (of ours
    alone), ..
    """
    _, found = recorded(tmp_path, tables.table2)
    for table, name, first, columns in (
            ("nclaw.table4", "plasticine", 1, {"ours": "ours", "gnn": "gnn"}),
            ("nclaw.table7", "water", 10, {"without": "ours", "with": "velocity"})):
        for k, (column, method) in enumerate(columns.items()):
            for task, value in (("time", 0), ("velocity", 4), ("geometry", 8)):
                if (task, method) == ("geometry", "gnn"):
                    continue
                one, same = (found[target] for target in (
                    f"{table}.{task}.{column}", f"nclaw.table2.{method}.{name}.{task}"))
                assert one.value == same.value == first + k + value
                assert one.scale == same.scale
        assert found[f"{table}.geometry.{next(iter(columns))}"].verdict == "info"
        assert found[f"{table}.time.{column}"].verdict == "miss"
        assert "mean of 3 velocities" in found[f"{table}.velocity.{column}"].scale
    records = ProfileResults(tmp_path).records("nclaw.table2")
    assert not any("another paper's" in r.note for r in records)


def test_table_4_says_the_size_of_its_graph_network(tmp_path, beside, monkeypatch):
    monkeypatch.setattr(errors, "can_run", lambda laws, task: "gnn" not in laws or task
                        != "geometry")
    _, found = recorded(tmp_path, tables.table2)
    assert "a graph network 32 wide" in found["nclaw.table4.time.gnn"].note
    assert found["nclaw.table4.time.ours"].note == ""
    assert "nclaw.table4.geometry.gnn" not in found


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
    assert (one.value, one.verdict) == (None, "miss")
    assert "step 7: particle 3 is lost" in one.note


def test_before_training_errors_must_be_the_printed_digits(tmp_path, made_up, monkeypatch):
    printed = targets.load()
    values = iter(printed[f"nclaw.table1.ours-init.{errors.PRINTED[name]}"].value + shift
                  for name, shift in zip(ENVIRONMENTS, (0.004, 0.0004, 0.0006, -0.0004),
                                         strict=True))
    monkeypatch.setattr(errors, "scenes", lambda task, name: [reconstruction(name)]
                        if task == "reconstruction" else [])
    monkeypatch.setattr(errors, "compare", lambda *args: [ComparedError(next(values))])
    _, found = recorded(tmp_path, tables.init)
    verdicts = [found[f"nclaw.table1.ours-init.{name}"].verdict for name in errors.PRINTED.values()]
    assert verdicts == ["pass", "pass", "miss", "pass"]
    assert found["nclaw.table1.ours-init.jello"].bound == pytest.approx((0.105, 0.115))


def test_quick_runs_are_short_and_not_judged(tmp_path, made_up, monkeypatch):
    steps = []
    monkeypatch.setattr(errors, "compare", lambda scene, laws, goes_on: [
        ComparedError(9.0 + (steps.append(scene.steps) or 0.0)) for _ in laws])
    _, found = recorded(tmp_path, tables.table1, "quick")
    assert set(steps) == {errors.SHORT}
    assert found["nclaw.table1.ours.jello"].verdict == "info"
    assert "only the first 100 steps" in found["nclaw.table1.ours.jello"].scale
