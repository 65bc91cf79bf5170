"""Implicit steps from extreme states. Above: for each set of states, which has several moduli in 2D
and 3D, the outer iterations of a method, at most; where solves stopped without the tolerance, how
many of how many. Below: the hardest state of each kind, by every method.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.method_curves import STYLES
from ..common.state_panels import finish
from ..common.style import scales

NEEDS = ["extremes.hot.stiffness", "extremes.hot.poisson", "extremes.hot.sparse",
         "extremes.hot.pieces", "extremes.hot.broken", "extremes.hot.stretched",
         "extremes.hot.time_step", "extremes.hot.every_method"]
SETS = {    # column that tells the states apart, and their label
    "stiffness": ("contrast", "contrast {:.0e}"), "poisson": ("nu", r"$\nu$ = {:g}"),
    "sparse": ("body", "{}"), "pieces": ("run", "{}"), "broken": ("F", "F {}"),
    "stretched": ("F", "stretched {:g} times"), "time_step": ("run", "{}")}
LEFT = 4            # sets in the left panel
CONVERGED, STOPPED, UNSOUND = "#cfe8cf", "#f0c36d", "#e07a6a"
NEWER = {"hot-plus": "HOT-plus", "hot-single": "HOT, single", "gast15": "Gast15",
         "lbfgs-gmg": "LBFGS-GMG", "pn-gmg-pcg": "PN-GMG-PCG"}
WIDTH, ROW = 7.0, 0.165     # of the figure; of a row [inch]


def scale(results):
    return scales(results, NEEDS[0], ".2d.hot.converged")


def draw(results):
    tables = {name: results.table(f"extremes.hot.{name}", "solves") for name in SETS}
    sides = [[cell_rows(tables[name], *SETS[name]) for name in names]
             for names in (list(SETS)[:LEFT], list(SETS)[LEFT:])]
    left, right = ({label: cells for part in side for label, cells in part.items()}
                   for side in sides)
    last = cell_rows(results.table(NEEDS[-1], "solves"), "state", "{}")
    tall = max(len(left), len(right))
    figure, axes = plt.subplot_mosaic(
        [["left", "right"], ["below", "below"]], height_ratios=(tall, len(last)),
        figsize=(WIDTH, ROW * (tall + len(last)) + 1.9), layout="constrained")
    panel(axes["left"], left, tall)
    panel(axes["right"], right, tall)
    panel(axes["below"], last, len(last))
    axes["below"].set_title("the hardest states, every method")
    legend(figure)
    return finish(figure, (), None, "")


def cell_rows(table, column, label):
    """Return {label: {method: (solves, converged, unsound, iterations)}} of a table of solves, a
    row for each state, which a run's name tells after its dimension and modulus.
    """
    labels = np.array([label.format(state_of(value)) for value in table[column]])
    return {row: {method: cell(table, (labels == row) & (table["method"] == method))
                  for method in dict.fromkeys(table["method"])}
            for row in dict.fromkeys(labels)}


def state_of(value):
    """Return what a run's name "2d, E = .., STATE" tells of its state; all else as it is."""
    parts = value.split(", ", 2) if isinstance(value, str) else ()
    if len(parts) == 3:
        unit = " s" if parts[2].startswith("dt") else ""
        return parts[2] + unit
    try:
        return float(value)
    except ValueError:
        return value


def cell(table, rows):
    """Return the numbers of solves, of converged and of unsound ones, and the most iterations."""
    kinds = table["kind"][rows]
    sound = np.isin(kinds, ("converged", "stopped"))
    most = table["iterations"][rows].max() if rows.any() else 0
    return len(kinds), (kinds == "converged").sum(), (~sound).sum(), most


def panel(ax, rows, height):
    """Draw a table: a row for each state, a column for each method."""
    methods = list(dict.fromkeys(method for cells in rows.values() for method in cells))
    for y, cells in enumerate(rows.values()):
        for x, method in enumerate(methods):
            solves, converged, unsound, most = cells.get(method, (0, 0, 0, 0))
            if not solves:
                continue
            colour = UNSOUND if unsound else STOPPED if converged < solves else CONVERGED
            ax.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, fc=colour, ec="white"))
            ax.text(x, y, cell_text(solves, converged, most), ha="center", va="center", fontsize=7)
    ax.set(xlim=(-0.5, len(methods) - 0.5), ylim=(height - 0.5, -0.5))
    ax.set_xticks(range(len(methods)), [label_of(method) for method in methods], rotation=35,
                  ha="left", rotation_mode="anchor", fontsize=7)
    ax.set_yticks(range(len(rows)), rows, fontsize=7)
    ax.tick_params(length=0, top=False, labeltop=True, bottom=False, labelbottom=False)
    ax.spines[:].set_visible(False)
    ax.grid(False)


def cell_text(solves, converged, most):
    """Return the most iterations, or how many solves did not converge."""
    if converged == solves:
        return f"{most:g}"
    return f"{solves - converged} of {solves}" if solves > 1 else "stopped"


def label_of(method):
    """Return the label of a method."""
    return NEWER[method] if method in NEWER else STYLES[method][0]


def legend(figure):
    """Draw the meaning of the colours under the figure."""
    words = {CONVERGED: "all converged: most outer iterations",
             STOPPED: "some stopped, with a reason", UNSOUND: "some ended unsoundly"}
    handles = [plt.Line2D([], [], marker="s", ls="", ms=8, color=colour, label=label)
               for colour, label in words.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
