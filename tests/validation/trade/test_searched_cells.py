"""What counts as noticed, as far and as a false alarm, on cells of known verdicts."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.indicators import INDICATORS, sentence_of
from mpm_ref.limits.verdict import RIGHT, WRONG, CellVerdict
from validation.trade.advice_scenes import advice_scenes
from validation.trade.searched_cells import (
    CAUSES,
    COLUMNS,
    SearchedCell,
    cause_of,
    cell_row,
    cell_rows,
    notice_of,
    observed_scene,
    record_notices,
    searched,
    silent_cells,
    table_rows,
)


def cell(outcome, error, warnings=""):
    return SearchedCell("toy", "density x 2", outcome, error, 0.1, "resolution", 0.4, warnings, "",
                        (1.0,) * len(INDICATORS))


CELLS = (cell(WRONG, 0.15), cell(WRONG, 0.15, "gap"), cell(WRONG, 0.3, "gap dispersion"),
         cell(WRONG, np.inf), cell(RIGHT, 0.01), cell(RIGHT, 0.02, "dispersion"),
         cell("refused", np.nan, "preflight"))


class Records:
    experiment = SimpleNamespace(id="trade.toy")

    def __init__(self):
        self.values, self.rules = {}, {}

    def record(self, target, value, **rule):
        self.values[target], self.rules[target] = value, rule


def test_far_is_past_twice_the_tolerance():
    assert [one.is_far for one in CELLS] == [False, False, True, True, False, False, False]


def test_notice_counts_wrong_far_and_right_cells():
    assert notice_of(CELLS, lambda one: bool(one.warnings)) == (4, 2, 2, 2, 1, 1)
    assert notice_of(CELLS, lambda one: "gap" in one.warnings.split()) == (4, 2, 2, 2, 1, 0)


def test_records_have_the_shares_and_each_cause():
    records = Records()
    record_notices(records, CELLS, 0.05)
    assert records.values == {
        "trade.toy.noticed": 0.5, "trade.toy.far_noticed": 0.5, "trade.toy.false_alarms": 0.5,
        "trade.toy.clear_false_alarms": 0.5,
        **{f"trade.toy.{cause}": 0 for cause in CAUSES}, "trade.toy.gap": 2,
        "trade.toy.dispersion": 1}
    assert records.rules["trade.toy.false_alarms"]["bound"] == 0.05


def test_no_cells_give_no_share():
    records = Records()
    record_notices(records, (), 0.05)
    assert records.values["trade.toy.noticed"] is None


def test_silent_cells_are_the_farthest_first():
    assert [one.error for one in silent_cells(CELLS)] == [np.inf, 0.15]


@pytest.mark.parametrize("name", INDICATORS)
def test_a_warning_has_the_name_of_its_indicator(name):
    assert cause_of(sentence_of(name, 3.0, "bar", 0.1)) == name
    assert cause_of("12 of the 40 particles of body 'bar' start inside x: y") == "preflight"


def test_rows_fit_the_columns():
    verdict = CellVerdict(WRONG, "", 0.2, 0.1, warnings=("gap: a", "gap: b", "dispersion: c"),
                          limit="setting", indicators={"gap": 3.0})
    row = cell_row("toy", "density x 2", verdict)
    assert row[7] == "gap dispersion"
    table, = table_rows([SearchedCell(*row)])
    assert len(table) == len(COLUMNS)
    assert table[COLUMNS.index("gap")] == 3.0
    assert np.isnan(table[COLUMNS.index("dispersion")])


def test_a_search_gives_rows_of_all_its_cells():
    scene = next(one.scene for one in advice_scenes() if one.name == "flight")
    search = searched(scene, observed_scene(scene), 3.0)        # [s]
    rows = cell_rows("flight", search.judge)
    assert rows[0][:3] == ["flight", "as given", RIGHT]
    assert len(rows) == len(search.judge.verdicts)


def test_the_scene_as_given_does_not_count_in_the_budget():
    scene = next(one.scene for one in advice_scenes() if one.name == "flight")
    search = searched(scene, observed_scene(scene), 0.0)
    assert cell_rows("flight", search.judge)[0][:3] == ["flight", "as given", RIGHT]
