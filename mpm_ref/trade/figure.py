"""Draw the error of all settings against their CPU time, wall time and memory.

Matplotlib is imported when a figure is made.
"""

from math import inf

from ..store.atomic import replacing
from ..store.text import figure_text
from ..sweep.observation import FINISHED, TORN
from .answer import has_errors, percent, shown_rows

COSTS = {"cpu": "CPU time [s]", "wall": "wall time [s]", "memory": "memory [bytes]"}
LEAST = 1e-8            # an error that is drawn for less, on a logarithmic axis
WIDTH, HEIGHT = 11.0, 3.6       # [inch]
MARGIN = 1.6            # factor by which an axis goes on past its values
FRONT, OTHER, BEST, FAILED = "tab:blue", "0.75", "tab:orange", "tab:red"
COMPARED = "tab:green"


def save_figure(facts, path):
    """Write the figure of `answer.answer_of` to an image file. Raises `NotWritten`."""
    figure = draw_trade(facts)
    with replacing(path) as part:
        figure.savefig(part, dpi=150)


def draw_trade(facts):
    """Return a Matplotlib `Figure` of three fronts: filled settings have no other one that is at
    most as wrong at less cost; crosses at the top failed. Where no error is known, differences from
    the reference until the end are drawn, without those of the run that is the reference.
    """
    from matplotlib.figure import Figure

    figure = Figure((WIDTH, HEIGHT), layout="constrained")
    panels = figure.subplots(1, len(COSTS), sharey=True)
    own, compared = drawn_rows(facts, "rows"), drawn_rows(facts, "compared")
    rows = [*own, *compared]
    errors = [row["error"] for row in rows if row["error"] is not None]
    for axes, (key, label) in zip(panels, COSTS.items(), strict=True):
        draw_costs(axes, own, key)
        draw_compared(axes, compared, key)
        axes.axhline(facts["error"], color="0.35", linestyle=":", label="error asked")
        axes.set(xscale="log", yscale="log", xlabel=label, ylim=limits([facts["error"], *errors]),
                 xlim=limits([row[key] for row in rows if (row[key] or 0.0) > 0.0]))
    panels[0].set_ylabel(error_label(facts))
    draw_failures(panels[0], own)
    handles = {label: handle for axes in panels[:1]
               for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5,
                  fontsize=8, frameon=False)
    figure.suptitle(f"{figure_text(facts['scene'])}, {title_text(facts)}", fontsize=10)
    return figure


def error_label(facts):
    """Return the label of the axis of errors."""
    what, texts = "error" if has_errors(facts) else "difference", facts["quantities"]
    if len(texts) > 1:
        return f"largest {what} of {len(texts)} quantities"
    return f"{what} of {figure_text(texts[0])}"


def title_text(facts):
    """Return what a figure shows, in words."""
    if has_errors(facts):
        return f"until t = {facts['until']:.4g} s"
    if len(facts["grids"]) < 2:
        return "nothing is known: fewer than two grids finished"
    own = max(facts["references"][text]["error_at_end"] or inf for text in facts["quantities"])
    return ("no error is known; differences from the reference over the whole run "
            f"(its own error: {percent(own)})")


def drawn_rows(facts, key):
    """Return the rows with the errors that are drawn."""
    rows = shown_rows(facts, key)
    return rows if has_errors(facts) else [one | {"error": one["error"] or None} for one in rows]


def rows_with_error(rows, key):
    """Return the rows with an error and a cost, whose bodies stayed whole."""
    return [row for row in rows if row["error"] is not None and row["outcome"] != TORN
            and (row[key] or 0.0) > 0.0]


def limits(values):
    """Return the ends of a logarithmic axis that shows some values."""
    shown = [max(value, LEAST) for value in values] or [1.0]
    return min(shown) / MARGIN, max(shown) * MARGIN


def draw_costs(axes, rows, key):
    """Draw the settings with a known error as points over one cost."""
    drawn = rows_with_error(rows, key)
    front = [row for row in drawn if is_on_front(row, drawn, key)]
    others = [row for row in drawn if row not in front]
    for chosen, color, label in ((others, OTHER, "dominated"), (front, FRONT, "front"),
                                 ([row for row in drawn if row["best"]], BEST, "recommended")):
        axes.plot([row[key] for row in chosen], [max(row["error"], LEAST) for row in chosen], "o",
                  color=color, markersize=5, label=label)


def draw_compared(axes, rows, key):
    """Draw results files as diamonds."""
    drawn = rows_with_error(rows, key)
    if drawn:
        axes.plot([row[key] for row in drawn], [max(row["error"], LEAST) for row in drawn], "D",
                  color=COMPARED, markersize=5, label="compared")


def is_on_front(row, rows, key):
    """Return whether no other row is at most as wrong at less cost."""
    return not any(other["error"] <= row["error"] and other[key] < row[key] for other in rows)


def draw_failures(axes, rows):
    """Mark settings that did not finish, or tore, at the top, at the CPU time that they took."""
    failed = [row["cpu"] for row in rows if row["outcome"] != FINISHED and (row["cpu"] or 0.0) > 0]
    top = [1.0] * len(failed)
    axes.plot(failed, top, "x", color=FAILED, transform=axes.get_xaxis_transform(), clip_on=False,
              label="failed")
