"""LDM's figures, drawn from small made-up results."""

import csv
import json

import matplotlib as mpl
import numpy as np
import pytest

from figures.common import state_panels
from figures.common.bodies import body, flattened, no_balls, shades, side_by_side
from figures.common.schemes import MARKS
from figures.ldm import fig04, fig06, fig07, fig10, fig11, fig12, fig13, fig14, fig15, fig16
from figures.ldmw import fig01, tables
from validation.common.results import ProfileResults
from validation.common.targets import load
from validation.ldm.published_bodies import file_of

mpl.use("Agg")
SCHEMES = ("lagrangian_nonlinear", "eulerian_nonlinear", "lagrangian_linear", "eulerian_linear")
LOSSES = {1: ("both",), 4: ("both",), 7: ("both", "no-F", "no-v", "neither")}
GRID = np.stack(np.meshgrid(*3 * (np.arange(4.0),), indexing="ij"), axis=-1).reshape(-1, 3)
STATES = {
    "ldm.fig4": {"X": GRID, "samples": np.array([0, 3, 20]),
                 "held": np.array([(True, False, False), (False, True, False)])},
    "ldm.fig6": {"X": GRID, "g": np.array([1, 5, 10]),
                 "reduced": np.stack([GRID, GRID + 0.1, GRID + 0.2])},
    "ldm.fig11": {"X": GRID, "reduced": GRID + 0.1, "full": GRID},
    "ldm.fig12": {"tracers": GRID + 0.1, "low": GRID[::2], "reduced": GRID, "full": GRID},
    "ldm.fig13": {"X": GRID, "t": np.array([0.0, 0.25, 3.0]),
                  "reduced": np.stack([GRID, GRID + 0.2, GRID]), "full": np.stack(3 * [GRID])},
    "ldm.fig15": {"X": GRID, "t": np.array([0.0, 1.67, 3.33]),
                  "mu": np.array([(0.66, 1.4, -0.9), (0.75, 1.1, -0.5)]),
                  "reduced": np.zeros((2, 2, 1, 1)) + GRID, "full": np.zeros((2, 2, 1, 1)) + GRID},
    "ldmw.fig1": {"X": GRID, "mu": np.array([(1.0, 4.5, 12.5), (1.2, 9.0, 15.0)]),
                  "reduced": np.stack([GRID + 0.1, GRID + 0.2]), "full": np.stack(2 * [GRID])}}
DRAWN = {"ldm.fig4": (fig04, 2), "ldm.fig6": (fig06, 3), "ldm.fig11": (fig11, 3),
         "ldm.fig12": (fig12, 4), "ldm.fig13": (fig13, 6), "ldm.fig15": (fig15, 6),
         "ldmw.fig1": (fig01, 4)}


@pytest.fixture
def results(tmp_path):
    return ProfileResults(tmp_path)


def recorded(results, id, *targets, **more):
    """Write records of an experiment, of the value 0.5 each."""
    rows = [{"target": target, "value": 0.5, "unit": "%", "scale": "3 particles, one run",
             "seconds": 1.0, "seed": 0, "command": "", "commit": "", "date": "", "cores": 1, **more}
            for target in targets]
    (results.folder / f"{id}.json").write_text(json.dumps(rows))


