"""Experiments that are not of today's source run again: which, in what order, and what is kept."""

import subprocess
from types import SimpleNamespace

import msgspec
import pytest
from typer.testing import CliRunner

from validation import __main__ as cli
from validation.common import renew
from validation.common.record import Measurement, Origin, write_records
from validation.common.registry import Catalogue, Experiment
from validation.common.renew import (
    DueExperiment,
    affordable,
    commit_records,
    drop_marker,
    due,
    marker_text,
    renew_all,
    require_clean,
    wait_for_quiet,
)
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import RunSetting
from validation.common.source_digest import source_digest
from validation.common.standing import Marker, MarkerFile
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


def store(folder, id, digest=None, others=None, **fields):
    """Write the record of an experiment, of today's source unless a digest is given."""
    fields = {"unit": "1", "cpu_seconds": 1.0, "comparator": "<=", "bound": 1.0, **fields}
    write_records(folder / f"{id}.json", [Measurement(
        target=f"{id}.error", value=0.5, scale="", seconds=1.0, seed=0, command="", commit="",
        date="", cores=1,
        origin=Origin(digest=digest or source_digest(table3.__module__), others=others),
        **fields)])


def due_ids(folder, experiments, timed=False):
    found = due(ProfileResults(folder), experiments, "quick", Targets({}), timed=timed)
    return [(one.experiment.id, one.seconds) for one in found]


# Which, and in what order

def test_those_are_due_that_are_not_of_today_or_raised_the_cheapest_first(tmp_path):
    store(tmp_path, "toy.current")
    store(tmp_path, "toy.dear", "0" * 16, cpu_seconds=7.0)
    store(tmp_path, "toy.cheap", "0" * 16, cpu_seconds=2.0)
    store(tmp_path, "toy.raised", cpu_seconds=3.0, comparator="runs", bound=None)
    assert due_ids(tmp_path, [toy(f"toy.{name}") for name in ("current", "dear", "cheap", "raised")
                              ]) == [("toy.cheap", 2.0), ("toy.raised", 3.0), ("toy.dear", 7.0)]


def test_judged_times_and_what_has_no_record_wait_for_a_quiet_machine(tmp_path):
    store(tmp_path, "toy.numbers", "0" * 16)
    store(tmp_path, "toy.times", "0" * 16, unit="x")
    store(tmp_path, "toy.quiet", unit="x", others=0.0)
    store(tmp_path, "toy.disturbed", unit="x", others=0.9)
    experiments = [toy(f"toy.{name}", seconds=3.0)
                   for name in ("numbers", "times", "quiet", "disturbed", "new")]
    assert due_ids(tmp_path, experiments) == [("toy.numbers", 1.0)]
    assert due_ids(tmp_path, experiments, timed=True) == [
        ("toy.disturbed", 1.0), ("toy.times", 1.0), ("toy.new", 3.0)]


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


@pytest.fixture(autouse=True)
def toys_alone(monkeypatch):
    """Let processes find toys."""
    monkeypatch.setattr(renew, "experiment_of", toys)


def renewed(experiments, setting, timed=False, sources=("abc",) * 5):
    """Return the ids of those that failed, and of those whose records were to be committed."""
    kept, sources = [], iter(sources)
    return renew_all(experiments, setting, PROGRESS, timed=timed, source=lambda: next(sources),
                     commit=kept.append), kept


def test_records_are_kept_and_committed_but_for_those_that_raised(setting):
    store(setting.folder, "toy.bad")
    (setting.folder / "toy.bad.curve.csv").write_text("x\n1\n")
    before = renew.stored_files(setting.folder, "toy.bad")
    assert renewed([toys("toy.good"), toys("toy.bad")], setting) == (["toy.bad"], ["toy.good"])
    assert ProfileResults(setting.folder).value("toy.good", "toy.good.error") == 0.5
    assert renew.stored_files(setting.folder, "toy.bad") == before
    markers = msgspec.toml.decode((setting.folder.parent / "stale.toml").read_bytes(),
                                  type=MarkerFile).marker
    assert [(one.profile, one.ids) for one in markers] == [
        ("quick", ["toy.two-parts"]), ("standard", ["toy.good"])]


def test_an_interrupted_run_leaves_the_old_records(setting, monkeypatch):
    def run(*_):
        store(setting.folder, "toy.good", "1" * 16)
        (setting.folder / "toy.good.curve.csv").touch()
        raise KeyboardInterrupt

    store(setting.folder, "toy.good")
    before = renew.stored_files(setting.folder, "toy.good")
    monkeypatch.setattr(renew, "run_in_pool", run)
    with pytest.raises(KeyboardInterrupt):
        renewed([toys("toy.good")], setting)
    assert renew.stored_files(setting.folder, "toy.good") == before


def test_several_workers_keep_each_record(setting):
    several = setting._replace(workers=2)
    assert sorted(renewed([toys("toy.good"), toys("toy.two-parts")], several)[1]) == [
        "toy.good", "toy.two-parts"]
    assert ProfileResults(setting.folder).records("toy.good")[0].workers == 2


@pytest.mark.parametrize(("sources", "runs"), [(["def"], 0), (["abc", "def"], 1)])
def test_a_source_that_changes_ends_the_renewal(setting, monkeypatch, sources, runs):
    """Before a run, or during it, whose records are then not kept."""
    calls = []

    def run(*_):
        calls.append(store(setting.folder, "toy.good", "1" * 16))
        return []

    store(setting.folder, "toy.good")
    before = renew.stored_files(setting.folder, "toy.good")
    monkeypatch.setattr(renew, "run_in_pool", run)
    with pytest.raises(ValueError, match="the source changed from abc to def meanwhile"):
        renewed([toys("toy.good")], setting, sources=sources)
    assert len(calls) == runs
    assert renew.stored_files(setting.folder, "toy.good") == before
    assert (setting.folder.parent / "stale.toml").read_text() == STALE


