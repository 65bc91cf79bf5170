"""What figures of refinement studies share."""

import numpy as np

DEGREES = {1: "linear", 2: "quadratic", 3: "cubic"}
TRANSFERS = {"pic": "C3", "flip": "C1", "apic": "C2", "mls": "C0"}
DASHES = {1: ":", 2: "-", 3: "--"}


def look(transfer, degree):
    """Line style of a scheme: colour by transfer, dashes by degree."""
    return {"color": TRANSFERS[transfer], "ls": DASHES[degree], "marker": "o", "ms": 3.5}


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
