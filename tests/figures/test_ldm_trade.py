"""Figures of what reduced runs cost, drawn from small made-up tables."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.trade import ldm, ldm_cost

mpl.use("Agg")
USUAL = {"quadrature": "eulerian", "projection": "linear", "points": 50, "velocity": "previous",
         "per_cell": 2, "samples": "redrawn", "preimage_tolerance": 1e-9,
         "precision": "double", "wall": 0.2,
         "origin": 0.002, "pareto": 0}
CHEAP = {"velocity": "transported", "preimage_tolerance": 0.01}
WAYS = [{}, {"points": 100, "wall": 0.4, "origin": 0.001, "pareto": 1}, {"points": 10, "wall": 0.1},
        {"projection": "nonlinear", "wall": 0.3}, {**CHEAP, "points": 25, "wall": 0.06},
        {**CHEAP, "points": 10, "wall": 0.05, "origin": 0.004, "pareto": 1},
        {"samples": "kept", "wall": np.inf, "origin": np.inf}]
DENSE = {"quadrature": ["lagrangian", "eulerian", "eulerian", "resampled"],
         "per_cell": [2, 1, 2, 2], "origin": [0.002, 0.06, 0.005, 0.003]}
PARTS = {"particles": 2 * [34e3] + 2 * [3.08e6], "way": 2 * ["paper", "cheap"],
         "cpu": [0.1, 0.05, 0.2, 0.1],
         **{name: np.array([0.1, 0.05, 0.2, 0.1]) * share for name, share in
            zip(ldm_cost.PARTS, (0.5, 0.2, 0.1, 0.05, 0.15), strict=True)}}
PAYS = {"particles": [34e3, 384e3, 3.08e6], "runs_same": [np.inf, 64.0, 6.0],
        "runs": [np.inf, np.inf, 16.0]}


def made(**tables):
    """Results that hold tables by name."""
    columns = {name: {column: np.array(values) for column, values in table.items()}
               for name, table in tables.items()}
    return SimpleNamespace(table=lambda id, name: columns[name])


def lines(ax):
    """{label: line} of what a legend shows."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


@pytest.fixture(scope="module")
def tower():
    """Axes of the tower and of torsion."""
    rows = [USUAL | way for way in WAYS]
    ways = {name: [row[name] for row in rows] for name in USUAL}
    return ldm.draw(made(ways=ways, densities=DENSE)).axes


def test_numbers_of_samples_are_curves_and_other_choices_marks(tower):
    found = lines(tower[0])
    assert set(found) == {
        "Pareto front", "the paper's scheme", "projection: nonlinear",
        "velocity: transported, preimages: 0.01 dx", "samples: kept", "50 samples, as single marks"}
    paper = found["the paper's scheme"]
    assert paper.get_xdata() == pytest.approx([100.0, 200.0, 400.0])
    assert paper.get_ydata() == pytest.approx([0.2, 0.2, 0.1])
    assert (paper.get_linestyle(), found["projection: nonlinear"].get_linestyle()) == ("-", "None")
    assert [text.get_text() for text in tower[0].texts] == ["10", "50", "100", "10", "25"]
    assert found["50 samples, as single marks"].get_xydata() == pytest.approx(
        np.array([[200.0, 0.2]]))


def test_the_front_is_joined_in_order_of_its_cost(tower):
    assert lines(tower[0])["Pareto front"].get_xydata() == pytest.approx(
        np.array([[50.0, 0.4], [400.0, 0.1]]))


def test_ways_are_told_apart_without_colour(tower):
    marks = [line.get_marker() for line in tower[0].lines]
    assert len(set(marks)) == len(marks)


def test_torsion_is_by_density_beside_material_points(tower):
    found = lines(tower[1])
    assert found["Eulerian"].get_xydata() == pytest.approx(np.array([[1.0, 6.0], [2.0, 0.5]]))
    assert found["resampled"].get_ydata() == pytest.approx([0.3])
    assert found["Lagrangian: material points"].get_ydata() == pytest.approx([0.2, 0.2])


def test_small_differences_stay_small():
    ways = {name: 2 * [value] for name, value in USUAL.items()} | {"origin": [0.002, 0.0021]}
    for ax in ldm.draw(made(ways=ways, densities=DENSE)).axes:
        low, high = ax.get_ylim()
        assert high / low > 3.9


@pytest.fixture(scope="module")
def cost():
    """Axes of the parts of a step and of the runs until training has paid."""
    return ldm_cost.draw(made(parts=PARTS, pays=PAYS)).axes


def test_parts_are_stacked_to_the_whole(cost):
    stacks = cost[0].containers
    assert [bars.get_label() for bars in stacks] == [words for words, *_ in
                                                    ldm_cost.PARTS.values()]
    assert [bar.get_height() for bar in stacks[0]] == pytest.approx([50.0, 25.0, 100.0, 50.0])
    assert [bar.get_y() + bar.get_height() for bar in stacks[-1]] == pytest.approx(
        [100.0, 50.0, 200.0, 100.0])


def test_bars_are_told_by_way_and_size(cost):
    axis = cost[0].xaxis
    assert [text.get_text() for text in axis.get_ticklabels()] == 2 * ["paper", "cheap"]
    assert [text.get_text().strip() for text in axis.get_ticklabels(minor=True)] == [
        "34 thousand", "3.08 million"]
    assert axis.get_minorticklocs() == pytest.approx([0.5, 2.5])


def test_where_training_never_pays_is_said(cost):
    found = lines(cost[1])
    assert found["the transfer it was trained on"].get_xydata() == pytest.approx(
        np.array([[384e3, 64.0], [3.08e6, 6.0]]))
    assert found["the fastest transfer"].get_xydata() == pytest.approx(np.array([[3.08e6, 16.0]]))
    assert [(text.get_text(), text.get_position()[0]) for text in cost[1].texts] == [
        ("never", 34e3)]


def test_training_that_never_pays_at_all_is_drawn():
    pays = {"particles": [34e3], "runs_same": [np.inf], "runs": [np.inf]}
    ax = ldm_cost.draw(made(parts=PARTS, pays=pays)).axes[1]
    assert [text.get_text() for text in ax.texts] == ["never"]
    assert ax.get_ylim() == (1.0, 100.0)
