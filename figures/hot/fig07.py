"""HOT, Figure 7: the particle-grid kernel of levels 0 to 3 in each level's own spacing, for linear
and quadratic embedding of the nodes. The finest is the quadratic B-spline.
"""

import matplotlib.pyplot as plt

NEEDS = ["hot.fig7"]
PANELS = {"lin": "linear embedding", "quad": "quadratic embedding"}
SHADES = plt.get_cmap("viridis")


def scale(results):
    return "exact; no simulation"


def draw(results):
    table = results.table(NEEDS[0], "curves")
    figure, axes = plt.subplots(1, 2, figsize=(7.0, 3.2), sharey=True, layout="constrained")
    for ax, (short, title) in zip(axes, PANELS.items(), strict=True):
        for level in range(4):
            ax.plot(table["x"], table[f"{short}{level}"], color=SHADES(level / 3.5),
                    label=f"level {level}")
        ax.set(title=title, xlabel="x / dx of the level")
    axes[0].set_ylabel("weight")
    axes[0].legend(fontsize=8)
    return figure
