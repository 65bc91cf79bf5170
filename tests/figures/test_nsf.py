"""Figures of NSF's trade and extremes, drawn from small made-up tables."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.extremes import nsf as extremes_nsf
from figures.trade import nsf as trade_nsf
from mpm_ref.rom.extrapolation import BEYOND
from validation.extremes.ldm_runs import BAD

mpl.use("Agg")
SAMPLES = {"scene": 4 * ["jelly"] + ["metal"], "fields": ["random", "random", "cubature", "random",
                                                         "random"],
           "samples": [10, 10, 10, 90, 40], "origin": [0.002, 0.004, 0.001, 0.0005, np.inf]}
STEPS = {"scene": ["jelly", "jelly", "metal", "jelly"], "faster": [1.0, 2.0, 1.0, 4.0],
         "origin": [0.002, 0.003, 0.001, np.inf]}
RUNS = {"model": ["jelly", "jelly", "metal"], "what": [0.4, 1.0, 5.0], "usual": [2.0, 2.0, 1.0],
        "error": [2.0, 30.0, np.inf], "beyond": [0.2, 2.0, 9.0]}
RATES = {"bound": [0.5, 1.0], "false_alarms": [0.5, 0.0], "misses": [0.0, 0.25]}


def axes_of(script, **tables):
    """Axes of a figure of tables by name."""
    columns = {name: {column: np.array(values) for column, values in table.items()}
               for name, table in tables.items()}
    return script.draw(SimpleNamespace(table=lambda id, name: columns[name])).axes


@pytest.fixture
def trade():
    """Axes by samples and by steps."""
    return axes_of(trade_nsf, samples=SAMPLES, steps=STEPS)


@pytest.fixture
def extremes():
    """Axes of runs and of rates."""
    return axes_of(extremes_nsf, runs=RUNS, rates=RATES)


def labelled(ax):
    """{label: what a legend shows}."""
    return dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))


def test_draws_are_a_mean_with_a_bar(trade):
    found = labelled(trade[0])
    line, _, (bars,) = found["jelly, random"].lines
    assert line.get_xydata() == pytest.approx(np.array([[10.0, 0.3]]))
    assert bars.get_segments()[0][:, 1] == pytest.approx([0.2, 0.4])
    assert found["jelly, cubature"].lines[0].get_ydata() == pytest.approx([0.1])


def test_all_particles_are_a_line(trade):
    found = labelled(trade[0])
    assert found["jelly, all 90 particles"].get_ydata() == pytest.approx([0.05, 0.05])
    assert "metal, all 40 particles" in found


def test_runs_that_broke_down_are_left_out(trade):
    jelly, metal = (container.lines[0] for container in trade[1].containers)
    assert jelly.get_xydata() == pytest.approx(np.array([[1.0, 0.2], [2.0, 0.3]]))
    assert metal.get_xydata() == pytest.approx(np.array([[1.0, 0.1]]))


def test_runs_stand_by_their_distance_with_their_parameter(extremes):
    jelly, metal = (labelled(extremes[0])[name] for name in ("jelly", "metal"))
    assert jelly.get_xydata() == pytest.approx(np.array([[0.2, 1.0], [2.0, 15.0]]))
    assert len(metal.get_xydata()) == 0
    assert [text.get_text() for text in extremes[0].texts] == ["1"]     # bad, and flagged


def test_the_bounds_are_those_of_the_watch(extremes):
    level, upright = extremes[0].lines[-2:]
    assert list(level.get_ydata()) == [BAD, BAD]
    assert list(upright.get_xdata()) == [BEYOND, BEYOND]


def test_rates_are_by_the_bound(extremes):
    found = labelled(extremes[1])
    assert found["good, and flagged"].get_ydata() == pytest.approx([0.5, 0.0])
    assert found["bad, and neither flagged nor stopped"].get_xydata() == pytest.approx(
        np.array([[0.5, 0.0], [1.0, 0.25]]))
