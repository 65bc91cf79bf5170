"""Colliding disks. Left: mechanical energy with each transfer. Right: gap that is left between the
disks when they first act on each other, against dx; on a grid they meet up to 3 sqrt(2) dx early.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import TRANSFERS, scales, series, slope

NEEDS = ["verification.disks"]


def scale(results):
    return f"2D; {scales(results, NEEDS[0])}"


def draw(results):
    energy, contact = (results.table(NEEDS[0], name) for name in ("energy", "contact"))
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.6), width_ratios=(1.4, 1))
    for (transfer,), rows in series(energy, ("transfer",)).items():
        total = energy["kinetic"][rows] + energy["elastic"][rows]
        left.plot(energy["t"][rows], total, color=TRANSFERS[transfer], label=transfer,
                  lw=3.0 if transfer == "mls" else 1.4)      # APIC lies upon MLS
        left.plot(energy["t"][rows], energy["kinetic"][rows], ":", color=TRANSFERS[transfer], lw=1)
    left.set(xlabel="t [s]", ylabel="energy / its start (dotted: kinetic)", ylim=(0.0, 1.1))
    left.legend(fontsize=8)
    right.loglog(contact["dx"], contact["gap"], "o-", color=TRANSFERS["mls"], label="mls")
    right.loglog(contact["dx"], 3.0 * np.sqrt(2.0) * contact["dx"], "k:", label="reach of splines")
    slope(right, 1, (contact["dx"].min(), contact["dx"].max()), contact["gap"].min() / 2.0,
          "order 1")
    right.set(xlabel="dx [m]", ylabel="gap at first contact [m]", xticks=contact["dx"],
              xticklabels=[f"{dx:g}" for dx in contact["dx"]])
    right.minorticks_off()
    right.set(yticks=(0.05, 0.1, 0.2, 0.4), yticklabels=("0.05", "0.1", "0.2", "0.4"))
    right.legend(fontsize=8)
    figure.tight_layout()
    return figure
