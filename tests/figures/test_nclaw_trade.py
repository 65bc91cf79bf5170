"""Figures of NCLaw's trade and extremes, drawn from small made-up tables."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.common.training_errors import differences
from figures.extremes import nclaw as extremes_nclaw
from figures.extremes import nclaw_epochs
from figures.trade import nclaw as trade_nclaw
from figures.trade import nclaw_inference
from mpm_ref.nclaw.strain_watch import MAX_EXCESS
from validation.extremes.nclaw_runs import BAD
from validation.nclaw.observation import Observation
from validation.nclaw.small_trainings import BASE, SEEDS, small_nets

mpl.use("Agg")


def trainings(names, sizes, **changes):
    """A table of small trainings by name, whose errors are counted up from 1."""
    nets = [small_nets()[name] for name in names]
    own = 1.0 + np.arange(len(names))
    columns = {key: [getattr(net, key) for net in nets] for key in sizes}
    return {"name": [*names], "epoch": [net.epochs for net in nets], "cpu": 10.0 * own, "own": own,
            "thrown": 2.0 * own, "full": np.nan * own, "pareto": [1.0] * len(names), **columns,
            **changes}


def sights(names, keys):
    """The same, of what is seen."""
    return trainings(names, (), **{
        key: [getattr(small_nets()[name].observation, key) for name in names] for key in keys})


def axes_of(script, **tables):
    """Axes of a figure of tables by id; their entries as they come from a file."""
    def table(id, name):
        found = {column: np.array(values) for column, values in tables[id].items()}
        return {column: a.astype(str) if a.dtype == bool else a for column, a in found.items()}

    short = {id: id.split(".")[-1] for id in script.NEEDS}
    return script.draw(SimpleNamespace(table=lambda id, name: table(
        f"{short[id]}_{name}", name))).axes


def labelled(ax):
    """{label: what a legend shows}."""
    return dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))


SIZES = ("environment", "edge", "cells", "epochs", "first", "last", "seed")
WIDTHS = {"width": [64.0, 8.0], "cpu_point": [4e-6, 1e-6], "true_cpu_point": [2e-7, 2e-7],
          "own": [1.0, 2.0], "thrown": [3.0, np.inf]}


@pytest.fixture
def trade():
    """Axes of trainings, sights and widths."""
    names = (*SEEDS[:2], "small-horizon-25", "small-full-30", *3 * ["small-sand-epochs"])
    return axes_of(
        trade_nclaw, training_trainings=trainings(
            names, SIZES, epoch=[100, 100, 100, 30, 10, 20, 300], full=[np.nan] * 3 + [9.0] * 4),
        sight_trainings=sights((*SEEDS[:2], "small-third", "small-positions-noise-4"),
                               ("every", "share", "noise", "positions")), width_widths=WIDTHS)


def test_trainings_are_told_by_what_they_differ_in(trade):
    found = labelled(trade[0])
    assert found["6³ points, 10 cells, 100 epochs, horizon to 200"].get_marker() == "*"
    assert found["horizon to 25"].get_xydata() == pytest.approx(np.array([[30.0, 3.0]]))
    assert found["10³ points, 20 cells, 30 epochs"].get_ydata() == pytest.approx([9.0])
    assert sum(line.get_marker() == "*" for line in trade[0].lines) == 2


def test_runs_that_broke_down_are_crosses_at_the_edge_of_large_errors():
    """A cross at its CPU time, or in its row."""
    names = (SEEDS[0], "small-horizon-25", *3 * ["small-sand-epochs"])
    left, middle, right = axes_of(
        trade_nclaw, training_trainings=trainings(
            names, SIZES, epoch=[100, 100, 10, 20, 300], full=[1.0, 2.0, 3.0, np.inf, np.inf]),
        sight_trainings=sights((*SEEDS[:2], "small-third", "small-positions"),
                               ("every", "share", "noise", "positions"))
        | {"own": [1.0, 2.0, 3.0, np.inf]}, width_widths=WIDTHS | {"own": [np.inf, 2.0]})
    assert crosses(left) == [(40.0, 1.0), (50.0, 1.0)]
    assert crosses(middle) == [(1.0, 1.0)]
    assert crosses(right) == [(4.0, 1.0)]


def crosses(ax):
    """Places of the crosses."""
    return [tuple(np.ravel(line.get_xydata())) for line in ax.lines if line.get_marker() == "x"
            and line.get_transform() != ax.transData]


def test_kept_epochs_are_a_curve(trade):
    assert labelled(trade[0])["sand, by epochs"].get_ydata() == pytest.approx([9.0] * 3)
    assert [text.get_text() for text in trade[0].texts] == ["10", "20", "300"]


def test_what_is_seen_is_in_words_beside_a_band_of_seeds(trade):
    assert [text.get_text() for text in trade[1].get_yticklabels()] == [
        "0.33 of the points", "positions only, 0.0001 m of noise"]
    band, = trade[1].patches
    assert band.get_extents().transformed(trade[1].transData.inverted()).x0 == pytest.approx(1.0)
    assert labelled(trade[1])["on the training run"].get_xdata() == pytest.approx(
        [3.0, 4.0])
    assert labelled(trade[1])["thrown differently"].get_xdata() == pytest.approx([6.0, 8.0])


def test_all_is_seen_by_default():
    columns = {"every": [1.0], "share": [1.0], "noise": [0.0], "positions": ["False"]}
    assert differences(columns, 0, trade_nclaw.OBSERVATIONS, Observation()) == ""
    columns["positions"] = ["True"]
    assert differences(columns, 0, trade_nclaw.OBSERVATIONS, Observation()) == "positions only"


def test_widths_are_in_order(trade):
    line = labelled(trade[2])["on the training run"]
    assert line.get_xydata() == pytest.approx(np.array([[1.0, 2.0], [4.0, 1.0]]))
    assert [text.get_text() for text in trade[2].texts] == ["8", "64"]
    assert list(labelled(trade[2])["the true laws"].get_xdata()) == pytest.approx([0.2, 0.2])


def test_steps_stand_by_their_cost():
    steps = {"environment": ["jelly"] * 3, "factor": [1.0, 2.0, 10.0], "cpu": [4.0, 2.0, 0.2],
             "error": [2e-4, 1e-4, np.inf], "true_cpu": [0.4, 0.2, 0.1],
             "true_error": [0.0, 2e-5, np.inf], "pareto": [0, 1, 0]}
    digits = {"environment": ["jelly"] * 2, "bits": [53, 8], "error": [2e-4, 3e-4]}
    left, right = axes_of(nclaw_inference, dt_steps=steps, digits_digits=digits)
    assert labelled(left)["jelly, learned"].get_ydata()[:2] == pytest.approx([2e-4, 1e-4])
    assert labelled(left)["jelly, true laws"].get_xdata()[0] == pytest.approx(0.2)
    assert [text.get_text() for text in left.texts] == ["1", "2", "2"]
    assert labelled(right)["jelly"].get_xydata() == pytest.approx(
        np.array([[53.0, 2e-4], [8.0, 3e-4]]))


def runs(law, what, **changes):
    """A table of runs of laws."""
    n = len(what)
    return {"law": law, "what": what, "usual": [2.0] * n, "error": [2.0, *[8.0] * (n - 1)],
            "beyond": [0.0] * n, "flags": [""] * n, "lost": [-1] * n, **changes}


@pytest.fixture
def extremes():
    """Axes of strains, rates, densities and steps."""
    return axes_of(
        extremes_nclaw,
        strain_runs=runs(["jelly", "jelly", "sand"], ["as trained", "velocity 7", "velocity 7"],
                         beyond=[0.0, 2.0, 3.0], error=[2.0, 8.0, np.inf]),
        strain_rates={"laws": [*3 * ["chosen"], "other"], "error": [3.0, 3.0, 5.0, 3.0],
                      "beyond": [0.0, 1.0, 0.0, 0.0], "bad": [4, 4, 0, 0], "misses": [0, 1, 0, 0],
                      "good": [5, 5, 9, 2], "false_alarms": [5, 0, 9, 1]},
        density_runs=runs(["jelly"] * 3, ["as trained", "0.2 times as dense", "5 times as dense"],
                          flags=["", "", "strain"]),
        dt_runs=runs(["sand"] * 2, ["1 dt", "0.25 dt"], flags=["", "dt"]))


def test_runs_stand_by_how_far_they_leave_the_training(extremes):
    found = labelled(extremes[0])
    assert found["jelly"].get_xydata() == pytest.approx(np.array([[0.0, 1.0], [2.0, 4.0]]))
    assert len(found["sand"].get_xydata()) == 0
    level, upright = extremes[0].lines[-2:]
    assert list(level.get_ydata()) == [BAD, BAD]
    assert list(upright.get_xdata()) == [MAX_EXCESS, MAX_EXCESS]


def test_rates_are_shares_of_good_and_of_bad_runs(extremes):
    found = labelled(extremes[1])
    assert found["good, and flagged"].get_xydata() == pytest.approx(
        np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert found["bad, and not flagged"].get_ydata() == pytest.approx([0.0, 0.25])
    assert found["good, and flagged: other laws"].get_ydata() == pytest.approx([0.5])
    assert found["bad, and not flagged: other laws"].get_ydata() == pytest.approx([0.0])


def test_densities_and_steps_are_in_order_and_flagged_runs_full(extremes):
    curve, told = extremes[2].lines[:2]
    assert curve.get_xydata() == pytest.approx(np.array([[0.2, 4.0], [1.0, 1.0], [5.0, 4.0]]))
    assert told.get_xydata() == pytest.approx(np.array([[5.0, 4.0]]))
    assert extremes[3].lines[1].get_xydata() == pytest.approx(np.array([[0.25, 4.0]]))


def test_unfinished_trainings_are_by_epoch_and_faults_in_words():
    table = runs(["jelly after 300", "jelly after 10", "jelly after 20", "water after 10"],
                 ["as trained"] * 4, lost=[-1, 40, 60, -1], error=[1.0, 2.0, np.inf, 3.0])
    seen = sights((BASE, "small-gap-100"), ("gap", "outliers"))
    density = trainings(("small-density-2",), (), gap=[0], outliers=[0.0], own=[7.0])
    faults = {key: [*seen[key], *density[key]] for key in seen}
    first, second, last = axes_of(nclaw_epochs, epochs_runs=table, observed_trainings={
        **faults, "density": [1.0, 1.0, 2.0]})
    curve, lost, broken = first.lines
    assert curve.get_xydata() == pytest.approx(np.array([[10.0, 2.0], [300.0, 1.0]]))
    assert list(lost.get_xdata()) == [10.0]
    assert broken.get_xydata() == pytest.approx(np.array([[20.0, 1.0]]))
    assert second.get_title() == "water, beyond the horizon"
    assert [text.get_text() for text in last.get_yticklabels()] == [
        "100 steps without frames", "2 times the density"]
