"""Fingerprints of runs: equal exactly where bits are, and compared case by case."""

import json
from typing import NamedTuple

import numpy as np
import pytest
from typer.testing import CliRunner

from validation.fingerprint import command
from validation.fingerprint.compare import (
    compare,
    differing,
    fingerprint,
    machine_differences,
)
from validation.fingerprint.recording import RunCase, read, run_cases, selected, write


class Pair(NamedTuple):
    a: np.ndarray
    b: float


class Couple(NamedTuple):
    first: np.ndarray
    second: float


def case(value):
    return RunCase("one", lambda: {"x": value})


def raising():
    raise ValueError("broken\nand more")


def test_one_bit_of_an_array_changes_its_fingerprint():
    a = np.linspace(0.0, 1.0, 5)
    b = a.copy()
    b[3] = np.nextafter(b[3], 2.0)
    assert differing(fingerprint({"x": a, "y": a}), fingerprint({"x": b, "y": a})) == ["x"]


@pytest.mark.parametrize("other", [np.zeros((2, 3)), np.zeros(6, dtype=np.float32), -np.zeros(6)])
def test_shape_dtype_and_the_sign_of_zero_count(other):
    assert differing(fingerprint({"x": np.zeros(6)}), fingerprint({"x": other})) == ["x"]


def test_order_in_memory_does_not_count():
    a = np.arange(6.0).reshape(2, 3)
    assert fingerprint({"x": a}) == fingerprint({"x": np.asfortranarray(a)})


def test_names_of_fields_do_not_count():
    a = np.ones(3)
    assert fingerprint({"x": Pair(a, 0.1)}) == fingerprint({"x": Couple(a, 0.1)})
    assert [*fingerprint({"x": Pair(a, 0.1)})] == ["x.0", "x.1"]


def test_bits_of_numbers_are_the_text():
    assert fingerprint({"E": 0.1, "n": 3, "ok": True, "r": (0.5, 2)}) == {
        "E": (0.1).hex(), "n": "3", "ok": "1", "r": [(0.5).hex(), "2"]}


def test_words_are_left_out_and_other_things_refused():
    assert fingerprint({"why": "converged", "none": None}) == {}
    with pytest.raises(TypeError, match="type object has no fingerprint"):
        fingerprint({"x": object()})


def entry(values, raises=None):
    return {"values": values, "raises": raises}


def test_compare_names_the_differences():
    recorded = {"a": entry({"x": "1", "v": "2"}), "b": entry({"x": "1"}), "c": entry({})}
    entries = {"a": entry({"x": "1", "v": "3"}), "b": entry({"x": "1"}), "d": entry({})}
    assert compare(recorded, entries) == {"a": ["v"], "c": ["the case is missing"],
                                        "d": ["the case was not recorded"]}


def test_exceptions_agree_whatever_their_text():
    one, other = entry({}, "ValueError: a"), entry({}, "KeyError: b")
    assert compare({"a": one}, {"a": other}) == {}
    assert "ValueError: a" in compare({"a": one}, {"a": entry({"x": "1"})})["a"][0]


def test_machines_differ_by_fact():
    assert machine_differences({"numpy": "1"}, {"numpy": "2"}) == ["numpy: recorded with 1, here 2"]


def test_a_case_that_raises_is_an_entry():
    entries = run_cases([RunCase("one", raising), case(np.ones(2))._replace(name="two")])
    assert entries["one"]["raises"] == "ValueError: broken"
    assert entries["two"]["raises"] is None
    assert entries["two"]["threads_differ"] == []


def test_labels_that_threads_change_are_named():
    counter = iter((0.1, 0.2))
    entries = run_cases([RunCase("one", lambda: {"x": next(counter), "y": 1.0})])
    assert entries["one"]["threads_differ"] == ["x"]


def test_a_record_is_read_back_and_others_are_refused(tmp_path):
    file = tmp_path / "record.json"
    entries = run_cases([case(1.5)])
    write(file, entries)
    assert read(file)["cases"] == entries
    assert read(file)["machine"]["numpy"] == np.__version__
    file.write_text(json.dumps({"format": 0}))
    with pytest.raises(ValueError, match="expected a record of fingerprints"):
        read(file)


def test_cases_are_selected_by_pattern():
    runs = [RunCase("hot a", None), RunCase("nsf b", None)]
    assert selected(runs, "hot*") == runs[:1]
    assert selected(runs) == runs


def test_check_names_a_case_that_differs(tmp_path, monkeypatch):
    file, runner = tmp_path / "record.json", CliRunner()
    monkeypatch.setattr(command, "cases", lambda: [case(1.5)])
    assert runner.invoke(command.app, ["record", str(file)]).exit_code == 0
    assert runner.invoke(command.app, ["check", str(file)]).exit_code == 0
    monkeypatch.setattr(command, "cases", lambda: [case(np.nextafter(1.5, 2.0))])
    done = runner.invoke(command.app, ["check", str(file)])
    assert done.exit_code == 1
    assert "differs: one: x" in done.output


def test_every_case_has_a_name_of_its_own():
    names = [one.name for one in command.cases()]
    assert len(names) == len(set(names)) > 100
