"""HOT, Figure 20: a bar is twisted whose middle segment gets stiffer. CPU time of the solves and
outer iterations per step, at the paper's tolerance, which is not equal error.
"""

import matplotlib.pyplot as plt

from ..common.style import legend_below, scales, series

NEEDS = ["hot.fig20"]
METHODS = {"hot": ("HOT", "o-"), "lbfgs-h": ("LBFGS-H", "s-"), "pn-pcg": ("PN-PCG", "^-"),
           "pn-pcg-mf": ("PN-PCG (MF)", "v--"), "pn-mgpcg": ("PN-MGPCG", "d-")}


def scale(results):
    return scales(results, NEEDS[0], ".E1e5.time")


def draw(results):
    table = results.table(NEEDS[0], "costs")
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.4))
    by_method = series(table, ("method",))
    for k, (method, (label, style)) in enumerate(METHODS.items()):
        rows = by_method[method,]
        for ax, name in zip(axes, ("cpu", "iterations"), strict=True):
            ax.semilogx(table["E"][rows], table[name][rows], style, color=f"C{k}", label=label)
    for ax, name in zip(axes, ("CPU seconds per step", "outer iterations per step"), strict=True):
        ax.set(xlabel="Young's modulus of the middle [Pa]", ylabel=name)
        ax.set_ylim(bottom=0.0)
    legend_below(figure, axes, columns=5)
    return figure
