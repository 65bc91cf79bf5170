"""Experiments that are not of today's source run again: which, in what order, and what is kept."""

import subprocess
from itertools import chain, repeat
from types import SimpleNamespace

import msgspec
import pytest
from typer.testing import CliRunner

from validation import __main__ as cli
from validation.common import renew
from validation.common.record import Measurement, Origin, write_records
from validation.common.registry import Experiment
from validation.common.renew import (
    DueExperiment,
    affordable,
    commit_records,
    drop_marker,
    due,
    renew_all,
    require_clean,
    wait_for_quiet,
)
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import RunSetting
from validation.common.source_digest import source_digest
from validation.common.standing import MarkerFile
from validation.common.targets import Targets
from validation.hot.table3 import table3

PROGRESS = SimpleNamespace(say=print, ended=lambda *_: None)
STALE = """# Why.

[[marker]]
profile = "quick"
ids = ["toy.good", "toy.two-parts"]
reason = "of late"

[[marker]]
profile = "standard"
ids = ["toy.good"]
reason = "the \\"same\\" bits"
"""


def good(run):
    run.record("toy.good.error", 0.5, comparator="<=", bound=1.0)


def bad(run):
    raise RuntimeError(f"no {run.profile} run")


def toy(id, function=good, seconds=1.0):
    function.__module__ = table3.__module__     # a module of the repository has a digest
    return Experiment(id, "A toy", ("quick",), {"quick": seconds}, function)


def toys(id):
    """Return the toy of an id, in another process too."""
    return toy(id, bad if id == "toy.bad" else good)


def store(folder, id, digest=None, **fields):
    """Write the record of an experiment, of today's source unless a digest is given."""
    fields = {"unit": "1", "cpu_seconds": 1.0, **fields}
    write_records(folder / f"{id}.json", [Measurement(
        target=f"{id}.error", value=0.5, scale="", seconds=1.0, seed=0, command="", commit="",
        date="", cores=1, comparator="<=", bound=1.0,
        origin=Origin(digest=digest or source_digest(table3.__module__)), **fields)])


def due_ids(folder, experiments, timed=False):
    found = due(ProfileResults(folder), experiments, "quick", Targets({}), timed=timed)
    return [(one.experiment.id, one.seconds) for one in found]


# Which, and in what order

def test_those_are_due_that_have_no_record_of_today_the_cheapest_first(tmp_path):
    store(tmp_path, "toy.current")
    store(tmp_path, "toy.dear", "0" * 16, cpu_seconds=7.0)
    store(tmp_path, "toy.cheap", "0" * 16, cpu_seconds=2.0)
    store(tmp_path, "toy.times", "0" * 16, unit="x")
    experiments = [toy(f"toy.{name}", seconds=3.0)
                   for name in ("current", "dear", "cheap", "new", "times")]
    assert due_ids(tmp_path, experiments) == [("toy.cheap", 2.0), ("toy.new", 3.0),
                                              ("toy.dear", 7.0)]
    assert due_ids(tmp_path, experiments, timed=True) == [("toy.times", 1.0)]


def test_an_experiment_of_another_profile_is_not_due(tmp_path):
    assert due_ids(tmp_path, [toy("toy.new")._replace(profiles=("paper",))]) == []


@pytest.mark.parametrize(("seconds", "count"), [(None, 3), (0.0, 0), (3.0, 2), (5.9, 2), (6.0, 3)])
def test_the_cheapest_are_run_that_fit_into_the_time(seconds, count):
    entries = [DueExperiment(None, k) for k in (1.0, 2.0, 3.0)]
    assert affordable(entries, seconds) == entries[:count]


# The runs

@pytest.fixture
def setting(tmp_path):
    (tmp_path / "stale.toml").write_text(STALE)
    return RunSetting("quick", tmp_path / "quick", commit="abc")


