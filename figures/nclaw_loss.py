"""NCLaw: errors in training, mean squared over points, axes and steps, from restarts; horizons grow
from 25 to 200 steps. On plasticine, where there are others, the inset of section 4.7.
"""

import matplotlib.pyplot as plt

from ._orders import scales, series

NEEDS = ["nclaw.loss"]
COLOURS = {"jelly": "C0", "sand": "C1", "plasticine": "C3", "water": "C2"}
WIDTH = 4.2         # of a panel [inch]


def scale(results):
    return scales(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    curves = series(table, ("method", "environment"))
    if not curves:
        raise FileNotFoundError(f"{NEEDS[0]} has no curves: the weights were missing")
    others = sorted({name for method, name in curves if method != "ours"})
    figure, axes = plt.subplots(1, 1 + len(others), figsize=(WIDTH * (1 + len(others)), 3.4),
                                squeeze=False, layout="constrained")
    for (method, name), rows in curves.items():
        x, y = table["epoch"][rows], table["error"][rows]
        if method == "ours":
            axes[0, 0].plot(x, y, color=COLOURS[name], label=name)
        if name in others:
            axes[0, 1 + others.index(name)].plot(x, y, label=method)
    for ax, title in zip(axes[0], ("ours", *others), strict=True):
        ax.set(yscale="log", title=title, xlabel="epoch", ylabel="error of a step [m²]")
        ax.legend(fontsize=8)
    return figure
