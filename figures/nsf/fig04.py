"""NSF, Figure 4: samples S, the nodes I that they see (crosses), and the integration points N that
see one of these; a sheared block in 2D with three samples, and the cake, seen from the front.
"""

import matplotlib.pyplot as plt

from validation.ldm.published_bodies import read

from ..common.style import legend_below, scales

NEEDS = ["nsf.fig4"]
COLOURS = {"x": "0.85", "integration": "#e8b53d", "sample": "#b3282d"}
NAMES = {"x": "particles P", "integration": "integration points N", "sample": "samples S"}
SIZES = {"block": (6, 12, 40), "cake": (1, 2, 6)}       # of what is shown, by area
VIEW = {"block": (0, 1), "cake": (0, 2)}                # axes to the right and up


def scale(results):
    return scales(results, NEEDS[0], "points")


def draw(results):
    states = read(results.folder, NEEDS[0])
    figure, axes = plt.subplots(1, len(SIZES), figsize=(7.0, 4.2))
    for ax, name in zip(axes, SIZES, strict=True):
        plot_points(ax, states, name)
    legend_below(figure, axes)
    return figure


def plot_points(ax, states, name):
    """Plot the points of a scene, integration points and samples on top."""
    right, up = VIEW[name]
    for word, size in zip(COLOURS, SIZES[name], strict=True):
        x = states[f"{name}_{word}"]
        ax.scatter(x[:, right], x[:, up], size, COLOURS[word], lw=0, label=NAMES[word])
    if f"{name}_nodes" in states:
        nodes = states[f"{name}_nodes"]
        ax.scatter(nodes[:, right], nodes[:, up], 30, "0.1", marker="+", lw=0.8, zorder=3,
                   label="nodes I")
    ax.set(aspect="equal", xlabel="m", title=name)
