"""What figures of refinement studies share."""

import numpy as np

DEGREES = {1: "linear", 2: "quadratic", 3: "cubic"}
TRANSFERS = {"pic": "C3", "flip": "C1", "apic": "C2", "mls": "C0"}
DASHES = {1: ":", 2: "-", 3: "--"}
MARKERS = {1: "v", 2: "o", 3: "s", 4: "D"}


def look(transfer, degree, per=2):
    """Line style: colour by transfer, dashes by degree, marker by particles per direction."""
    return {"color": TRANSFERS[transfer], "ls": DASHES[degree], "marker": MARKERS[per], "ms": 4}


def legend_below(figure, axes, columns=4):
    """One legend under the figure for the labels of several axes, each once."""
    found = {}
    for ax in axes:
        found |= {label: line for line, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.tight_layout()
    figure.legend(found.values(), found.keys(), ncol=columns, fontsize=7, loc="upper center",
                  bbox_to_anchor=(0.5, 0.0))


def series(table, keys):
    """{values of the key columns: row mask}, in order of appearance."""
    rows = list(zip(*(table[key] for key in keys), strict=True))
    return {row: np.array([r == row for r in rows]) for row in dict.fromkeys(rows)}


def slope(ax, order, x, y, label):
    """Grey line through (x[0], y) of y ~ x^order."""
    x = np.asarray(x)
    ax.plot(x, y * (x / x[0]) ** order, "-", color="0.6", lw=1, zorder=0)
    ax.annotate(label, (x[-1], y * (x[-1] / x[0]) ** order), fontsize=7, color="0.5",
                xytext=(3, 0), textcoords="offset points", va="center")
