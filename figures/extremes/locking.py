"""Locking: first swing of a clamped beam under its weight over twice the static deflection of
Timoshenko's beam in plane strain, as Poisson's ratio goes to 1/2. Quadratic MLS-MPM, no remedy.
"""

import matplotlib.pyplot as plt
import numpy as np

from ..common.style import counts

NEEDS = ["extremes.explicit.locking"]


def scale(results):
    curve = results.table(NEEDS[0], "curve")
    return f"2D, {len(curve['nu'])} runs, beams of {counts(curve['layers'])} cells over the height"


def draw(results):
    curve = results.table(NEEDS[0], "curve")
    figure, ax = plt.subplots()
    for layers, per in sorted(set(zip(curve["layers"], curve["per_direction"], strict=True))):
        rows = (curve["layers"] == layers) & (curve["per_direction"] == per)
        ax.plot(0.5 - curve["nu"][rows], curve["swing"][rows], "o-", ms=4,
                label=f"{layers:g} cells high, {per:g} x {per:g} particles")
    ax.axhline(1.0, color="0.5", lw=1, ls="--")
    ax.set(xscale="log", ylabel="swing / Timoshenko (dashed: 1)", ylim=(0.0, None))
    gaps = np.unique(0.5 - curve["nu"])
    ax.set_xticks(gaps, [f"{0.5 - gap:g}" for gap in gaps])
    ax.set_xlabel("nu (1/2 - nu on a log scale)")
    ax.minorticks_off()
    ax.invert_xaxis()
    ax.legend()
    return figure
