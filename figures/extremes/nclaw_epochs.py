"""NCLaw: small trainings at their extremes. By material: errors of laws after some epochs in runs
longer than the horizon of training: as trained, with other steps, thrown differently. A cross is a
run that lost points, on the upper edge one that broke down. Last: laws learned from faulty
observations, on the training run (full marks) and thrown differently (open marks), and the range
of those without faults (grey, by seed); a cross at the right edge is a run that broke down.
"""

import matplotlib.pyplot as plt
import numpy as np

from validation.nclaw.observation import Observation
from validation.nclaw.small_trainings import Small

from ..common.style import scales
from ..common.training_errors import differences, error_rows, legend_outside, mark_broken
from .nclaw import TRAINED

NEEDS = ["extremes.nclaw.epochs", "extremes.nclaw.observed"]
FAULTS = {"gap": "{:g} steps without frames", "outliers": "{:.2g} of the positions are outliers"}
DENSITY = {"density": "{:g} times the density"}
COLUMNS, WIDTH, HEIGHT = 2, 3.5, 2.5        # of panels; of a panel [inch]


def scale(results):
    return scales(results, NEEDS[1])


def draw(results):
    runs = results.table(NEEDS[0], "runs")
    materials = list(dict.fromkeys(law.split()[0] for law in runs["law"]))
    rows = 1 + -(-len(materials) // COLUMNS)
    figure = plt.figure(figsize=(WIDTH * COLUMNS, HEIGHT * rows), layout="constrained")
    grid = figure.add_gridspec(rows, COLUMNS)
    axes = [figure.add_subplot(grid[divmod(k, COLUMNS)]) for k in range(len(materials))]
    axes.append(figure.add_subplot(grid[-1, :]))
    for name, ax in zip(materials, axes, strict=False):
        epochs(ax, runs, name)
        ax.set_title(f"{name}, beyond the horizon")
    observation_errors(axes[-1], results.table(NEEDS[1], "trainings"))
    axes[-1].set_title("faulty observations")
    return legend_outside(figure, axes, 3)


def epochs(ax, table, name):
    """Draw a curve for each kind of run of a material."""
    mine = np.array([law.split()[0] == name for law in table["law"]])
    epoch = np.array([int(law.split()[-1]) for law in table["law"]])
    for k, what in enumerate(dict.fromkeys(table["what"])):
        rows = np.flatnonzero(mine & (table["what"] == what))
        rows = rows[np.argsort(epoch[rows])]
        x, y, lost = epoch[rows], table["error"][rows], table["lost"][rows] >= 0
        colour, finite = "k" if what == TRAINED else f"C{k}", np.isfinite(y)
        ax.semilogy(x[finite], y[finite], ".-", color=colour, label=what)
        ax.plot(x[finite & lost], y[finite & lost], "x", color=colour, ms=6)
        mark_broken(ax, x[~finite], colour)
    ax.set(xlabel="epoch", ylabel="error [m²]")


def observation_errors(ax, table):
    """Draw a row for each kind of fault."""
    labels = [", ".join(filter(None, (differences(table, k, FAULTS, Observation()),
                                      differences(table, k, DENSITY, Small()))))
              for k in range(len(table["own"]))]
    error_rows(ax, table, labels)
