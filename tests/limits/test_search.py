"""Margins and maps of synthetic verdicts with failures at given factors."""

from math import log10
from types import SimpleNamespace

import pytest

from mpm_ref.limits.axes import AXIS, DECADES, DOWN, SHORTER, UP
from mpm_ref.limits.cell import cell_of
from mpm_ref.limits.search import (
    SIDE,
    Direction,
    LimitsSearch,
    explore,
    map_factors,
    nearest_axes,
)
from mpm_ref.limits.verdict import RIGHT, UNCHECKED, WRONG, CellVerdict
from mpm_ref.sweep.observation import REFUSED, STOPPED, UNSTABLE


def direction(name, way=UP, steps=DECADES, discrete=False):
    if way == DOWN and steps == DECADES:
        steps = tuple(1.0 / factor for factor in steps)
    return Direction(AXIS[name], way, steps, discrete)


class SyntheticJudge:
    """Verdicts and CPU times by functions of {axis's name: factor}; counts the rounds."""

    def __init__(self, outcome, most=10**9, cpu=lambda factors: 1.0, by_fine_grids=None):
        self.outcome, self.most, self.rounds, self.verdicts = outcome, most, 0, {}
        self.known = {}
        self.cpu, self.by_fine_grids = cpu, by_fine_grids or outcome

    def judge(self, cells, by_fine_grids=False):
        self.rounds += 1
        if by_fine_grids:
            return {cell: CellVerdict(self.by_fine_grids(dict(cell))) for cell in cells}
        for cell in cells:
            if cell not in self.verdicts and len(self.verdicts) < self.most:
                self.verdicts[cell] = CellVerdict(self.outcome(dict(cell)),
                                                  cpu=self.cpu(dict(cell)))
        return {cell: self.verdicts.get(cell) for cell in cells}

    def refused_alone(self, cell):
        return self.known.get(cell)


@pytest.mark.parametrize("limit", [1.02, 2.1, 37.0, 990.0])
def test_margin_is_found_within_ten_percent(limit):
    up, down = direction("stiffness"), direction("density", DOWN)
    explore([up, down], SyntheticJudge(
        lambda f: RIGHT if f.get("stiffness", 1.0) <= limit
        and f.get("density", 1.0) >= 1.0 / limit else UNSTABLE).judge)
    for one in (up, down):
        assert one.margin <= limit
        assert limit / one.margin < 1.1
        assert one.failed
        assert one.verdict.outcome == UNSTABLE
        assert max(one.bad, 1.0 / one.bad) > limit


def test_directions_without_failure_end_with_the_rungs():
    directions = [direction("stiffness"), direction("density"), direction("gravity", DOWN)]
    explore(directions, SyntheticJudge(lambda f: RIGHT).judge)
    assert [one.margin for one in directions] == [1000.0, 1000.0, pytest.approx(1000.0)]
    assert not any(one.failed for one in directions)


def test_directions_that_cost_least_go_first():
    """With a budget of cells, what is refused at once is searched to its end, the rest is not."""
    dear = [direction(name) for name in ("stiffness", "density", "gravity")]
    cheap = direction("poisson")
    judge = SyntheticJudge(lambda f: REFUSED if "poisson" in f else RIGHT, 14,
                           lambda f: 0.0 if "poisson" in f else 100.0)
    explore([*dear, cheap], judge.judge)
    assert (cheap.is_late, cheap.failed) == (False, True)
    assert cheap.bad / cheap.good <= 1.1
    assert any(one.is_late for one in dear)


def test_all_directions_have_a_first_factor_before_any_is_searched_on():
    """However many there are, cheap or dear, and though one fails at once."""
    names = ("stiffness", "density", "speed", "gravity", "friction", "yield")
    directions = [direction(name, way) for name in names for way in (DOWN, UP)]
    judge = SyntheticJudge(lambda f: REFUSED if "stiffness" in f else RIGHT, len(directions),
                           lambda f: 0.0 if "stiffness" in f else 100.0)
    explore(directions, judge.judge)
    assert {abs(round(log10(dict(cell)[name]), 9)) for cell in judge.verdicts
            for name in dict(cell)} == {1.0}
    assert not any(one.is_new for one in directions if one.bad is None and one.good != 1.0)
    assert len(judge.verdicts) == len(directions)


