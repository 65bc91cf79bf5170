"""NSF's state figures: full-order runs and reduced ones, at several times or for several values of
the parameter.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from validation.ldm.published_bodies import read

from .bodies import (
    Panel,
    View,
    body,
    failure_note,
    inside,
    no_balls,
    padded_box,
    pictures,
    shades,
)

LABELS = {"true": "full order", "ours": "reduced", "map": "map alone", "weighed": "with weights"}
COLOURS = {"true": "#e9e9ec", "ours": "#e8b53d", "map": "#c46a5a", "weighed": "#7fb069"}
TOP = 0.98          # quantile of the stresses at which the colours end
NEIGHBOURS = 6      # among which points of a body that was thinned out are half as far on average
EVERYWHERE = (-np.inf, np.inf)


class RunView(NamedTuple):
    """The runs that a figure shows, and its camera: the id of their experiment, their study, and
    the label of a run ("{}": the value of its parameter).
    """

    experiment: str
    study: object           # function of `validation.nsf.studies`
    label: str = "{}"
    turn: float = 25.0
    lift: float = 15.0


def reduced_and_full(results, shown, runs=("true", "ours"), choice=slice(1)):
    """Draw the runs at the chosen parameters over time, a row for each. Points that are far from
    all full-order runs are left out; a note says how many.
    """
    bodies, contents = read(results.folder, shown.experiment), []
    values = bodies["values"][choice]
    box = box_of_full_order(bodies, values)
    for value in values:
        for run in runs:
            label = shown.label.format(value)
            contents += time_row(bodies[f"{value}_{run}"], COLOURS[run],
                                 f"{label}\n{LABELS[run]}" if run == "true" else LABELS[run], box)
    return over_time(contents, bodies["levels"], shown)


def ends_by_value(results, shown, runs=("true", "ours")):
    """Draw the ends of the runs, a column for each parameter and a row for each kind of run."""
    bodies, contents = read(results.folder, shown.experiment), []
    values, end = bodies["values"], f"t = {end_of(shown.study):.2g} s"
    box = box_of_full_order(bodies, values)
    for run in runs:
        for value in values:
            x = bodies[f"{value}_{run}"]
            title = f"{shown.label.format(value)}, {end}" if run == runs[0] else ""
            contents.append(clipped_panel(x[-1], COLOURS[run], spread(x[0]), box)._replace(
                title=title, side=LABELS[run] if value == values[0] else ""))
    return pictures(contents, View(len(values), shown.turn, shown.lift))


def stress_panels(results, shown):
    """Draw |tau| over time, full order above, reduced below."""
    bodies = read(results.folder, shown.experiment)
    value = bodies["values"][0]
    runs = {run: (bodies[f"{value}_{run}"], bodies[f"{value}_{run}_tau"])
            for run in ("true", "ours")}
    top, contents = np.quantile(runs["true"][1], TOP), []
    for run, (x, tau) in runs.items():
        colours, colour_scale = shades(np.nan_to_num(tau), "viridis", top)
        distance = spread(x[0])
        side = LABELS[run] if contents else f"{shown.label.format(value)}\n{LABELS[run]}"
        contents += [clipped_panel(one, colour, distance)._replace(side="" if k else side)
                     for k, (one, colour) in enumerate(zip(x, colours, strict=True))]
    return over_time(contents, bodies["levels"], shown, colour_scale, r"$|\tau|$ [Pa]")


def training_range(results, shown):
    """Draw the training runs at both ends of the range of parameters."""
    bodies, train = read(results.folder, shown.experiment), shown.study().train
    contents = [panel for end, value in (("first", train[0]), ("last", train[-1]))
                for panel in time_row(bodies[end], COLOURS["true"],
                                      shown.label.format(f"{value:g}"))]
    return over_time(contents, bodies["levels"], shown)


def over_time(contents, levels, shown, colour_scale=None, label=""):
    """Draw rows of panels whose columns are the times of stored levels, which stand above."""
    times = levels / levels[-1] * end_of(shown.study)
    titled = [panel._replace(title=f"t = {t:.2g} s")
              for panel, t in zip(contents, times, strict=False)]
    return pictures(titled + contents[len(titled):], View(len(times), shown.turn, shown.lift),
                    colour_scale, label)


def end_of(study):
    """Return the time [s] at which the runs of a study end."""
    one = study()
    scene = one.run(one.test[0])
    return scene.steps * scene.dt


def box_of_full_order(bodies, values):
    """Return the corners (2, 3) of a box around all full-order runs."""
    return padded_box(np.concatenate([bodies[f"{value}_true"].reshape(-1, 3) for value in values]))


def time_row(x, colour, side, box=EVERYWHERE):
    """Return the panels of points x (times, n, 3) of one colour, clipped to a box."""
    return [clipped_panel(one, colour, spread(x[0]), box)._replace(side="" if k else side)
            for k, one in enumerate(x)]


def clipped_panel(x, colour, distance, box=EVERYWHERE):
    """Return the panel of points x (n, 3) within the corners of a box, with a note on the others;
    without points for a run that broke down.
    """
    shown = inside(x, box) & np.isfinite(x).all()
    colour = colour if isinstance(colour, str) else colour[shown]
    solid = body(x[shown], colour, distance) if shown.any() else no_balls()
    return Panel(solid, no_balls(), note=failure_note(x, shown))


def spread(x):
    """Return the distance between points x (n, 3) that were taken out of a body in rows: half the
    median distance of the far ones among the nearest neighbours, at least that of the nearest [m].
    """
    far = np.median(cKDTree(x).query(x, 1 + NEIGHBOURS)[0], axis=0)
    return float(max(far[1], far[-1] / 2.0))
