"""Draw the change and the saving of each removal as two rows of bars."""

import numpy as np

from ..store.atomic import replacing
from .answer import grid_text
from .removal import NOT_REQUIRED, REQUIRED, saving

COLORS = {REQUIRED: "0.35", NOT_REQUIRED: "tab:green"}
OTHER = "0.75"          # of removals that cost time, or were not measured
LEAST = 1e-8            # a change that is drawn for less, on a logarithmic axis
WIDTH, ROW, FRAME = 7.0, 0.28, 1.6      # [inch]


def draw_needs(answer):
    """Return a Matplotlib `Figure` of a `NeedsAnswer`: change beside saving, a row a removal."""
    from matplotlib.figure import Figure

    runs = [run for run in answer.result.singles if run.changes]
    figure = Figure((WIDTH, FRAME + ROW * max(len(runs), 1)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    rows, colors = np.arange(len(runs)), [COLORS.get(run.verdict, OTHER) for run in runs]
    left.barh(rows, [max(100.0 * run.change, LEAST) for run in runs], color=colors)
    right.barh(rows, [100.0 * saving(run, answer.result.cpu) for run in runs], color=colors)
    left.set_yticks(rows, [run.label for run in runs], fontsize=8)
    left.invert_yaxis()
    left.set_xscale("log")
    left.axvline(100.0 * answer.error, color="tab:red", label="error asked")
    draw_grid_error(left, answer.result.errors)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    left.set_xlabel("change without it [%]")
    right.axvline(0.0, color="0.35", linewidth=0.8)
    right.set_xlabel("CPU time saved [%]")
    figure.suptitle(answer.result.first.scene.title or answer.name, fontsize=10)
    return figure


def draw_grid_error(axes, errors):
    """Mark the largest change by another grid spacing, where it was measured."""
    if errors.grid:
        axes.axvline(100.0 * max(errors.grid.values()), color="0.35", linestyle=":",
                     label=f"{grid_text(errors)} instead of dx")


def save_figure(answer, path):
    """Write the figure of a `NeedsAnswer` to an image file. Raises `NotWritten`."""
    figure = draw_needs(answer)
    with replacing(path) as part:
        figure.savefig(part, dpi=150)
