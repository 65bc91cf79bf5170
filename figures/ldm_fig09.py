"""LDM, Figure 9: position error of the cylinder under gravity by number of sample points, r = 4;
all random draws, and POD with as many points.
"""

import matplotlib.pyplot as plt

from ._orders import legend_below, series, shared

NEEDS = ["ldm.fig9"]
LINES = {"lagrangian_nonlinear": ("Lagrangian, nonlinear", "o"),
         "lagrangian_linear": ("Lagrangian, linear", "s"),
         "eulerian_nonlinear": ("Eulerian, nonlinear", "^"),
         "eulerian_linear": ("Eulerian, linear", "v"), "pod": ("POD, Lagrangian, linear", "x")}


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    figure, ax = plt.subplots(figsize=(6.4, 4.0))
    found = series(table, ("scheme",))
    for name, (label, marker) in LINES.items():
        if (name,) in found:
            rows = found[name,]
            ax.loglog(table["points"][rows], 100.0 * table["origin"][rows], marker, label=label,
                      fillstyle="none")
    ax.set(xlabel="sample points", ylabel="position error [%]")
    legend_below(figure, [ax], columns=3)
    return figure