def test_records_are_kept_one_by_one_and_committed_but_for_those_that_raised(setting, monkeypatch):
    monkeypatch.setattr(renew, "BETWEEN", 0.0)
    kept = []
    failed = renew_all([toys(id) for id in ("toy.good", "toy.bad", "toy.two-parts")], setting,
                       PROGRESS, timed=False, commit=kept.append, find=toys)
    assert (failed, kept) == (["toy.bad"], [["toy.good"], ["toy.two-parts"]])
    assert ProfileResults(setting.folder).value("toy.good", "toy.good.error") == 0.5
    markers = msgspec.toml.decode((setting.folder.parent / "stale.toml").read_bytes(),
                                  type=MarkerFile).marker
    assert [(one.profile, one.ids) for one in markers] == [("standard", ["toy.good"])]


def test_an_interrupted_renewal_commits_what_it_has(setting, monkeypatch):
    answers = chain([[]], repeat(KeyboardInterrupt()))

    def run(*_):
        answer = next(answers)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    monkeypatch.setattr(renew, "run_in_pool", run)
    kept = []
    with pytest.raises(KeyboardInterrupt):
        renew_all([toys("toy.good"), toys("toy.bad")], setting, PROGRESS, timed=False,
                  commit=kept.append)
    assert kept == [["toy.good"]]


def test_times_wait_until_other_processes_are_idle(monkeypatch):
    busy, said = iter((1.4, 0.6, 0.05, 9.0)), []
    monkeypatch.setattr(renew, "busy_cores", lambda before, after: next(busy))
    wait_for_quiet(said.append, window=0.0)
    assert next(busy) == 9.0
    assert said == ["other processes keep 1.4 cores busy: waiting until they end"]


# Markers

def test_a_marker_loses_an_id_and_what_is_left_stays_as_it_is(tmp_path):
    file = tmp_path / "stale.toml"
    file.write_text(STALE)
    drop_marker(file, "quick", "toy.unknown")
    assert file.read_text() == STALE
    drop_marker(file, "quick", "toy.good")
    assert file.read_text() == STALE.replace('"toy.good", "toy', '"toy')
    drop_marker(file, "quick", "toy.two-parts")
    assert file.read_text() == "# Why.\n" + STALE[STALE.index("\n[[marker]]\nprofile = \"sta"):]
    drop_marker(tmp_path / "none.toml", "quick", "toy.good")


def test_the_markers_of_the_project_are_written_as_they_are(tmp_path):
    file = tmp_path / "stale.toml"
    content = (RESULTS / "stale.toml").read_bytes()
    file.write_bytes(content)
    drop_marker(file, "quick", "toy.unknown")
    assert (msgspec.toml.decode(file.read_bytes(), type=MarkerFile)
            == msgspec.toml.decode(content, type=MarkerFile))


# Commits

def git(folder, *words):
    return subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=folder,
                          check=True, capture_output=True, text=True).stdout


def test_a_commit_has_records_and_markers_and_nothing_else(setting, monkeypatch):
    root = setting.folder.parent
    for name in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{name}_NAME", "a")
        monkeypatch.setenv(f"GIT_{name}_EMAIL", "a@b")
    git(root, "init", "--quiet")
    store(setting.folder, "toy.good")
    store(setting.folder, "toy.bad")
    (setting.folder / "toy.good.curve.csv").write_text("x\n1\n")
    commit_records(root, setting, ["toy.good"])
    assert git(root, "show", "--name-only", "--format=%s", "HEAD").split("\n") == [
        "Records of toy.good", "", "quick/toy.good.curve.csv", "quick/toy.good.json", "stale.toml",
        ""]
    (setting.folder / "toy.good.curve.csv").unlink()
    commit_records(root, setting, ["toy.bad", "toy.good"])
    assert git(root, "show", "--name-status", "--format=%s", "HEAD").split() == [
        "Records", "of", "2", "experiments", "A", "quick/toy.bad.json", "D",
        "quick/toy.good.curve.csv"]


@pytest.mark.parametrize("source", ["unknown", "abc+changes"])
def test_records_of_no_commit_replace_none(source, monkeypatch, tmp_path):
    with pytest.raises(ValueError, match=r"the source is .*: records that replace published ones"):
        require_clean(source)
    monkeypatch.setattr(cli, "commit", lambda root: source)
    answer = CliRunner().invoke(cli.app, ["renew", "--results", str(tmp_path)])
    assert answer.exit_code == 2
    assert f"the source is {source}" in answer.output
