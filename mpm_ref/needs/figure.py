"""Draw the change and the saving of each removal as two rows of bars."""

import numpy as np

from ..store.atomic import replacing
from ..store.text import figure_text
from .answer import grid_text
from .removal import NOT_REQUIRED, REQUIRED, saving

COLORS = {REQUIRED: "0.35", NOT_REQUIRED: "tab:green"}
OTHER = "0.75"          # of removals that cost time, or were not measured
LEAST, MOST = 1e-8, 1e6     # [%] changes that are drawn for smaller and larger ones
WIDTH, ROW, FRAME = 7.0, 0.28, 1.6      # [inch]


def draw_needs(answer):
    """Return a Matplotlib `Figure` of a `NeedsAnswer`: change beside saving, a row a removal."""
    from matplotlib.figure import Figure

    runs = [run for run in answer.result.singles if run.changes]
    figure = Figure((WIDTH, FRAME + ROW * max(len(runs), 1)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    rows, colors = np.arange(len(runs)), [COLORS.get(run.verdict, OTHER) for run in runs]
    left.barh(rows, [shown_change(run.change) for run in runs], color=colors)
    right.barh(rows, [100.0 * saving(run, answer.result.cpu) for run in runs], color=colors)
    left.set_yticks(rows, [figure_text(run.label) for run in runs], fontsize=8)
    left.invert_yaxis()
    left.set_xscale("log")
    left.axvline(100.0 * answer.error, color="tab:red", label="error asked")
    draw_grid_error(left, answer.result.errors)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    left.set_xlabel("change without it [%]")
    right.axvline(0.0, color="0.35", linewidth=0.8)
    right.set_xlabel("CPU time saved [%]")
    figure.suptitle(figure_text(answer.result.first.scene.title or answer.name), fontsize=10)
    return figure


def shown_change(change):
    """Return a relative change as a percentage within the limits of the logarithmic axis."""
    return min(max(100.0 * change, LEAST), MOST)


def draw_grid_error(axes, errors):
    """Mark the largest change by another grid spacing, where it was measured."""
    if errors.grid:
        axes.axvline(shown_change(max(errors.grid.values())), color="0.35", linestyle=":",
                     label=f"{grid_text(errors)} instead of dx")


def save_figure(answer, path):
    """Write the figure of a `NeedsAnswer` to an image file. Raises `NotWritten`."""
    figure = draw_needs(answer)
    with replacing(path) as part:
        figure.savefig(part, dpi=150)
