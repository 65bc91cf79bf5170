"""Generalized vortex. Left: largest RMS error of the displacement against cells per metre (the ring
is half a metre wide). Right: how far the forcing printed in two public codes is from the one that
the motion asks for, relative to the largest force.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import DEGREES, OTHERS, line_style, scales, series, slope

NEEDS = ["verification.vortex"]


def scale(results):
    return f"2D; {scales(results, NEEDS[0], '.order.')}"


def draw(results):
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.8))
    table = results.table(NEEDS[0], "errors")
    for (transfer, degree, per), rows in series(
            table, ("transfer", "degree", "per_direction")).items():
        left.loglog(table["cells"][rows], table["error"][rows], **line_style(transfer, degree, per),
                    label=f"{transfer} {DEGREES[degree]}, {int(per)} per direction")
    cells = sorted(set(table["cells"]))
    slope(left, -2, (cells[0], cells[-1]), 0.7 * table["error"].max(), "order 2")
    left.set(xlabel="cells per metre", ylabel="error / (R G)", xticks=cells,
             xticklabels=[f"{n:.0f}" for n in cells], xlim=(0.8 * cells[0], 1.5 * cells[-1]),
             ylim=10.0 ** np.array([np.floor(np.log10(min(table["error"]))), 0.0]))
    left.minorticks_off()
    left.legend(fontsize=7)
    sign = results.table(NEEDS[0], "printed-sign")
    for ((turn,), rows), color in zip(series(sign, ("G",)).items(), OTHERS, strict=False):
        right.semilogy(sign["t"][rows], sign["difference"][rows], color=color,
                       label=f"G = {turn:.3g}")
    right.set(xlabel="t / period", ylabel="max |b_printed - b| / max |b|", ylim=(1e-6, 1e-1))
    right.minorticks_off()
    right.legend(fontsize=8, loc="upper center")
    figure.tight_layout()
    return figure