def table(results, id, name, columns, rows):
    with open(results.folder / f"{id}.{name}.csv", "w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])


def lines(ax):
    """{label: line} of what a legend shows."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


# States

@pytest.mark.parametrize("id", STATES)
def test_states_are_drawn_from_what_is_kept(results, id, monkeypatch):
    monkeypatch.setattr(state_panels, "PIXELS", 60)
    script, panels = DRAWN[id]
    file_of(results.folder, id).parent.mkdir()
    np.savez(file_of(results.folder, id), **STATES[id])
    figure = script.draw(results)
    pictures = [ax.images[0].get_array() for ax in figure.axes if ax.images]
    assert len(pictures) == panels
    assert all(picture.min() < 0.9 for picture in pictures)     # something is on the white


@pytest.mark.parametrize("id", STATES)
def test_states_that_are_not_here_say_so(results, id):
    with pytest.raises(FileNotFoundError, match=f"run {id} again"):
        DRAWN[id][0].draw(results)


def test_bodies_stand_upright():
    view = fig15.VIEW._replace(lift=0.0)
    axes = state_panels.fitted_camera([body(GRID, "w", 1.0)], view).axes
    assert body(np.array([(0.0, 0.0, 1.0)]), "w", 1.0).x @ axes[1] == pytest.approx(1.0)
    assert np.linalg.det(body(np.eye(3), "w", 1.0).x) == pytest.approx(1.0)     # no mirror


def test_second_body_is_beside_the_first():
    view, one = fig15.VIEW, body(GRID, "w", 1.0)
    both = side_by_side(one, one, view)
    along = both.x @ state_panels.fitted_camera([one], view).axes[0]
    assert len(both.x) == 2 * len(GRID)
    assert along[:len(GRID)].max() < along[len(GRID):].min()


def test_levelled_balls_keep_their_places_in_the_picture():
    view, balls = fig15.VIEW, body(GRID, "w", 1.0)
    axes = state_panels.fitted_camera([balls], view).axes
    flat = flattened(balls, view)
    np.testing.assert_allclose(flat.x @ axes[:2].T, balls.x @ axes[:2].T, atol=1e-12)
    assert np.ptp(flat.x @ axes[2]) < 0.01 * np.ptp(balls.x @ axes[2])


def test_colours_go_from_nothing_to_the_largest():
    paint, shown = shades(np.array([[0.0, 2.0], [1.0, 4.0]]))
    assert paint.shape == (2, 2, 3)
    assert shown.get_clim() == (0.0, 4.0)
    np.testing.assert_allclose(paint[0, 0], mpl.colormaps["viridis"](0.0)[:3])
    assert len(no_balls().x) == 0


def test_cubes_have_two_colours_and_turn_at_their_faces():
    X = np.array([(0.1, 0.1, 0.1), (0.9, 0.1, 0.1), (1.3, 0.1, 0.1), (1.3, 1.2, 0.1),
                  (0.0, 0.0, 0.0), (0.0, 0.0, 4.0)])
    paint = fig11.chequered(X)
    assert (paint[0] == paint[1]).all()
    assert (paint[0] != paint[2]).any()
    assert (paint[0] == paint[3]).all()


def test_motions_of_the_tower_are_told():
    assert fig15.velocity_text(0.75, np.pi / 3, -np.pi / 6) == "0.75 m/s, 60°, \N{MINUS SIGN}30°"


# Curves

def test_fig10_has_a_curve_of_each_loss_and_marks_what_broke(results):
    table(results, "ldm.fig10", "errors",
          ("scheme", "points", "r", "loss", "origin", "centroid", "displacement"),
          [(scheme, points, r, loss, "inf" if points < 10 and r == 4 else r / points, 0.1, 0.2)
           for scheme in SCHEMES for r, losses in LOSSES.items() for loss in losses
           for points in (100, -(-r // 3), 10)])
    figure = fig10.draw(results)
    assert [ax.get_title()[:3] for ax in figure.axes] == ["(a)", "(b)", "(c)", "(d)"]
    for ax in figure.axes:
        found = lines(ax)
        assert len(found) == 6
        assert found["r = 7, without v"].get_xdata().tolist() == [3.0, 10.0, 100.0]
        assert found["r = 7, without v"].get_ydata() == pytest.approx([700 / 3, 70.0, 7.0])
        crosses = [line for line in ax.lines if line.get_marker() == "x"]
        assert [x for line in crosses for x in line.get_xdata()] == [2.0]
        assert np.isnan(found["r = 4, F and v"].get_ydata()[0])


WAYS = ("particles", "quadrature", "projection", "points", "per_cell", "precision", "wall_full",
        "wall_fastest", "wall_per_second", "speed_up", "origin", "new")


def of_sizes(sizes):
    """Rows of a table of ways by size, with a column that is not known yet, and a broken run."""
    schemes = [(*name.split("_"), 2, "double") for name in SCHEMES]
    schemes += [("resampled", "linear", k, "double") for k in (1, 2)]
    schemes += [(quadrature, "linear", 2, "single") for quadrature in ("eulerian", "resampled")]
    return [(n, quadrature, projection, points, per_cell, precision, 2.0, 1.0,
             24.0 * min(wall, 1.0), 2.0 / wall, "inf" if wall == np.inf else 0.01 / points, "?")
            for n in sizes for points in (25, 50)
            for quadrature, projection, per_cell, precision in schemes
            for wall in [np.inf if quadrature == "eulerian" and points == 25 else points / 100]]


def runs(ax):
    """{label: line} of the runs, which the legend explains by their parts."""
    return {line.get_label()[1:]: line for line in ax.lines if "samples" in line.get_label()[1:]
            and line.get_label().startswith("_")}


def test_fig16_has_a_panel_for_each_size(results):
    table(results, "ldm.fig16", "ways", WAYS, of_sizes((34, 3085)))
    figure = fig16.draw(results)
    assert [ax.get_title() for ax in figure.axes] == ["34 particles", "3 085 particles"]
    for ax in figure.axes:
        found = lines(ax)
        assert found["real time"].get_xdata() == [1.0, 1.0]
        assert found["full model"].get_xdata() == pytest.approx([48.0, 48.0])
        assert found["full model, fastest transfer"].get_xdata() == pytest.approx([24.0, 24.0])
        own = runs(ax)["Lagrangian, linear, 50 samples"]
        assert own.get_xdata() == pytest.approx([12.0])
        assert own.get_ydata() == pytest.approx([0.02])
        assert len(runs(ax)["Eulerian, linear, 25 samples"].get_xdata()) == 0
        crosses = [line for line in ax.lines if line.get_marker() == "x"]
        assert len(crosses) == 3                    # of runs that broke down, at the top
        assert {tuple(line.get_ydata()) for line in crosses} == {(1.0,)}


def test_fig16_tells_ways_apart(results):
    table(results, "ldm.fig16", "ways", WAYS, of_sizes((34,)))
    ax = fig16.draw(results).axes[0]
    found = [*runs(ax).values()]
    looks = {(line.get_marker(), line.get_color(), line.get_fillstyle()) for line in found}
    assert len(looks) == len(found) == 16
    assert not {fig16.label_and_marker("resampled_linear", k)[1] for k in (1, 2)} & {
        mark for _, mark in MARKS.values()}


def test_fig07_has_colours_up_to_the_largest_error(results):
    """Logarithmic, so that none of the cells is beyond the scale."""
    rows = [(scheme, F, v, 1e-5 * (1 + 9 * F + 90 * v)) for scheme in SCHEMES
            for F in (True, False) for v in (True, False)]
    table(results, "ldm.fig7", "errors", ("scheme", "F", "v", "origin"), rows)
    *cells, bar = fig07.draw(results).axes
    assert [ax.get_title()[:3] for ax in cells] == ["(a)", "(b)", "(c)", "(d)"]
    image = cells[0].images[0]
    assert np.asarray(image.get_array()) == pytest.approx(
        np.array([[0.001, 0.01], [0.091, 0.1]]))
    assert image.get_clim() == pytest.approx((0.001, 0.3))
    assert list(bar.lines[-1].get_ydata()) == [fig07.PRINTED] * 2


def test_fig14_numbers_steps_that_are_apart(results):
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    recorded(results, "ldm.fig13", "ldm.fig13.error", "ldm.fig14.return", "ldm.fig14.plane")
    table(results, "ldm.fig13", "latent", ("step", "t", "pc1", "pc2", "driven"),
          [(k, 0.1 * k, np.cos(a), np.sin(a), int(k <= 12)) for k, a in enumerate(turn)])
    ax = fig14.draw(results).axes[0]
    said = sorted(int(text.get_text()) for text in ax.texts)
    assert said[:2] == [0, 12]
    places = np.array([(np.cos(turn[k]), np.sin(turn[k])) for k in said]) / 2.0
    gaps = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(len(said), 1)]
    assert 10 < len(said) < 2.0 * np.pi / 2.0 / fig14.SPACING
    assert gaps.min() > fig14.SPACING
    assert len(lines(ax)["driven"].get_xdata()) == 13
    assert "50 % of the variance" in fig14.scale(results)


def test_pokes_of_the_workshop_are_told_with_their_errors(results):
    recorded(results, "ldmw.fig1", "ldmw.fig1.error.1.position", "ldmw.fig1.error.1.velocity",
             "ldmw.fig1.error.2.position")
    assert fig01.scale(results) == (
        "3 particles, one run; position errors 0.5, 0.5 % from left to right")
    assert fig01.poked(1.25, 0.0, 15.0) == (
        r"$\rho$ = 1.2 R, $\theta$ = 0.0°, $\phi$ = 15.0°")


def test_fig16_needs_no_precision(results):
    table(results, "ldm.fig16", "ways", [name if name != "precision" else "other" for name in WAYS],
          of_sizes((34,)))
    ax = fig16.draw(results).axes[0]
    assert {line.get_fillstyle() for line in runs(ax).values()} == {"none"}
    assert "filled: single precision" not in lines(ax)


def test_workshop_tables_stand_beside_what_is_printed(results):
    for id, rows in tables.ROWS.items():
        recorded(results, id, *(f"{id}.{row}.{field}" for row in rows
                                for field in tables.FIELDS))
    for ax, id in zip(tables.draw(results).axes, tables.NEEDS, strict=True):
        found, rows = lines(ax), len(tables.ROWS[id])
        assert set(found) == {"position", "velocity", "deformation gradient"}
        assert found["velocity"].get_ydata() == pytest.approx([0.5] * rows)
        bars = [line for line in ax.lines if line.get_label().startswith("_")]
        printed = [load()[f"{id}.{row}.{field}"].value for field in tables.FIELDS
                   for row in tables.ROWS[id]]
        assert [list(line.get_ydata()) for line in bars] == [[one, one] for one in printed]
        assert len(ax.texts) == 3 * rows            # arrows: printed as the most
