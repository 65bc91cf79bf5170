"""Pictures of stress-strain curves. Matplotlib is imported when one is made."""

from itertools import groupby
from math import nan

import numpy as np

from ...store.atomic import replacing

PANEL, ROOM = (3.1, 2.7), 0.8   # width and height of a panel; for the title and the legend [inch]
COLUMNS = 3
TRUTH, LEARNED = "0.6", "C3"    # colours
STYLES = {True: "-", False: ":"}


def draw(found, title, out):
    """Write a picture of `Curve`s, a panel for each name of a path: png, pdf or svg."""
    from matplotlib.figure import Figure

    panels = {name: list(own) for name, own in groupby(found, lambda curve: curve.path.name)}
    columns = min(len(panels), COLUMNS)
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(PANEL[0] * columns, PANEL[1] * rows + ROOM), layout="constrained")
    for k, (name, own) in enumerate(panels.items(), 1):
        axes = figure.add_subplot(rows, columns, k)
        for curve in own:
            draw_curve(axes, curve)
        axes.set(xlabel="strain", ylabel=f"{own[0].path.symbol} [Pa]", title=name)
        axes.ticklabel_format(axis="y", scilimits=(-3, 3))
        axes.locator_params(axis="x", nbins=5)
    figure.suptitle(title, fontsize=9)
    explain(figure, found)
    with replacing(out) as part:
        figure.savefig(part)


def draw_curve(axes, curve):
    """Draw both stresses; the learned one dotted beyond the strains of training."""
    strain = curve.path.strain
    axes.plot(strain, curve.truth, "-", color=TRUTH, lw=3.0)
    seen = np.ones(len(strain), bool) if curve.seen is None else curve.seen
    for inside, style in STYLES.items():
        shown = seen == inside
        shown[:-1] |= shown[1:]         # lines reach from one kind of point to the next
        axes.plot(strain, np.where(shown, curve.learned, nan), style, color=LEARNED, lw=1.4)


def explain(figure, found):
    """Say below the panels what lines are."""
    from matplotlib.lines import Line2D

    known = found[0].seen is not None
    words = {"truth": ("-", TRUTH), "learned": (STYLES[True], LEARNED)}
    if known:
        words["learned, beyond the strains of training"] = STYLES[False], LEARNED
    lines = [Line2D([], [], ls=style, color=color) for style, color in words.values()]
    figure.legend(lines, list(words), loc="outside lower center", ncols=3, fontsize=8,
                  title=None if known else "the weights do not say which strains training saw",
                  title_fontsize=8)
