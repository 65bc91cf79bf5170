"""HOT, Figure 15: CPU time of every method over HOT's on every scene, in total and in the step
where that ratio is largest. Hatched: not every step converged within the caps, so at least.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import legend_below, scales, series

NEEDS = ["hot.fig15"]
LABELS = {"gast15": "Gast15", "pn-pcg": "PN-PCG", "pn-pcg-mf": "PN-PCG (MF)",
          "lbfgs-h": "LBFGS-H", "lbfgs-gmg": "LBFGS-GMG", "pn-mgpcg": "PN-MGPCG",
          "pn-mgpcg-flexible": "PN-MGPCG, flexible", "hot-quadratic": "HOT-quadratic", "hot": "HOT"}


def scale(results):
    clauses = scales(results, NEEDS[0], ".hot.total").split("; ")
    return f"{len(clauses)} scenes, the first of {clauses[0]}, the last of {clauses[-1]}"


def draw(results):
    table = results.table(NEEDS[0], "speedups")
    by_method, places = series(table, ("method",)), {}
    for name in table["scene"]:
        places.setdefault(name, len(places))
    figure, axes = plt.subplots(2, 1, figsize=(7.0, 5.4), sharex=True)
    shown = {method: label for method, label in LABELS.items() if (method,) in by_method}
    width, middle = 0.9 / len(shown), (len(shown) - 1) / 2.0
    for k, (method, label) in enumerate(shown.items()):
        rows = by_method[method,]
        x = np.array([places[name] for name in table["scene"][rows]]) + (k - middle) * width
        for ax, ratio in zip(axes, ("total", "worst"), strict=True):
            bars = ax.bar(x, table[ratio][rows], width, color=f"C{k}", label=label)
            mark_capped(bars, table["capped"][rows])
    for ax, title in zip(axes, ("all steps", "worst step"), strict=True):
        ax.set(yscale="log", ylabel=f"CPU time over HOT's,\n{title}")
        ax.axhline(1.0, color="0.4", lw=0.8)
    axes[1].set_xticks(range(len(places)), [name.replace("_", "\n") for name in places],
                       fontsize=8)
    legend_below(figure, axes, columns=4)
    return figure


def mark_capped(bars, capped):
    """Hatch the bars of methods that did not converge in every step."""
    for bar, steps in zip(bars, capped, strict=True):
        if steps:
            bar.set(hatch="////", edgecolor="w")
