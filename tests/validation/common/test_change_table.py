"""The published table of changes: each verdict that got worse has a reason, of today's records."""

import msgspec
import numpy as np
import pytest

from validation.common import change_table
from validation.common.change_table import Reason, ReasonFile
from validation.common.compare import COLUMNS, ChangedRecord
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import csv_bytes

WORSE = ChangedRecord("worse", "a.b", "a.b.c", (0.5, None), float("inf"), ("pass", "miss"),
                      ("abc", "def"))
NEW = ChangedRecord("new", "a.b", "a.b.d", (None, 2.0), float("inf"), (None, "info"),
                    (None, "def"))


@pytest.fixture(scope="module")
def records():
    return change_table.read()


@pytest.fixture(scope="module")
def reasons():
    return change_table.read_reasons()


def test_a_table_is_read_as_it_is_written(tmp_path):
    path = tmp_path / "changes.csv"
    path.write_bytes(csv_bytes(COLUMNS, [WORSE.row, NEW.row]))
    assert change_table.read(path) == [WORSE, NEW]


def test_another_table_is_refused(tmp_path):
    path = tmp_path / "changes.csv"
    path.write_text("kind,target\nworse,a\n")
    with pytest.raises(ValueError, match=r"changes.csv has the columns \('kind', 'target'\)"):
        change_table.read(path)


def test_the_first_pattern_that_matches_has_the_reason():
    file = ReasonFile("abc", [Reason(["a.?"], "first"), Reason(["a.*"], "second")])
    assert [file.of_target(name) for name in ("a.b", "a.bc", "b")] == ["first", "second", None]
    assert file.unused(["a.b", "c"]) == []
    assert file.unused(["b"]) == ["a.?", "a.*"]


def test_an_unknown_key_of_a_reason_is_refused(tmp_path):
    path = tmp_path / "changes.toml"
    path.write_text('old = "abc"\n[[reason]]\nids = []\nwhy = "x"\nword = 1\n')
    with pytest.raises(msgspec.ValidationError, match="word"):
        change_table.read_reasons(path)


def test_each_verdict_that_got_worse_has_a_reason_and_each_reason_such_a_verdict(records, reasons):
    worse = [one.target for one in records if one.kind == "worse"]
    assert [target for target in worse if reasons.of_target(target) is None] == []
    assert reasons.unused(worse) == []


@pytest.fixture(scope="module")
def now():
    """{number: its record} of the published records."""
    results = ProfileResults(RESULTS / "standard")
    return {record.target: record for experiment in results.ids()
            for record in results.records(experiment)}


def test_the_table_is_of_the_records_of_today(records, now):
    """Run `python -m validation compare OLD --table results/changes.csv` anew where it fails."""
    there = [one for one in records if one.kind != "lost"]
    assert {one.kind for one in there} >= {"worse", "improved", "moved", "new"}
    assert [one.target for one in there if one.target not in now
            or now[one.target].commit != one.commits[1]] == []
    assert [one.target for one in there if now[one.target].value != one.values[1]
            and np.isfinite(one.values[1])] == []


def test_lost_numbers_are_not_recorded_today(records, now):
    assert [one.target for one in records if one.kind == "lost" and one.target in now] == []
