"""NCLaw, Figure 2 (a) and (b): ends of runs for longer, and thrown otherwise; from left to right
the start, the truth, ours, baselines as far as they are trained, ours before training (a thin layer
on the floor, or broken down). Colours: distance from the truth; grey: the start. A picture has the
place where the start, the truth and ours are; a note says what share of the points left it.
"""

import numpy as np
from matplotlib.colors import to_rgb

from validation.ldm.published_bodies import read

from ..common.bodies import (
    GHOST,
    Panel,
    View,
    distance_to,
    failure_note,
    inside,
    no_balls,
    padded_box,
    pictures,
    shades,
)
from ..common.law_panels import TITLES, available, with_end_times
from ..common.state_panels import cloud, spacing
from ..common.style import shared_scale

NEEDS = ["nclaw.fig2"]
NAMES = ("jelly", "sand", "plasticine", "water")
TASKS = {"time": "longer", "velocity": "thrown"}
WORDS = ("start", "true", "ours", "neural", "gnn", "init")
SHOWN = ("start", "true", "ours")       # decide what a picture shows
BOTTOM, TOP = 1e-3, 0.3                 # ends of the colours [m]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states, panels = read(results.folder, NEEDS[0]), []
    rows = with_end_times(results, NEEDS[0], {
        f"{name}_{task}": f"{name}, {label}" for task, label in TASKS.items() for name in NAMES})
    words = available(states, rows, WORDS)
    box = padded_box(np.concatenate([finite(states[f"{row}_{word}"]) for row in rows
                                     for word in SHOWN]), room=0.02)
    for row, label in rows.items():
        for word in words:
            title = "" if panels[len(words) - 1:] else TITLES[word]
            panels.append(body_panel(states, (row, word), box)._replace(
                side=label if word == words[0] else "", title=title))
    shown = shades(np.zeros(1), "viridis", TOP, BOTTOM)[1]
    return pictures(panels, View(len(words)), shown, "distance from the truth [m]")


def finite(x):
    """Return the finite ones of points x (n, 3)."""
    return x[np.isfinite(x).all(axis=1)].astype(float)


def body_panel(states, which, box):
    """Return the panel of a law in a row, which = (row, law), within a box; its note says what is
    missing.
    """
    row, word = which
    if f"{row}_{word}" not in states:
        return Panel(no_balls(), no_balls(), note="not trained")
    x, true = (states[f"{row}_{of}"].astype(float) for of in (word, "true"))
    shown = inside(x, box) & np.isfinite(x).all()
    if not shown.any():
        return Panel(no_balls(), no_balls(), note=failure_note(x, shown))
    paint = shades(distance_to(x, true), "viridis", TOP, BOTTOM)[0]
    if word == "start":
        paint[:] = to_rgb(GHOST)
    balls = cloud(x[shown], np.zeros(shown.sum()), paint[shown], spacing(true))
    return Panel(balls, no_balls(), note=failure_note(x, shown))
