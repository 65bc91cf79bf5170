"""Answers of mpm-ref trade on shipped scenes: error of the positions, until the time to which they
are known, against the CPU time of a run. Blue points are on the front: no cheaper setting is as
accurate. The star is the setting recommended for the largest error that was asked, which its error
and that of the reference keep together; the ring is the scene's own.
"""

from math import ceil

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, readable, scales, series

NEEDS = ["trade.scenes"]
COLUMNS, WIDTH, HEIGHT = 3, 7.0, 2.2    # of panels; of the figure, of a panel [inch]


def scale(results):
    return scales(results, NEEDS[0], ".wall")


def draw(results):
    table, advice = results.table(NEEDS[0], "points"), results.table(NEEDS[0], "advice")
    scenes = series(table, ("scene",))
    columns = min(COLUMNS, len(scenes))
    lines = ceil(len(scenes) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(WIDTH, HEIGHT * lines), squeeze=False)
    for ax in axes.flat[len(scenes):]:
        ax.axis("off")
    for ax, ((scene,), rows) in zip(axes.flat, scenes.items(), strict=False):
        loosest = advice["asked"][advice["scene"] == scene].max()
        panel(ax, table, rows & (table["asked"] == loosest), loosest)
        one = (advice["scene"] == scene) & (advice["asked"] == loosest)
        until, end = advice["until"][one][0], advice["end"][one][0]
        ax.set_title(f"{scene}, until {until:.3g} of {end:.3g} s")
    figure.supxlabel("CPU time of the run [s]", fontsize=9)
    figure.supylabel("relative error of the positions", fontsize=9)
    legend_below(figure, axes.flat, columns=5)
    return figure


def panel(ax, table, rows, asked):
    """Draw the settings of a search that finished with a known error."""
    error, cpu = table["error"].astype(float), table["cpu"].astype(float)
    rows = rows & np.isfinite(error) & np.isfinite(cpu)
    front, best = rows & (table["front"] > 0), rows & (table["best"] > 0)
    own = rows & (table["setting"] == "dx x 1")
    ax.axhline(asked, color="0.4", ls=":", lw=1, label="error asked")
    ax.loglog(cpu[rows & ~front], error[rows & ~front], ".", ms=3, color="0.75",
              label="dominated settings")
    order = np.argsort(cpu[front])
    ax.loglog(cpu[front][order], error[front][order], ".-", ms=4, lw=0.8, color="C0",
              label="front")
    ax.loglog(cpu[own], error[own], "o", ms=8, mfc="none", color="k", label="the scene's own")
    ax.loglog(cpu[best], error[best], "*", ms=9, color="C3", label="recommended")
    for axis in (ax.xaxis, ax.yaxis):
        readable(axis, places=(1.0, 3.0))
