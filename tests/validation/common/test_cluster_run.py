"""Experiments on the workers of a dask cluster leave what they leave one after the other."""

import pytest
from toy_experiments import toy, toys
from typer.testing import CliRunner

from validation.__main__ import app
from validation.common.cluster_run import run_on_cluster
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all

pytest.importorskip("distributed")


def numbers(folder, id):
    return [(r.target, r.value, r.comparator, r.note) for r in ProfileResults(folder).records(id)]


def test_results_are_those_of_one_process(tmp_path, capsys, monkeypatch):
    setting = RunSetting("quick", tmp_path / "one", commit="abc")
    experiments = toys("fall", "breaks")
    assert run_all(experiments, setting) == ["verification.breaks"]
    experiments.append(toys("dies")[0])
    monkeypatch.chdir(tmp_path)
    there = setting._replace(folder=(tmp_path / "two").relative_to(tmp_path))
    failed = run_on_cluster(experiments, there, "local:2", toy)
    assert sorted(failed) == ["verification.breaks", "verification.dies"]
    for id in ("verification.fall", "verification.breaks"):
        assert numbers(tmp_path / "one", id) == numbers(tmp_path / "two", id) != []
    assert {r.workers for r in ProfileResults(tmp_path / "two").records("verification.fall")} == {2}
    message = capsys.readouterr().err
    assert "verification.dies: FAILED: it did not end" in message
    assert "its workers were killed" in message


def test_bad_scheduler_is_refused(tmp_path):
    done = CliRunner().invoke(app, ["run", "verification.bowl", "--results", str(tmp_path),
                                    "--scheduler", "nowhere"])
    assert done.exit_code == 2
    assert "scheduler 'nowhere': expected local:N" in done.stderr
