"""Error against CPU seconds and bytes of explicit MPM, for a manufactured solution (top) and the
swing of a cantilever (bottom). One knob at a time is turned from the default (black star). The
line joins the points that no other one beats in both; crosses at the top edge are runs that broke
or whose answer is wrong. CPU seconds were taken on a machine that may have been busy.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import EngFormatter, FuncFormatter, LogLocator, NullFormatter

from ..common.style import OTHERS, TRANSFERS, scales

NEEDS = ["trade.explicit.mms", "trade.explicit.cantilever"]
TITLES = ("manufactured solution", "cantilever")
MARKS = {"dt": "o", "dx": "s", "particles": "D", "sampling": "^", "degree": "v", "storage": "h"}
FORMS = {"cpu": FuncFormatter(lambda x, _: f"{x:g}"), "nbytes": EngFormatter(sep=" ")}


def scale(results):
    return "; ".join(f"{title}: {scales(results, id)}"
                     for id, title in zip(NEEDS, TITLES, strict=True))


def draw(results):
    figure, axes = plt.subplots(2, 2, figsize=(7.0, 6.8), sharex="col")
    for row, id, title in zip(axes, NEEDS, TITLES, strict=True):
        points = results.table(id, "points")
        for ax, cost, on_front in zip(row, ("cpu", "nbytes"), ("pareto_cpu", "pareto_bytes"),
                                      strict=True):
            scatter(ax, points, cost, points[on_front] > 0)
        row[0].set_ylabel(f"error, {title}")
    axes[1, 0].set_xlabel("CPU time of the step loop [s]")
    axes[1, 1].set_xlabel("memory of state and grid [bytes]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncol=5, bbox_to_anchor=(0.5, 1.06),
                  fontsize=9, handletextpad=0.2, columnspacing=1.0)
    figure.tight_layout()
    return figure


def scatter(ax, points, cost, on_front):
    """Draw points by knob, the Pareto front, and the failures at the top."""
    good = points["end"] == "finished"
    error, x = points["error"].astype(float), points[cost].astype(float)
    for (knob, mark), color in zip(MARKS.items(), OTHERS, strict=True):
        rows = good & (points["knob"] == knob)
        ax.plot(x[rows], error[rows], mark, color=color, ms=5, label=knob)
    for transfer, color in TRANSFERS.items():
        rows = good & (points["knob"] == "transfer") & (points["transfer"] == transfer)
        if rows.any():
            ax.plot(x[rows], error[rows], "P", color=color, ms=6, label=f"transfer {transfer}")
    first = points["knob"] == "default"
    ax.plot(x[first], error[first], "k*", ms=10, label="default")
    front = np.flatnonzero(on_front)[np.argsort(x[on_front])]
    ax.plot(x[front], error[front], "-", color="0.6", lw=1, zorder=0)
    bad = ~good
    top = 2.0 * np.nanmax(error[good])
    ax.plot(x[bad], np.full(bad.sum(), top), "x", color="k", ms=6)
    for row, k in enumerate(np.flatnonzero(bad)):
        ax.annotate(points["end"][k], (x[k], top), xytext=(4, 4 - 8 * row),
                    textcoords="offset points", fontsize=7)
    ax.set(xscale="log", yscale="log")
    ax.xaxis.set(minor_formatter=NullFormatter(), major_locator=LogLocator(subs=(1.0, 3.0)),
                 major_formatter=FORMS[cost])
