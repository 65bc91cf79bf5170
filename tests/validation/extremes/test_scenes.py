"""Maps of shipped scenes: all factors of all axes, and counts of how their cells end."""

import pytest

from mpm_ref.limits.axes import AXES, rungs
from mpm_ref.limits.verdict import RIGHT, WRONG
from mpm_ref.scene import build
from mpm_ref.scene.validate import plain
from validation.extremes import scenes
from validation.extremes.scenes import (
    EXPLICIT,
    HOT,
    LEARNED_LAW,
    axis_cells,
    mapped,
    record_map,
    small_scene,
)
from validation.trade.searched_cells import COLUMNS, SearchedCell, table_rows


@pytest.mark.parametrize("one", [*EXPLICIT, *HOT, *LEARNED_LAW], ids=lambda one: one.name)
def test_mapped_scenes_are_small(one):
    scene = small_scene(one)
    problem = build(scene)
    assert scene.end == one.end
    assert sum(len(body.id) for body in problem.bodies) <= 1000
    assert problem.integrator == ("implicit" if one in HOT else "explicit")
    assert small_scene(one, 0.5).end == 0.5 * one.end
    assert (scene.body[0].material.law == "neural") == (one in LEARNED_LAW)


def test_all_factors_of_all_axes_are_mapped():
    tables = plain(small_scene(EXPLICIT[0]))
    cells = axis_cells(tables)
    assert len(cells) == len(set(cells))
    factors = {axis.name: [factor for (name, factor), in cells if name == axis.name]
               for axis in AXES}
    assert sorted(factors["density"]) == [0.001, 0.01, 0.1, 10.0, 100.0, 1000.0]
    for axis in AXES:
        if factors[axis.name]:
            assert set(rungs(axis, tables, "up")) <= set(factors[axis.name])
    assert not factors["yield"]
    assert {name for (name, _), in axis_cells(tables, is_quick=True)} == set(scenes.QUICK_AXES)


def test_a_quick_map_has_a_verdict_for_each_cell():
    scene = small_scene(EXPLICIT[0], 0.05)
    rows = [SearchedCell(*row) for row in mapped("jelly", scene, is_quick=True)]
    assert [one.cell for one in rows] == ["as given", "time_step x 10", "time_step x 0.5",
                                          "gravity x 0.1", "gravity x 10"]
    assert rows[1].outcome == "refused"
    assert rows[1].message.startswith("cfl = 5")
    assert all(len(row) == len(COLUMNS) for row in table_rows(rows))


class Records:
    experiment = type("Experiment", (), {"id": "extremes.toy.scenes"})

    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, target, value, note="", **_):
        self.values[target.removeprefix("extremes.toy.scenes.toy.")] = value
        self.notes[target.removeprefix("extremes.toy.scenes.toy.")] = note


def test_cells_are_counted_by_how_they_end():
    def cell(outcome, error=0.0, warnings="", message=""):
        return SearchedCell("toy", f"density x {error:g}", outcome, error, 0.1, "resolution", 0.4,
                            warnings, message, ())
    records = Records()
    record_map(records, "toy", [
        cell(RIGHT), cell(RIGHT), cell(WRONG, 0.15), cell(WRONG, 0.5), cell(WRONG, 0.6, "gap"),
        cell("unstable", message="why"), cell("refused"), cell("contact lost", message="no"),
        cell("too long", message="long")])
    assert records.values == {
        "right": 2, "wrong": 3, "refused": 1, "contact_lost": 1, "stopped": 1, "too_long": 1,
        "not_checked": 0, "silent": 2, "far_silent": 1, "without_message": 1}
    assert "density x 0.5: 0.5 (tolerance 0.1)" in records.notes["far_silent"]
    assert "2 resolution" in records.notes["silent"]
