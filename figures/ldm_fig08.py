"""LDM, Figure 8: position error of the cylinder under gravity by latent dimension, all points; with
the error of the nearest states of the learned map, and of POD of the same dimension.
"""

import matplotlib.pyplot as plt

from ._orders import legend_below, series, shared

NEEDS = ["ldm.fig8"]
LINES = {"lagrangian_nonlinear": ("Lagrangian, nonlinear", "o-"),
         "lagrangian_linear": ("Lagrangian, linear", "s-"),
         "eulerian_nonlinear": ("Eulerian, nonlinear", "^-"),
         "eulerian_linear": ("Eulerian, linear", "v-"),
         "nearest": ("nearest state, no dynamics", "k:"), "pod": ("POD, Lagrangian, linear", "x--")}


def scale(results):
    return shared(results, NEEDS[0])


def draw(results):
    table = results.table(NEEDS[0], "errors")
    figure, ax = plt.subplots(figsize=(6.4, 4.0))
    found = series(table, ("scheme",))
    for name, (label, style) in LINES.items():
        if (name,) in found:
            rows = found[name,]
            ax.semilogy(table["r"][rows], 100.0 * table["origin"][rows], style, label=label)
    ax.set(xlabel="latent dimension r", ylabel="position error [%]")
    legend_below(figure, [ax], columns=3)
    return figure