@pytest.mark.parametrize("timed", [True, False])
def test_experiments_with_times_alone_wait(setting, monkeypatch, timed):
    waits = []
    monkeypatch.setattr(renew, "run_in_pool", lambda *_: [])
    monkeypatch.setattr(renew, "wait_for_quiet", waits.append)
    assert renewed([toys("toy.good"), toys("toy.new")], setting, timed) == (
        [], ["toy.good", "toy.new"])
    assert len(waits) == 2 * timed


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


def test_the_other_markers_of_the_project_are_written_as_they_are(tmp_path):
    file = tmp_path / "stale.toml"
    content = (RESULTS / "stale.toml").read_text()
    file.write_text(content + "\n" + marker_text(Marker("quick", ["toy.good"], "of late")))
    drop_marker(file, "quick", "toy.good")
    assert "toy.good" not in file.read_text()
    assert (msgspec.toml.decode(file.read_bytes(), type=MarkerFile)
            == msgspec.toml.decode(content, type=MarkerFile))


def test_ids_with_hyphens_stay_whole_where_lines_are_broken(tmp_path):
    ids = [f"toy.{'a' * k}-runs" for k in range(40)]
    file = tmp_path / "stale.toml"
    file.write_text(marker_text(Marker("quick", [*ids, "toy.good"], "of late")))
    drop_marker(file, "quick", "toy.good")
    assert msgspec.toml.decode(file.read_bytes(), type=MarkerFile).marker == [
        Marker("quick", ids, "of late")]
    assert max(map(len, file.read_text().splitlines())) <= 100


# Commits

def git(folder, *words):
    return subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=folder,
                          check=True, capture_output=True, text=True).stdout


def test_a_commit_has_the_files_of_an_experiment_and_markers_and_nothing_else(setting, monkeypatch):
    root = setting.folder.parent
    for name in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{name}_NAME", "a")
        monkeypatch.setenv(f"GIT_{name}_EMAIL", "a@b")
    git(root, "init", "--quiet")
    store(setting.folder, "toy.good")
    store(setting.folder, "toy.bad")
    (setting.folder / "bodies").mkdir()
    (setting.folder / "bodies" / "toy.good.npz").touch()
    (setting.folder / "toy.good.curve.csv").write_text("x\n1\n")
    (root / "work.py").touch()
    git(root, "add", "work.py")
    commit_records(root, setting, "toy.good")
    assert git(root, "show", "--name-only", "--format=%s", "HEAD").split("\n") == [
        "Record of toy.good, quick", "", "quick/bodies/toy.good.npz", "quick/toy.good.curve.csv",
        "quick/toy.good.json", "stale.toml", ""]
    (setting.folder / "toy.good.curve.csv").unlink()
    commit_records(root, setting, "toy.good")
    assert git(root, "show", "--name-status", "--format=", "HEAD").split() == [
        "D", "quick/toy.good.curve.csv"]


@pytest.mark.parametrize("source", ["unknown", "abc+changes"])
def test_records_of_no_commit_replace_none(source, monkeypatch):
    with pytest.raises(ValueError, match=r"the source is .*: records that replace published ones"):
        require_clean(source)
    monkeypatch.setattr(cli, "commit", lambda root: source)
    answer = CliRunner().invoke(cli.app, ["renew"])
    assert answer.exit_code == 2
    assert f"the source is {source}" in answer.output


def test_the_command_runs_what_is_due_and_says_how_much(setting, monkeypatch):
    calls = []

    def run(experiments, setting, progress, **rest):
        calls.append(([one.id for one in experiments], setting.profile, rest["timed"]))
        return ["toy.dear"]

    store(setting.folder, "toy.cheap", "0" * 16, cpu_seconds=1800.0)
    store(setting.folder, "toy.dear", "0" * 16, cpu_seconds=3600.0)
    store(setting.folder, "toy.times", "0" * 16, unit="x", cpu_seconds=36.0)
    monkeypatch.setattr(cli, "discover", lambda: Catalogue(
        {id: toys(id) for id in ("toy.cheap", "toy.dear", "toy.times")}, {}))
    monkeypatch.setattr(cli, "commit", lambda root: "abc")
    monkeypatch.setattr(cli, "renew_all", run)
    monkeypatch.setattr(cli, "RESULTS", setting.folder.parent)
    words = ["renew", "--profile", "quick"]
    answer = CliRunner().invoke(cli.app, [*words, "--hours", "0.6"])
    assert (answer.exit_code, calls.pop()) == (1, (["toy.cheap"], "quick", False))
    assert "1 of 2 experiments that are due, 0.50 h of CPU time as recorded" in answer.output
    assert "failed: toy.dear; its old records are left" in answer.output
    assert CliRunner().invoke(cli.app, [*words, "--times", "--workers", "2"]).exit_code == 2
    CliRunner().invoke(cli.app, [*words, "toy.times", "--times"])
    assert calls.pop() == (["toy.times"], "quick", True)
    CliRunner().invoke(cli.app, words)
    assert calls.pop() == (["toy.cheap", "toy.dear"], "quick", False)
