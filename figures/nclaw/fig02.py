"""NCLaw, Figure 2 (a) and (b): ends of runs for longer, and thrown otherwise; from left to right
the start, the truth, ours, baselines as far as they are trained, ours before training (a thin layer
on the floor, or broken down). Colours: distance from the truth; grey: the start.
"""

import numpy as np
from matplotlib.colors import to_rgb

from validation.ldm.published_bodies import read

from ..common.bodies import GHOST, Panel, View, distance_to, no_balls, pictures, shades
from ..common.law_panels import TITLES, available, panel_title
from ..common.state_panels import cloud, spacing
from ..common.style import shared_scale

NEEDS = ["nclaw.fig2"]
NAMES = ("jelly", "sand", "plasticine", "water")
TASKS = {"time": "longer", "velocity": "thrown otherwise"}
WORDS = ("start", "true", "ours", "neural", "gnn", "init")
TOP = 0.3           # end of the colours [m]


def scale(results):
    return shared_scale(results, NEEDS[0])


def draw(results):
    states, panels = read(results.folder, NEEDS[0]), []
    rows = {f"{name}_{task}": f"{name}, {label}" for task, label in TASKS.items() for name in NAMES}
    words = available(states, rows, WORDS)
    shown = shades(np.zeros(1), top=TOP)[1]
    for row, label in rows.items():
        for word in words:
            title = "" if panels[len(words) - 1:] else TITLES[word]
            panel = body_panel(states, row, word)._replace(
                side=label if word == words[0] else "")
            panels.append(panel._replace(title=f"{title}\n{panel.title}".strip()))
    return pictures(panels, View(len(words), 1.6 * len(words)), shown,
                    "distance from the truth [m]")


def body_panel(states, row, word):
    """Return the panel of a law in a row; without a body, its text says why."""
    if f"{row}_{word}" not in states:
        return Panel(no_balls(), no_balls(), "not trained")
    x, true = (states[f"{row}_{of}"].astype(float) for of in (word, "true"))
    if not np.isfinite(x).all():
        return Panel(no_balls(), no_balls(), panel_title("", x))
    paint = shades(distance_to(x, true), top=TOP)[0]
    if word == "start":
        paint[:] = to_rgb(GHOST)
    return Panel(cloud(x, np.zeros(len(x)), paint, spacing(true)), no_balls())
