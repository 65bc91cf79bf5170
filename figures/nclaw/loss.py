"""NCLaw: errors in training, mean squared over points, axes and steps, from restarts; horizons grow
from 25 to 200 steps. On plasticine, where there are others, the inset of section 4.7. A cross: the
training diverged in the next epoch. "sys-id", which has the right laws, reaches far lower errors.
"""

import matplotlib.pyplot as plt

from ..common.style import scales, series

NEEDS = ["nclaw.loss"]
COLOURS = {"jelly": "C0", "sand": "C1", "plasticine": "C3", "water": "C2"}
WIDTH, HEIGHT = 4.2, 3.2        # of a panel [inch]
COLUMNS = 3
IDENTIFIED = "sys-id"
ROOM = 0.003        # from the smallest error of others down


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
            axes["ours"].plot(x, y, color=COLOURS[name], label=name)
        if name in others:
            line, = axes[name].plot(x, y, label=method)
            if diverged(results, method, name):
                axes[name].plot(x[-1], y[-1], "x", color=line.get_color())
    for title, ax in axes.items():
        ax.set(yscale="log", title=title, xlabel="epoch", ylabel="error of a step [m²]")
        ax.set_ylim(bottom=lowest(ax))
        ax.legend(fontsize=8, loc="upper right" if title == "ours" else "lower right")
    figure = axes["ours"].figure
    figure.tight_layout()
    return figure


def panels(count):
    """Return `count` axes of a new figure."""
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    figure = plt.figure(figsize=(WIDTH * columns, HEIGHT * rows))
    return [figure.add_subplot(rows, columns, 1 + k) for k in range(count)]


def diverged(results, method, name):
    """Return whether a training diverged."""
    target = f"{NEEDS[0]}.{method}.{name}.epochs"
    return any(record.target == target for record in results.records(NEEDS[0]))


def lowest(ax):
    """Return the smallest error that a panel shows; None for all."""
    errors = {line.get_label(): line.get_ydata().min() for line in ax.lines}
    others = [error for word, error in errors.items() if word != IDENTIFIED]
    return ROOM * min(others) if others and IDENTIFIED in errors else None
