"""NCLaw: small trainings at their extremes. By material: errors of laws after some epochs, which in
training are only ever run for a horizon, run freely: as trained, with other steps, thrown
otherwise; a cross is a run that lost points on its way, on the upper edge one that broke down.
Last: laws learned from a run with faults, on that run (full marks) and thrown otherwise (open
ones), beside those without faults (grey, by seed); what broke down is left out.
"""

import matplotlib.pyplot as plt
import numpy as np

from validation.nclaw.observation import Seen
from validation.nclaw.small_trainings import Small

from ..common.dots import below, dots, named
from ..common.orders import scales
from .nclaw import TRAINED

NEEDS = ["extremes.nclaw.epochs", "extremes.nclaw.observed"]
FAULTS = {"gap": "{:g} steps without frames", "outliers": "{:.2g} of places far off"}
DENSITY = {"density": "{:g} times the density"}
COLUMNS, WIDTH, HEIGHT = 3, 4.0, 3.2        # of panels; of a panel [inch]


def scale(results):
    return scales(results, NEEDS[1])


def draw(results):
    runs = results.table(NEEDS[0], "runs")
    materials = list(dict.fromkeys(law.split()[0] for law in runs["law"]))
    rows = -(-(1 + len(materials)) // COLUMNS)
    figure = plt.figure(figsize=(WIDTH * COLUMNS, HEIGHT * rows), layout="constrained")
    axes = [figure.add_subplot(rows, COLUMNS, 1 + k) for k in range(1 + len(materials))]
    for name, ax in zip(materials, axes, strict=False):
        epochs(ax, runs, name)
        ax.set_title(f"{name}, run freely", fontsize=9)
    faults(axes[-1], results.table(NEEDS[1], "trainings"))
    axes[-1].set_title("runs with faults", fontsize=9)
    return below(figure, axes, 4)


def epochs(ax, table, name):
    """A curve for each kind of run of a material."""
    own = np.array([law.split()[0] == name for law in table["law"]])
    epoch = np.array([int(law.split()[-1]) for law in table["law"]])
    for k, what in enumerate(dict.fromkeys(table["what"])):
        rows = np.flatnonzero(own & (table["what"] == what))
        rows = rows[np.argsort(epoch[rows])]
        x, y, lost = epoch[rows], table["error"][rows], table["lost"][rows] >= 0
        colour, ended = "k" if what == TRAINED else f"C{k}", np.isfinite(y)
        ax.semilogy(x[ended], y[ended], ".-", color=colour, label=what)
        ax.plot(x[ended & lost], y[ended & lost], "x", color=colour, ms=6)
        for broken in x[~ended]:
            ax.plot(broken, 1.0, "x", color=colour, ms=6, clip_on=False,
                    transform=ax.get_xaxis_transform())
    ax.set(xlabel="epoch", ylabel="error [m²]")


def faults(ax, table):
    """A row for each fault."""
    words = [", ".join(filter(None, (named(table, k, FAULTS, Seen()),
                                     named(table, k, DENSITY, Small()))))
             for k in range(len(table["own"]))]
    dots(ax, table, words)
