"""Collapse of columns of sand. Left: run-out of 99 % of the sand against the aspect ratio, with the
laws quoted after Lube et al. (unconfirmed). Right: deposits of the finest plane columns, the
initial columns dotted.
"""

import matplotlib.pyplot as plt

from ._orders import series

NEEDS = ["verification.column"]
COLORS = {"plane": "C0", "axisymmetric": "C3"}


def draw(results):
    table, deposit = (results.table(NEEDS[0], name) for name in ("runout", "deposit"))
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.8, 3.8))
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
    left.minorticks_off()
    left.legend(fontsize=7)
    for (kind, cells, a), rows in series(deposit, ("kind", "cells", "a")).items():
        if (kind, cells) == ("plane", finest["plane"]):
            line, = right.plot(deposit["r"][rows], deposit["height"][rows], label=f"a = {a:g}")
            right.plot((0.0, 1.0, 1.0), (a, a, 0.0), ":", color=line.get_color(), lw=1)
    right.set(xlabel="x / L", ylabel="height / L", ylim=(0.0, 2.6))
    right.legend(fontsize=7)
    figure.tight_layout()
    return figure
