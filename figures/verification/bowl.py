"""A saddle slides down in a bowl without friction: its angular velocity, with that of the exact
pendulum at the bottom.
"""

import matplotlib.pyplot as plt

from ..common.style import scales, series, shades

NEEDS = ["verification.bowl"]


def scale(results):
    return f"2D; {scales(results, NEEDS[0])}"


def draw(results):
    table = results.table(NEEDS[0], "course")
    speed = next(r for r in results.records(NEEDS[0]) if r.target == "verification.bowl.speed")
    figure, ax = plt.subplots(figsize=(5.6, 3.6))
    runs = series(table, ("dx",))
    for ((dx,), rows), color in zip(runs.items(), shades(len(runs)), strict=True):
        ax.plot(table["t"][rows], table["omega"][rows], color=color, label=f"dx = {dx:g} m")
    ax.axhline(speed.paper, color="k", ls=":", label="exact at the bottom")
    ax.set(xlabel="t [s]", ylabel="angular velocity [rad/s]")
    ax.legend(fontsize=8)
    return figure
