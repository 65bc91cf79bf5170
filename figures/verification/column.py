"""Collapse of columns of sand. Left: run-out of 99 % of the sand against the aspect ratio, with the
laws quoted after Lube et al. (unconfirmed). Right: deposits of the finest plane columns; dotted:
their initial width.
"""

import matplotlib.pyplot as plt

from ..common.style import OTHERS, counts, series

NEEDS = ["verification.column"]
COLORS = dict(zip(("plane", "axisymmetric"), OTHERS))


def scale(results):
    table = results.table(NEEDS[0], "runout")
    cells = {kind: counts(table["cells"][table["kind"] == kind]) for kind in COLORS}
    return "; ".join(f"{kind}: L of {sizes} cells" for kind, sizes in cells.items())


def draw(results):
    table, deposit = (results.table(NEEDS[0], name) for name in ("runout", "deposit"))
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    finest = {kind: max(table["cells"][table["kind"] == kind]) for kind in COLORS}
    for (kind, cells), rows in series(table, ("kind", "cells")).items():
        left.loglog(table["a"][rows], table["runout"][rows], "o-", color=COLORS[kind],
                    alpha=1.0 if cells == finest[kind] else 0.4,
                    label=f"{kind}, L = {int(cells)} dx")
        if cells == finest[kind]:
            left.loglog(table["a"][rows], table["lube"][rows], "kx", ms=6,
                        mec=COLORS[kind], label=f"{kind}, law (unconfirmed)")
    left.set(xlabel="aspect ratio a", ylabel="run-out / L", xticks=sorted(set(table["a"])),
             xticklabels=[f"{a:g}" for a in sorted(set(table["a"]))])
    left.set(yticks=(0.5, 1, 2, 5, 10, 20), yticklabels=("0.5", "1", "2", "5", "10", "20"),
             ylim=(0.8 * table["runout"].min(), 1.6 * table["runout"].max()))
    left.minorticks_off()
    left.legend(fontsize=7)
    right.axvline(1.0, color="0.5", ls=":", lw=1)
    plane = ((a, rows) for (kind, cells, a), rows in series(deposit, ("kind", "cells", "a")).items()
             if (kind, cells) == ("plane", finest["plane"]))
    for (a, rows), color in zip(plane, OTHERS, strict=False):
        right.plot(deposit["r"][rows], deposit["height"][rows], color=color, label=f"a = {a:g}")
    right.set(xlabel="x / L", ylabel="height / L", ylim=(0.0, 1.3 * deposit["height"].max()))
    right.legend(fontsize=7)
    figure.tight_layout()
    return figure
