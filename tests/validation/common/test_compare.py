"""Two sets of records: verdicts that changed, and numbers that moved."""

import csv
import subprocess
from math import inf

import msgspec
import pytest
from typer.testing import CliRunner

from validation.__main__ import app
from validation.common import compare, targets
from validation.common.compare import changes, changes_text, kind_of, stored_results
from validation.common.record import Measurement, write_records
from validation.common.results import ProfileResults

BASE = Measurement(target="a.error", value=0.01, unit="%", scale="", seconds=1.0, seed=0,
                   command="", commit="aaa", date="", cores=1, comparator="<=", bound=0.02)


def record(target, value, **fields):
    """A record with a bound of 0.02."""
    return msgspec.structs.replace(BASE, target=target, value=value, **fields)


@pytest.fixture
def sets(tmp_path):
    """Write {experiment: records} of two sets, and return their folders."""
    def write(old, new):
        folders = tmp_path / "old", tmp_path / "new"
        for folder, records in zip(folders, (old, new), strict=True):
            for experiment, own in records.items():
                write_records(folder / "standard" / f"{experiment}.json", own)
        return folders
    return write


def found(folders):
    """{target: `ChangedRecord`} of two folders, in their order."""
    sets = [ProfileResults(folder / "standard") for folder in folders]
    return {one.target: one for one in changes(*sets, targets.load())}


def test_changes_have_their_kinds_in_order_and_what_stayed_is_left_out(sets):
    old = {"a": [record("a.same", 0.01), record("a.worse", 0.01), record("a.cured", 0.5),
                 record("a.shifted", 0.01), record("a.lost", 0.01),
                 record("a.word", None, comparator="remark", unit="")]}
    new = {"a": [record("a.same", 0.01 * (1 + 1e-7), commit="bbb"),
                 record("a.worse", 0.03, commit="bbb"), record("a.cured", 0.01),
                 record("a.shifted", 0.011), record("a.word", None, comparator="remark", unit="")],
           "b": [record("b.new", 0.01)]}
    changed = found(sets(old, new))
    assert [(name, one.kind) for name, one in changed.items()] == [
        ("a.worse", "worse"), ("a.cured", "improved"), ("a.lost", "lost"), ("b.new", "new"),
        ("a.shifted", "moved")]
    worse = changed["a.worse"]
    assert (worse.values, worse.verdicts, worse.commits) == (
        (0.01, 0.03), ("pass", "miss"), ("aaa", "bbb"))
    assert worse.relative == pytest.approx(2 / 3)
    assert changed["a.lost"].values == (0.01, None)
    assert changed["a.lost"].relative == inf
    assert worse.sentence == "a.worse: 0.01 -> 0.03 (pass -> miss; aaa..bbb)"


def test_the_largest_changes_stand_first(sets):
    old = {"a": [record(f"a.{name}", 0.01) for name in "bcd"]}
    new = {"a": [record("a.b", 0.011), record("a.c", 0.015), record("a.d", 0.012)]}
    assert list(found(sets(old, new))) == ["a.c", "a.d", "a.b"]


def test_a_number_moves_by_more_than_the_scatter_that_its_record_states(sets):
    old = {"a": [record("a.wide", 1.0, comparator="info", bound=None),
                 record("a.time", 1.0, unit="s", comparator="info", bound=None)]}
    new = {"a": [record("a.wide", 1.2, comparator="info", bound=None, scatter=0.3),
                 record("a.time", 1.9, unit="s", comparator="info", bound=None)]}
    folders = sets(old, new)
    assert found(folders) == {}
    write_records(folders[1] / "standard" / "a.json",
                  [record("a.wide", 1.6, comparator="info", bound=None, scatter=0.3),
                   record("a.time", 2.1, unit="s", comparator="info", bound=None)])
    assert found(folders).keys() == {"a.wide", "a.time"}


def test_an_error_moves_whatever_its_note_says_of_times(sets):
    note = {"comparator": "info", "bound": None, "note": "a run takes 1 CPU s"}
    folders = sets({"a": [record("a.x", 1.0, **note)]}, {"a": [record("a.x", 1.1, **note)]})
    assert list(found(folders)) == ["a.x"]


def test_a_check_of_our_own_is_judged_by_its_new_rule(sets):
    old, new = record("a.x", 0.03), record("a.x", 0.03, bound=0.05)
    assert found(sets({"a": [old]}, {"a": [new]})) == {}


