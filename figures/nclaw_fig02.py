"""NCLaw, Figure 2 (a) and (b): ends of runs for longer, and thrown otherwise; from left to right
the truth, ours (empty where it broke down), ours before training. Colours: distance from the truth.
"""

import numpy as np

from validation.ldm.kept_bodies import read

from ._bodies import Panel, View, away, nothing, pictures, shades
from ._orders import shared
from ._states import cloud, spacing

NEEDS = ["nclaw.fig2"]
NAMES = ("jelly", "sand", "plasticine", "water")
TASKS = {"time": "longer", "velocity": "thrown otherwise"}
WORDS = {"true": "truth", "ours": "ours", "init": "before training"}
TOP = 0.3           # end of the colours [m]


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    kept, found = read(results.folder, NEEDS[0]), []
    for name in NAMES:
        for task, said in TASKS.items():
            runs = {word: kept[f"{name}_{task}_{word}"].astype(float) for word in WORDS}
            for word, x in runs.items():
                paint, shown = shades(away(x, runs["true"]), top=TOP)
                title = "" if found[5:] else f"{said}: {WORDS[word]}"
                side = name if (task, word) == ("time", "true") else ""
                found.append(Panel(whole(x, paint), nothing(), title, side))
    return pictures(found, View(6, 11.0), shown, "distance from the truth [m]")


def whole(x, colour):
    """Balls of points x (n, 3); of a run that broke down a white one, in the middle of the box."""
    if np.isfinite(x).all():
        return cloud(x, np.zeros(len(x)), colour, spacing(x))
    return cloud(np.full((1, 3), 0.5), np.zeros(1), np.ones((1, 3)), 0.01)
