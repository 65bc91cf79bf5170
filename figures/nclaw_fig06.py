"""NCLaw, Figure 6: the training runs of jelly, sand, plasticine and water (from top to bottom).
Colours: height at the start.
"""

import numpy as np

from validation.ldm.kept_bodies import read

from ._bodies import Panel, View, nothing, pictures
from ._orders import shared
from ._states import cloud, spacing

NEEDS = ["nclaw.fig6"]
NAMES = ("jelly", "sand", "plasticine", "water")
VIEW = View(5, 10.0)
LOW, HIGH = np.array([0.91, 0.68, 0.35]), np.array([0.25, 0.43, 0.66])


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    kept, found = read(results.folder, NEEDS[0]), []
    for name in NAMES:
        x = kept[name].astype(float)
        for k, t in enumerate(kept["t"]):
            found.append(Panel(dyed(x[k], x[0]), nothing(), "" if found[4:] else f"t = {t:.3g} s",
                               "" if k else name))
    return pictures(found, VIEW)


def dyed(x, start):
    """Balls of points x (n, 3), y upwards, with the colours of their heights at the start."""
    share = (start[:, 1] - start[:, 1].min()) / np.ptp(start[:, 1])
    colour = LOW + share[:, None] * (HIGH - LOW)
    return cloud(x, np.zeros(len(x)), colour, spacing(start))