def test_a_number_that_another_experiment_records_now_is_the_same_number(sets):
    changed = found(sets({"a": [record("a.x", 0.01)]}, {"b": [record("a.x", 0.03)]}))
    assert [(one.kind, one.experiment, one.values) for one in changed.values()] == [
        ("worse", "b", (0.01, 0.03))]


def test_an_experiment_that_raises_is_worse(sets):
    failed = record("a", None, unit="", comparator="runs", bound=None)
    changed = found(sets({"a": [record("a.x", 0.01)]}, {"a": [failed]}))
    assert {name: one.kind for name, one in changed.items()} == {"a": "worse", "a.x": "lost"}


def test_a_remark_of_older_records_is_no_number(sets):
    old = {"a": [record("a", None, unit="", comparator="info", bound=None)]}
    assert found(sets(old, {"b": [record("b.new", 0.01)]})).keys() == {"b.new"}


@pytest.mark.parametrize(("verdicts", "moved", "kind"), [
    (("better", "pass"), False, "worse"), (("pass", "chosen"), True, "worse"),
    (("chosen", "uncredited"), False, "other verdict"), (("miss", "miss"), True, "moved"),
    (("info", "miss"), False, "worse"), (("pass", "info"), False, "other verdict"),
    (("miss", "info"), True, "other verdict"), (("chosen", "pass"), False, "improved"),
    (("miss", "chosen"), True, "other verdict"), (("miss", "uncredited"), True, "other verdict"),
    (("pass", "pass"), False, None),
    ((None, "miss"), True, "new"), (("pass", None), True, "lost")])
def test_the_kind_of_a_change(verdicts, moved, kind):
    assert kind_of(verdicts, moved) == kind


def test_records_of_a_commit_are_those_of_its_tree(tmp_path, monkeypatch):
    def git(*arguments):
        return subprocess.run(["git", "-c", "user.name=n", "-c", "user.email=e",
                               "-c", "commit.gpgsign=false", *arguments],
                              cwd=tmp_path, check=True, capture_output=True, text=True).stdout

    git("init", "-q")
    write_records(tmp_path / "results" / "standard" / "a.json", [record("a.x", 0.01)])
    git("add", ".")
    git("commit", "-qm", "one")
    commit = git("rev-parse", "HEAD").strip()
    write_records(tmp_path / "results" / "standard" / "a.json", [record("a.x", 0.03)])
    monkeypatch.setattr(compare, "ROOT", tmp_path)
    with stored_results(commit, "standard") as before:
        assert before.value("a", "a.x") == 0.01
    with (pytest.raises(ValueError, match="nothing is neither a folder nor a commit"),
          stored_results("nothing", "standard")):
        pass


def test_without_git_there_are_folders_alone(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ValueError, match="git, which has commits, cannot be run"), \
            stored_results("HEAD", "standard"):
        pass


def test_a_folder_without_records_is_refused(tmp_path):
    with (pytest.raises(ValueError, match=r"has no records of the profile 'paper'"),
          stored_results(tmp_path, "paper")):
        pass


def test_the_command_lists_changes_and_its_exit_code_says_whether_one_is_worse(sets, tmp_path):
    folders = sets({"a": [record("a.x", 0.01)]}, {"a": [record("a.x", 0.03)]})
    table = tmp_path / "changes.csv"
    done = CliRunner().invoke(app, ["compare", *map(str, folders), "--table", str(table)])
    assert done.exit_code == 1
    assert "worse: 1\n  a.x: 0.01 -> 0.03" in done.output
    assert "moved: 0" in done.output
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["kind"], row["target"], row["new_verdict"]) for row in rows] == [
        ("worse", "a.x", "miss")]
    assert CliRunner().invoke(app, ["compare", *2 * [str(folders[0])]]).exit_code == 0
    refused = CliRunner().invoke(app, ["compare", "nowhere"])
    assert refused.exit_code == 2
    assert "neither a folder nor a commit" in refused.output


def test_no_change_is_said(sets):
    folders = sets({"a": [record("a.x", 0.01)]}, {"a": [record("a.x", 0.01)]})
    assert changes_text(list(found(folders).values())) == (
        "worse: 0\nimproved: 0\nother verdict: 0\nlost: 0\nnew: 0\nmoved: 0")
