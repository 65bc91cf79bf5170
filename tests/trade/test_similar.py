import json
from contextlib import suppress
from string import printable

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.scene import SceneError
from mpm_ref.sweep.setting import KNOBS, setting
from mpm_ref.trade import similar
from mpm_ref.trade.similar import (
    StoredSetting,
    carried_over,
    cheapest_row,
    read_answer,
    require_same_quantities,
)

ANSWER = {
    "cells": 10.0, "until": 0.2, "end": 0.2, "quantities": ["positions"],
    "references": {"positions": {"error": 0.01}},
    "rows": [
        {"setting": {}, "outcome": "finished", "error": 0.0, "cpu": 4.0},
        {"setting": {"dx": 2.0, "cfl": 0.9}, "outcome": "finished", "error": 0.02, "cpu": 1.0},
        {"setting": {"dx": 4.0}, "outcome": "finished", "error": 0.05, "cpu": 0.5},
        {"setting": {"degree": 1}, "outcome": "unstable", "error": 0.0, "cpu": 0.1},
        {"setting": {"scene": "learned"}, "outcome": "finished", "error": 0.0, "cpu": 0.1},
        {"setting": {"degree": 3}, "outcome": "finished", "error": None, "cpu": 0.1},
    ]}
JSON = st.recursive(st.none() | st.booleans() | st.floats() | st.text(printable),
                    lambda inner: st.lists(inner) | st.dictionaries(st.text(printable), inner))


def stored(folder, facts):
    path = folder / "other.trade.json"
    path.write_text(json.dumps(facts))
    return read_answer(path)


@pytest.mark.parametrize(("error", "chosen"), [
    (0.02, setting()), (0.03, setting(dx=2.0, cfl=0.9)), (0.1, setting(dx=4.0)), (0.005, None)])
def test_the_error_of_the_reference_counts(tmp_path, error, chosen):
    row = cheapest_row(stored(tmp_path, ANSWER), error)
    assert (None if row is None else setting(**row.setting.knobs())) == chosen


@pytest.mark.parametrize("references", [{}, {"positions": {"error": None}}])
def test_without_a_known_reference_there_is_no_advice(tmp_path, references):
    assert cheapest_row(stored(tmp_path, ANSWER | {"references": references}), 0.9) is None


def test_another_quantity_is_refused(tmp_path):
    answer = stored(tmp_path, ANSWER)
    require_same_quantities(answer, ("positions",), "other")
    with pytest.raises(SceneError, match="about positions; asked is kinetic"):
        require_same_quantities(answer, ("kinetic",), "other")


@pytest.mark.parametrize("change", [
    {"error": -3.0}, {"cpu": -1.0}, {"setting": {"dx": 1e-320}}, {"setting": {"dx": 1e7}}])
def test_numbers_that_cannot_be_are_refused(tmp_path, change):
    facts = json.loads(json.dumps(ANSWER))
    facts["rows"][0] |= change
    with pytest.raises(SceneError, match="not an answer"):
        stored(tmp_path, facts)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(similar, "LARGEST", 100)
    with pytest.raises(SceneError, match="expected the answer that `mpm-ref trade` writes"):
        stored(tmp_path, ANSWER)


def test_cells_over_the_body_carry_over(tmp_path):
    answer = stored(tmp_path, ANSWER)
    row = cheapest_row(answer, 0.03)
    assert carried_over(row, answer.cells, 30.0) == setting(dx=6.0, cfl=0.9)


def test_every_knob_can_be_stored():
    assert StoredSetting.__struct_fields__ == KNOBS


@given(key=st.sampled_from([*ANSWER, "rows setting", "rows error", "rows outcome"]), value=JSON)
def test_any_value_in_an_answer_is_read_or_refused(tmp_path_factory, key, value):
    facts = json.loads(json.dumps(ANSWER))
    where, _, inner = key.partition(" ")
    if inner:
        facts[where][0][inner] = value
    else:
        facts[where] = value
    with suppress(SceneError):
        answer = stored(tmp_path_factory.mktemp("fuzz"), facts)
        row = cheapest_row(answer, 0.5)
        assert row is None or carried_over(row, answer.cells, 20.0).get("dx") > 0.0


@given(st.binary(max_size=64))
def test_any_bytes_are_refused(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("fuzz") / "other.trade.json"
    path.write_bytes(data + b"}")
    with pytest.raises(SceneError, match="not an answer"):
        read_answer(path)


def test_a_row_may_hold_more_than_is_read(tmp_path):
    facts = msgspec.to_builtins(ANSWER)
    facts["rows"][0] |= {"message": "", "steps": 3}
    assert len(stored(tmp_path, facts | {"version": "1"}).rows) == 6
