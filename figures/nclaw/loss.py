"""NCLaw: errors in training, mean squared over points, axes and steps, from restarts; horizons grow
from 25 to 200 steps. On plasticine, where there are others, the inset of section 4.7. Curves are
smoothed, as restarts differ; the raw ones are pale. A cross: the training diverged in the next
epoch. "sys-id", which has the right laws, reaches far lower errors, below the panels.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, scales, series

NEEDS = ["nclaw.loss"]
COLOURS = {"jelly": "C0", "sand": "C1", "plasticine": "C3", "water": "C2"}
METHODS = {"ours": ("k", "-"), "spline": ("C0", "-"), "spline-released": ("C0", "--"),
           "neural": ("C1", "-"), "neural-released": ("C1", "--"), "sys-id": ("C4", "-"),
           "admissible": ("C2", "-"), "no-rotation": ("C3", "-"), "no-undeformed": ("C3", "--"),
           "velocity": ("C5", "-"), "seed-1": ("0.6", "-"), "seed-2": ("0.6", "--")}
OTHER = ("C8", ":")
WIDTH, HEIGHT, COLUMNS = 7.0, 2.4, 2    # of the figure; of a panel [inch]
IDENTIFIED = "sys-id"
ROOM = 0.1          # from the smallest error of others down
EPOCHS = 15         # over which a curve is smoothed


def scale(results):
    return scales(results, NEEDS[0], ".last")


def draw(results):
    table = results.table(NEEDS[0], "errors")
    curves = series(table, ("method", "environment"))
    if not curves:
        raise FileNotFoundError(f"{NEEDS[0]} has no curves: the weights were missing")
    others = sorted({name for method, name in curves if method != "ours"})
    axes = dict(zip(("ours", *others), panels(1 + len(others)), strict=True))
    for (method, name), rows in curves.items():
        x, y = table["epoch"][rows], table["error"][rows]
        if method == "ours":
            draw_curve(axes["ours"], (x, y), name, (COLOURS[name], "-"))
        if name in others:
            style = METHODS.get(method, OTHER)
            draw_curve(axes[name], (x, y), method, style)
            if diverged(results, method, name):
                axes[name].plot(x[-1], y[-1], "x", color=style[0])
    for title, ax in axes.items():
        ax.set(yscale="log", title="ours" if title == "ours" else f"{title}, by method",
               xlabel="epoch", ylabel="error of a step [m²]")
        ax.set_ylim(bottom=lowest(ax))
    axes["ours"].legend(ncols=2, loc="upper center")
    figure = axes["ours"].figure
    legend_below(figure, [axes[name] for name in others], columns=5)
    return figure


def draw_curve(ax, curve, label, style):
    """Draw errors by epoch, and their geometric mean over the next and the last epochs."""
    (x, y), (colour, dashes) = curve, style
    ax.plot(x, y, color=colour, lw=0.5, alpha=0.3, label=f"_{label}")
    ax.plot(x, smoothed(y), dashes, color=colour, label=label)


def smoothed(y):
    """Return the geometric mean over EPOCHS entries, fewer at the ends."""
    half, logs = EPOCHS // 2, np.log(y)
    return np.exp([logs[max(0, k - half):k + half + 1].mean() for k in range(len(y))])


def panels(count):
    """Return `count` axes of a new figure."""
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    figure = plt.figure(figsize=(WIDTH, HEIGHT * rows))
    return [figure.add_subplot(rows, columns, 1 + k) for k in range(count)]


def diverged(results, method, name):
    """Return whether a training diverged."""
    target = f"{NEEDS[0]}.{method}.{name}.epochs"
    return any(record.target == target for record in results.records(NEEDS[0]))


def lowest(ax):
    """Return the smallest error that a panel shows; None for all."""
    errors = {line.get_label(): line.get_ydata().min() for line in ax.lines}
    others = [error for word, error in errors.items() if word.strip("_") != IDENTIFIED]
    return ROOM * min(others) if others and IDENTIFIED in errors else None
