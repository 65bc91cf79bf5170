import numpy as np
import pytest

from mpm_ref.limits.axes import AXIS, DOWN, UP
from mpm_ref.limits.search import Direction
from mpm_ref.limits.verdict import RIGHT, WRONG
from mpm_ref.scene import SceneError
from mpm_ref.sweep.observation import FINISHED, UNSTABLE, RunCost, RunObservation
from validation.trade import limits
from validation.trade.advice_scenes import advice_scenes
from validation.trade.limits import (
    Claim,
    compared,
    drawn_cells,
    record_claims,
    record_silent,
)
from validation.trade.searched_cells import SearchedCell


def direction(name, way, good, is_discrete=False):
    return Direction(AXIS[name], way, (10.0,), is_discrete, good=good)


def test_scenes_exist():
    assert {*limits.JUDGED, *limits.CHOSEN} <= {one.name for one in advice_scenes()}
    assert set(limits.scenes_of(limits.JUDGED)) == set(limits.JUDGED)


def test_bounds_are_chosen_on_other_scenes_than_those_that_judge_them():
    assert not set(limits.JUDGED) & set(limits.CHOSEN)


def test_cells_are_drawn_within_what_is_right():
    rng = np.random.default_rng(0)
    directions = [direction("density", UP, 100.0), direction("density", DOWN, 0.01),
                  direction("speed", UP, 1.0), direction("origin", UP, 10.0),
                  direction("particles", UP, 2.0, is_discrete=True)]
    cells = drawn_cells(directions, rng)
    assert len(cells) == 2 * limits.DRAWS
    factors = [factor for ((name, factor),) in cells if name == "density"]
    assert len(factors) == len(cells)
    assert all(1.0 < f < 100.0 for f in factors[:limits.DRAWS])
    assert all(0.01 < f < 1.0 for f in factors[limits.DRAWS:])


class Scenes:
    """Scenes that are their labels."""

    def scene(self, cell, dx=1.0):
        return SceneError("none") if dict(cell).get("size") else (cell, dx)

    def probes(self, cell):
        return cell


class Runs:
    """Runs by formulas: the error of a cell is its density's factor over a hundred."""

    def observe(self, requests):
        return {label: self.run(*request.scene) for label, request in requests.items()}

    def run(self, cell, dx):
        factors = dict(cell)
        off = 0.0 if dx < 1.0 else 0.02 * factors.get("density", 1.0)
        outcome = UNSTABLE if factors.get("speed", 1.0) * dx > 50.0 else FINISHED
        return RunObservation({"positions": np.array([[0.0], [1.0 + off]])}, RunCost(), outcome)


def claims(**cells):
    tested = {((name, factor),): RIGHT for name, factor in cells.items()}
    return list(compared("toy", tested, Scenes(), Runs()))


@pytest.mark.parametrize(("cell", "status"), [
    ({"density": 2.0}, RIGHT), ({"density": 3.0}, WRONG), ({"speed": 60.0}, UNSTABLE)])
def test_a_claim_is_confirmed_by_the_finer_grid(cell, status):
    one, = claims(**cell)
    assert one.status == status
    assert one.tolerance == limits.ERROR        # twice 2 % is less
    if status != UNSTABLE:
        assert one.error == pytest.approx(0.02 * cell["density"])


def test_a_reference_that_fails_confirms_nothing():
    one, = claims(speed=300.0)
    assert one.status == UNSTABLE
    runs = Runs()
    runs.run = lambda cell, dx: Runs.run(runs, (("speed", 300.0 if dx < 1.0 and cell else 0.0),), 1)
    tested = {(("speed", 2.0),): RIGHT}
    one, = compared("toy", tested, Scenes(), runs)
    assert one.status == "the reference: unstable"


def test_a_cell_that_is_no_scene_raises():
    with pytest.raises(SceneError):
        claims(size=2.0)


class Records:
    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, target, value, note="", **_):
        self.values[target], self.notes[target] = value, note


def test_records_count_the_claims():
    def claim(claim, status):
        return Claim("toy", "density x 2", claim, 0.2, 0.1, status)
    records = Records()
    record_claims(records, [claim(RIGHT, RIGHT), claim(RIGHT, RIGHT), claim(RIGHT, WRONG),
                            claim(RIGHT, "unstable"), claim(WRONG, WRONG), claim(WRONG, RIGHT),
                            claim(WRONG, "the reference: unstable")], 50)
    assert records.values == {"trade.limits.right": 0.5, "trade.limits.wrong": 0.5}
    assert "toy density x 2: wrong 0.2" in records.notes["trade.limits.right"]


def test_silent_cells_are_counted_by_their_limits():
    def cell(error, limit, warnings=""):
        return SearchedCell("toy", "density x 2", WRONG, error, 0.1, limit, 0.4, warnings, "", ())
    records = Records()
    record_silent(records, [cell(0.15, "resolution"), cell(0.3, "resolution"),
                            cell(0.25, "no convergence"), cell(0.9, "resolution", "gap"),
                            SearchedCell("toy", "as given", RIGHT, 0.0, 0.1, "", 0.0, "", "", ())])
    assert records.values == {
        "trade.limits.silent": 3, "trade.limits.far_silent": 2,
        "trade.limits.limit.resolution": 2, "trade.limits.limit.no_convergence": 1,
        "trade.limits.limit.setting": 0, "trade.limits.limit.vanishing_quantity": 0}
    note = records.notes["trade.limits.far_silent"]
    assert "toy density x 2: 0.3 (tolerance 0.1), resolution; toy density x 2: 0.25" in note


def test_an_error_after_a_shift_is_that_of_the_changes():
    class Shifted(Runs):
        def run(self, cell, dx):
            start = 7.0 if dict(cell).get("origin") else 0.0
            values = start + np.array([[0.0], [1.0]])
            return RunObservation({"positions": values}, RunCost(), FINISHED)
    one, = compared("toy", {(("origin", 10.0),): WRONG}, Scenes(), Shifted())
    assert (one.status, one.error) == (RIGHT, 0.0)
