"""Outer iterations of one implicit step over the modulus of the softer half of a box and the
contrast of its halves. Colours say how a solve ended; white fields are past 1e12 Pa.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import scales

NEEDS = ["extremes.hot.stiffness"]
COLOURS = {"converged": "#cfe8cf", "stopped": "#f0c36d", "unsound": "#e07a6a"}
METHODS = {"hot": "HOT", "hot-single": "HOT, single precision", "hot-plus": "HOT-plus",
           "lbfgs-h": "LBFGS-H", "pn-pcg": "PN-PCG", "pn-mgpcg": "PN-MGPCG"}


def scale(results):
    return scales(results, NEEDS[0], ".2d.")


def draw(results):
    table = results.table(NEEDS[0], "solves")
    figure, axes = plt.subplots(2, 3, figsize=(10.4, 6.4), sharex=True, sharey=True)
    for ax, (method, label) in zip(axes.flat, METHODS.items(), strict=True):
        rows = (table["d"] == 2) & (table["method"] == method)
        panel(ax, {name: a[rows] for name, a in table.items()})
        ax.set_title(label, fontsize=10)
    for ax in axes[-1]:
        ax.set_xlabel("E of the softer half [Pa]")
    for ax in axes[:, 0]:
        ax.set_ylabel("contrast")
    kinds = [kind for kind in COLOURS if kind in {colour_key(k) for k in table["kind"]}]
    handles = [plt.Line2D([], [], marker="s", ls="", ms=9, color=COLOURS[k], label=k)
               for k in kinds]
    figure.legend(handles=handles, loc="upper center", ncol=len(handles), fontsize=9,
                  bbox_to_anchor=(0.5, 1.03))
    figure.tight_layout()
    return figure


def panel(ax, solves):
    """Draw one method: a field for each pair of moduli, with its number of iterations."""
    ax.grid(False)
    for E, contrast, kind, k in zip(solves["E"], solves["contrast"], solves["kind"],
                                    solves["iterations"], strict=True):
        x, y = np.log10(E), np.log10(contrast)
        ax.add_patch(plt.Rectangle((x - 1, y - 1), 2, 2, color=COLOURS[colour_key(kind)],
                                   ec="white"))
        ax.annotate(f"{k:g}", (x, y), ha="center", va="center", fontsize=8)
    ax.set(xlim=(1, 13), ylim=(-1, 9), xticks=range(2, 13, 2), yticks=range(0, 9, 2))
    ax.xaxis.set_major_formatter(lambda x, _: f"1e{x:g}")
    ax.yaxis.set_major_formatter(lambda y, _: f"1e{y:g}")


def colour_key(kind):
    """Return the key of the colour: an end that is neither converged nor stopped is unsound."""
    return kind if kind in COLOURS else "unsound"
