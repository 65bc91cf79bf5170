"""LDM, Figure 14: the latent trajectory of a poked cylinder in the plane of its first two principal
components, with numbers of steps; dashed while it is driven.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patheffects import withStroke

from ..common.style import scales

NEEDS = ["ldm.fig13"]
SPACING = 0.09      # least distance of two numbers, over the picture's sides
EVERY = 5           # steps; others get no number


def scale(results):
    back, plane = (results.value(NEEDS[0], f"ldm.fig14.{name}") for name in ("return", "plane"))
    return (f"{scales(results, NEEDS[0], 'ldm.fig14')}; the last state is {back:.2g} of the "
            f"farthest's distance from the first; the plane has {100.0 * plane:.3g} % of the "
            "variance")


def draw(results):
    table = results.table(NEEDS[0], "latent")
    step, driven = table["step"].astype(int), table["driven"] > 0
    place = np.column_stack([table["pc1"], table["pc2"]])
    let_go = int(np.flatnonzero(driven)[-1])
    figure, ax = plt.subplots(figsize=(6.4, 4.4))
    ax.plot(*place[:let_go + 1].T, "--", color="C1", label="driven")
    ax.plot(*place[let_go:].T, color="C0", label="free")
    ax.plot(*place[0], "ko", ms=5, label="start")
    ax.plot(*place[-1], "kx", ms=6, label=f"end, step {step[-1]}")
    halo = [withStroke(linewidth=2, foreground="w")]
    for k in numbered(place, (0, let_go)):
        ax.plot(*place[k], ".", color="0.3", ms=4)
        ax.annotate(str(step[k]), place[k], fontsize=7, color="0.3", xytext=(4, 4),
                    textcoords="offset points", path_effects=halo)
    ax.set(xlabel="first principal component", ylabel="second principal component")
    ax.legend(fontsize=8)
    return figure


def numbered(place, first):
    """Return the indices of the places (n, 2) that get a number: those of `first`, then every
    EVERY-th that is far from all before.
    """
    place = (place - place.min(axis=0)) / np.ptp(place, axis=0)
    chosen = []
    for k in (*first, *range(0, len(place), EVERY)):
        if all(np.linalg.norm(place[k] - place[j]) > SPACING for j in chosen):
            chosen.append(k)
    return sorted(chosen)