def test_the_nearest_failure_is_narrowed_down_before_what_lies_farther_out():
    near, far, right = direction("speed"), direction("density"), direction("gravity")
    judge = SyntheticJudge(lambda f: WRONG if f.get("speed", 1.0) > 4.0
                           or f.get("density", 1.0) > 40.0 else RIGHT,
                           cpu=lambda f: 100.0 if "speed" in f else 1.0)
    explore([right, far, near], judge.judge)
    tried = list(judge.verdicts)
    inside = [k for k, cell in enumerate(tried) if "speed" in dict(cell)]
    outside = [k for k, cell in enumerate(tried) if max(dict(cell).values()) > 10.0]
    assert max(inside) < min(outside)
    assert near.bad / near.good <= 1.1


def test_equally_near_factors_of_the_least_cost_go_first():
    dear, cheap = direction("stiffness"), direction("density")
    judge = SyntheticJudge(lambda f: RIGHT, cpu=lambda f: 9.0 if "stiffness" in f else 1.0)
    explore([dear, cheap], judge.judge)
    assert [dict(cell) for cell in judge.verdicts][2:4] == [{"density": 100.0},
                                                            {"stiffness": 100.0}]


def test_the_factor_that_the_budget_left_is_kept():
    one = direction("stiffness")
    explore([one], SyntheticJudge(lambda f: RIGHT, 1).judge)
    assert (one.good, one.late, one.is_late) == (10.0, 100.0, True)


@pytest.mark.parametrize("outcome", [STOPPED, UNCHECKED])
def test_the_end_of_what_was_looked_at_is_no_failure(outcome):
    one = direction("stiffness")
    judge = SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 50.0 else outcome)
    explore([one], judge.judge)
    assert (one.good, one.bad, one.failed) == (10.0, 100.0, False)
    assert judge.rounds == 3        # two factors, and the fine grid of the first


def test_discrete_axis_is_not_halved():
    one = direction("time_step", DOWN, SHORTER, discrete=True)
    explore([one], SyntheticJudge(lambda f: RIGHT if f["time_step"] > 0.15 else WRONG).judge)
    assert (one.good, one.bad, one.failed) == (0.2, 0.1, True)


def test_shift_is_halved_to_a_factor_of_two():
    one = Direction(AXIS["origin"], UP, (1e4,), False)
    judge = SyntheticJudge(lambda f: RIGHT if f["origin"] < 300.0 else WRONG)
    explore([one], judge.judge)
    assert 1.1 < one.bad / one.good <= 2.0


def test_end_of_the_budget_leaves_the_interval():
    one = direction("stiffness")
    explore([one], SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 5.0 else WRONG, 2).judge)
    assert one.is_late
    assert (one.good, one.bad) == (pytest.approx(10.0**0.5), 10.0)


@pytest.mark.parametrize("limit", [3.0, 50.0])
def test_what_a_fine_grid_does_not_confirm_is_searched_anew(limit):
    one = direction("stiffness")
    judge = SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 400.0 else WRONG,
                           by_fine_grids=lambda f: RIGHT if f["stiffness"] < limit else WRONG)
    explore([one], judge.judge)
    assert one.good < limit <= one.bad < 1.1 * one.good
    assert one.verdict.outcome == WRONG


def test_what_a_fine_grid_confirms_stays():
    one = direction("stiffness")
    judge = SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 400.0 else WRONG)
    explore([one], judge.judge)
    assert one.good < 400.0 <= one.bad < 1.1 * one.good
    assert one.by_fine_grids


def test_without_a_fine_grid_the_coarse_one_decides():
    one = direction("stiffness")
    explore([one], SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 400.0 else WRONG,
                                  by_fine_grids=lambda f: UNCHECKED).judge)
    assert one.good < 400.0 <= one.bad


