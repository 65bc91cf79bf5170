"""Experiments in several processes leave what they leave one after the other."""

import os

from validation.common import parallel
from validation.common.parallel import experiment_of, run_side_by_side
from validation.common.registry import Experiment, discover
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.targets import Target, Targets


def fall(run):
    for k in run.progress(3, "heights"):
        run.record(f"verification.fall.{k}", float(run.rng.random()), comparator="info")
    run.table("heights", ("h",), [(1.0,)])


def rise(run):
    with run.progress(2, "heights") as bar:
        bar.update(2)
    run.record("verification.rise.error", 1.0)      # a printed number


def breaks(run):
    raise ArithmeticError("no ground")


def dies(run):
    os._exit(3)


def tells(run):
    run.record("verification.tells.id", os.getpid(), comparator="info")


def toy(id):
    function = globals()[id.removeprefix("verification.")]
    return Experiment(id, "A toy", ("quick",), {"quick": 1.0}, function)


def toys(*names):
    return [toy(f"verification.{name}") for name in names]


def numbers(folder, id):
    return [(r.target, r.value, r.comparator, r.note) for r in ProfileResults(folder).records(id)]


def test_results_are_those_of_one_process(tmp_path):
    printed = Target(id="verification.rise.error", value=2.0, unit="1", what="error",
                     paper_ref="Table 1", kind="error", comparator="<=", confidence="exact")
    setting = RunSetting("quick", tmp_path / "one", commit="abc",
                         targets=Targets({printed.id: printed}))
    apart = setting._replace(folder=tmp_path / "two")
    three = toys("fall", "rise", "breaks")
    assert run_all(three, setting) == ["verification.breaks"]
    assert run_side_by_side(three, apart, 2, toy) == ["verification.breaks"]
    for e in three:
        assert numbers(tmp_path / "one", e.id) == numbers(tmp_path / "two", e.id) != []
    assert (tmp_path / "two" / "verification.fall.heights.csv").read_text() == "h\n1.0\n"
    assert {r.workers for r in ProfileResults(tmp_path / "two").records("verification.fall")} == {2}


def test_it_is_another_process_that_runs_them(tmp_path):
    setting = RunSetting("quick", tmp_path, commit="abc")
    assert run_side_by_side(toys("tells"), setting, 2, toy) == []
    (_, pid, *_), = (n for n in numbers(tmp_path, "verification.tells") if n[1] is not None)
    assert pid != os.getpid()


def test_processes_know_every_experiment():
    experiments = discover().experiments
    assert all(experiment_of(id) == experiment for id, experiment in experiments.items())


def test_process_that_dies_is_a_failure(tmp_path, capsys):
    failed = run_side_by_side(toys("dies"), RunSetting("quick", tmp_path), 1, toy)
    assert failed == ["verification.dies"]
    assert "its process ended" in capsys.readouterr().err


def test_processes_are_replaced_after_some_experiments(tmp_path, monkeypatch):
    """Their memory is free again, and the death of one fails only experiments of its pool."""
    monkeypatch.setattr(parallel, "MOST", 1)
    failed = run_side_by_side(toys("dies", "fall"), RunSetting("quick", tmp_path), 1, toy)
    assert failed == ["verification.dies"]
