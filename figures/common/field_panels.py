"""NSF's state figures: a row for the full-order run and one for each reduced run, from left to
right by time.
"""

import numpy as np

from validation.ldm.published_bodies import read

from .bodies import Panel, View, body, no_balls, pictures, shades
from .state_panels import spacing

LABELS = {"true": "full order", "ours": "reduced", "map": "map alone",
         "weighed": "with weights"}
COLOURS = {"true": "#e9e9ec", "ours": "#e8b53d", "map": "#c46a5a", "weighed": "#7fb069"}
TOP = 0.98          # quantile of the stresses at which the colours end
ROOM = 0.4          # margin around the full-order runs, over their longest side


def reduced_and_full(results, experiment_id, runs=("true", "ours"), choice=slice(1), turn=25.0,
                     lift=15.0):
    """Draw the runs of an experiment at the chosen parameters, a row for each run. Points that are
    far from all full-order runs are left out.
    """
    bodies, contents = read(results.folder, experiment_id), []
    values = bodies["values"][choice]
    box = padded_box(np.concatenate([bodies[f"{value}_true"].reshape(-1, 3) for value in values]))
    for value in values:
        for run in runs:
            side = f"{value}: {LABELS[run]}"
            contents += time_row(bodies[f"{value}_{run}"], COLOURS[run], side, box)
    return pictures(contents, View(len(bodies["levels"]), 8.0, turn, lift))


def padded_box(x):
    """Return the corners (2, 3) of the box of points x (n, 3) with ROOM around it."""
    low, high = x.min(axis=0), x.max(axis=0)
    spare = ROOM * (high - low).max()
    return np.array([low - spare, high + spare])


def time_row(x, colour, side, box=(-np.inf, np.inf)):
    """Return the panels of points x (times, n, 3) of one colour, clipped to a box."""
    return [Panel(*clipped_body(one, colour, spacing(x[0]), box), "", "" if k else side)
            for k, one in enumerate(x)]


def clipped_body(x, colour, spacing_at_rest, box=(-np.inf, np.inf)):
    """Return opaque and translucent balls of the points x (n, 3) within the corners of a box; none
    of a run that broke down.
    """
    within = ((x >= box[0]) & (x <= box[1])).all(axis=1)
    if not np.isfinite(x).all() or not within.any():
        return no_balls(), no_balls()
    colour = colour if isinstance(colour, str) else colour[within]
    return body(x[within], colour, spacing_at_rest), no_balls()


def stress_panels(results, experiment_id, turn=25.0, lift=15.0):
    """Draw |tau| over time, full order above, reduced below."""
    bodies = read(results.folder, experiment_id)
    value = bodies["values"][0]
    runs = {run: (bodies[f"{value}_{run}"], bodies[f"{value}_{run}_tau"])
            for run in ("true", "ours")}
    top, contents = np.quantile(runs["true"][1], TOP), []
    for run, (x, tau) in runs.items():
        colours, colour_scale = shades(np.nan_to_num(tau), "viridis", top)
        distance = spacing(x[0])
        contents += [Panel(*clipped_body(one, colour, distance), "", "" if k else LABELS[run])
                     for k, (one, colour) in enumerate(zip(x, colours, strict=True))]
    view = View(len(bodies["levels"]), 8.0, turn, lift)
    return pictures(contents, view, colour_scale, r"$|\tau|$")


def training_range(results, experiment_id, turn=25.0, lift=15.0):
    """Draw the training runs at both ends of the range of parameters."""
    bodies = read(results.folder, experiment_id)
    contents = [panel for end in ("first", "last")
                for panel in time_row(bodies[end], COLOURS["true"], f"{end} of training")]
    return pictures(contents, View(len(bodies["levels"]), 8.0, turn, lift))