def test_missing_cells_are_counted():
    one = direction("stiffness")
    assert one.remaining() == 3
    one.note(10.0, CellVerdict(RIGHT))
    assert one.remaining() == 2
    one.note(100.0, CellVerdict(WRONG))
    assert one.remaining() == 5             # 10^(1/32) = 1.075
    judge = SyntheticJudge(lambda f: RIGHT if f["stiffness"] < 50.0 else WRONG)
    explore([one], judge.judge)
    assert len(judge.verdicts) == 5
    assert one.remaining() == 0


def test_nearest_axes_are_those_that_fail_first():
    limits = {"stiffness": 500.0, "density": 4.0, "speed": 40.0, "gravity": 1e9, "poisson": 2.0}
    directions = [direction(name) for name in limits]
    explore(directions, SyntheticJudge(lambda f: RIGHT if all(
        factor <= limits[name] for name, factor in f.items()) else REFUSED).judge)
    assert [axis.name for axis in nearest_axes(directions)] == ["poisson", "density", "speed"]


def test_factors_of_a_map_have_both_ends_and_the_scene():
    up, down = direction("stiffness"), direction("stiffness", DOWN)
    up.good, up.bad, down.good = 90.0, 100.0, 1e-3
    factors = map_factors([up, down])
    assert factors == pytest.approx((1e-3, 1e-3**0.5, 1.0, 10.0, 100.0))
    assert len(factors) == SIDE
    shorter = direction("time_step", DOWN, SHORTER, discrete=True)
    shorter.good = 0.1
    assert map_factors([shorter]) == (0.1, 0.2, 1.0)


class SyntheticScenes:
    def tables(self, cell=()):
        body = {"density": 1.0, "shape": {}, "material": {"E": 1.0, "nu": 0.3, "flow": {}},
                "sampling": {"per_cell": 1, "type": "regular"}, "velocity": {}}
        return {"body": [body], "dx": 1.0, "dim": 2, "collider": (), "fixed": ()}


def test_search_maps_the_pairs_of_the_nearest_axes():
    """Stiffness and density fail together where their product is too large."""
    judge = SyntheticJudge(lambda f: RIGHT if f.get("stiffness", 1.0) * f.get("density", 1.0) < 50.0
                           else WRONG)
    judge.scenes, judge.quantities = SyntheticScenes(), ("positions",)
    judge.runs = SimpleNamespace(workers=2)
    search = LimitsSearch(judge)
    search.run()
    assert [sorted(axis.name for axis in one.axes) for one in search.maps] == [
        ["density", "stiffness"]]
    (a, b), verdicts = search.maps[0].factors, search.maps[0].verdicts
    for i, row in enumerate(verdicts):
        for j, verdict in enumerate(row):
            assert (verdict.outcome == RIGHT) == (a[i] * b[j] < 50.0)
    assert cell_of({"stiffness": a[-1], "density": b[-1]}) in search.wrong_cells()
    assert set(search.left_out) == {"speed", "gravity", "friction", "yield"}


def test_a_pair_that_one_axis_alone_refuses_is_not_judged():
    """Refused stiffness is known, whatever the density."""
    judge = SyntheticJudge(lambda f: REFUSED if f.get("stiffness", 1.0) > 2.0 else (
        RIGHT if f.get("density", 1.0) < 50.0 else WRONG))
    judge.scenes, judge.quantities = SyntheticScenes(), ("positions",)
    judge.runs = SimpleNamespace(workers=2)
    known = CellVerdict(REFUSED, "too stiff", alone="stiffness")
    judge.refused_alone = lambda cell: known if len(cell) > 1 and dict(cell)["stiffness"] > 2.0 \
        else None
    search = LimitsSearch(judge)
    search.run()
    cells = {cell: verdict for one in search.maps for row, a in zip(
        one.verdicts, one.factors[0], strict=True) for verdict, b in zip(
        row, one.factors[1], strict=True)
        for cell in [cell_of({one.axes[0].name: a, one.axes[1].name: b})]}
    alone = [cell for cell, verdict in cells.items() if verdict.alone]
    assert len(alone) == 4
    assert not set(alone) & set(judge.verdicts)
    assert set(cells) - set(alone) <= {*judge.verdicts, ()}
