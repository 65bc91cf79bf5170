"""Figures of HOT's extremes and trade, drawn from small made-up tables."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.extremes import hot as extremes_hot
from figures.trade import hot_scenes

mpl.use("Agg")


def solves(column, values, *ends):
    """A table of solves by two methods; ends: (method, kind, iterations) for each value in turn."""
    rows = [(value, *end) for value, end in zip(values, ends, strict=True)]
    state, method, kind, iterations = zip(*rows, strict=True)
    return {column: np.array(state), "method": np.array(method), "kind": np.array(kind),
            "iterations": np.array(iterations, dtype=float)}


@pytest.fixture
def extremes():
    """Axes of sets of which one stopped, one is unsound and all others converged."""
    good = ("hot", "converged", 3)
    tables = {name: solves(column, ["2d, E = 1, torn" if column == "run" else
                                    "flat" if column in ("body", "F") else 0.5], good)
              for name, (column, _) in extremes_hot.SETS.items()}
    tables["broken"] = solves("F", 4 * ["flat"], good, ("hot", "stopped", 500),
                              ("pn-pcg", "converged", 7), ("pn-pcg", "converged", 9))
    tables["stretched"] = solves("F", [2.0], ("hot", "energy rose", 1))
    tables["every_method"] = solves("state", ["stiff", "dust"], ("admm", "stopped", 500), good)
    return extremes_hot.draw(SimpleNamespace(
        table=lambda id, name: tables[id.split(".")[-1]])).axes


def cells(ax):
    """{row: [(text, colour)]}."""
    rows = [label.get_text() for label in ax.get_yticklabels()]
    found = {row: [] for row in rows}
    for text, patch in zip(ax.texts, ax.patches, strict=True):
        found[rows[int(text.get_position()[1])]].append(
            (text.get_text(), mpl.colors.to_hex(patch.get_facecolor())))
    return found


def test_sets_in_which_solves_fail_are_drawn_as_failed(extremes):
    assert cells(extremes[1])["F flat"] == [("1 of 2", extremes_hot.STOPPED),
                                            ("9", extremes_hot.CONVERGED)]
    assert cells(extremes[1])["stretched 2 times"] == [("stopped", extremes_hot.UNSOUND)]
    assert cells(extremes[0])["torn"] == [("3", extremes_hot.CONVERGED)]
    assert cells(extremes[2])["stiff"] == [("stopped", extremes_hot.STOPPED)]


def test_every_set_has_a_row(extremes):
    assert [*cells(extremes[0])] == ["contrast 5e-01", r"$\nu$ = 0.5", "flat", "torn"]
    assert [*cells(extremes[1])] == ["F flat", "stretched 2 times", "torn"]
    assert [*cells(extremes[2])] == ["stiff", "dust"]


def test_state_of_a_run_is_told_with_the_unit_of_its_step():
    assert extremes_hot.state_of("2d, E = 1e+04, dt = 0.001") == "dt = 0.001 s"
    assert extremes_hot.state_of("3d, E = 1e+04, resting, slip") == "resting, slip"
    assert extremes_hot.state_of("0.4999") == 0.4999


def test_front_holds_what_no_cheaper_solve_beats():
    cost, error = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([1.0, 2.0, 0.5, 0.49, 0.1])
    rows = np.arange(5)
    assert hot_scenes.front(cost, error, rows).tolist() == [0, 2, 4]     # 0.49 is no gain
    assert hot_scenes.front(cost, error, rows[1:2]).tolist() == [1]
    assert hot_scenes.front(cost, error, rows[:0]).tolist() == []


def test_panels_show_the_front_by_method_and_hide_no_solve():
    table = {"scene": 4 * ["twist"], "size": 4 * ["quick"],
             "method": ["hot", "hot", "pn-pcg", "admm"], "eps": [1e-5, 1e-7, 1e-7, 1e-7],
             "cpu": [1.0, 2.0, 3.0, 4.0], "error": [0.1, 0.01, 0.5, 1e-9],
             "least": 4 * [1e-3], "iterations": [1, 2, 3, 4]}
    columns = {name: np.array(values) for name, values in table.items()}
    ax = hot_scenes.draw(SimpleNamespace(table=lambda id, name: columns)).axes[0]
    found = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert len(found["all solves"]) == 2
    assert found["HOT"] == pytest.approx(np.array([[1.0, 0.1], [2.0, 0.01]]))
    assert found["ADMM"] == pytest.approx(np.array([[4.0, 1e-3]]))      # the reference's error
    assert "PN-PCG" not in found
    assert found["HOT, paper's tolerance"] == pytest.approx(np.array([[2.0, 0.01]]))
