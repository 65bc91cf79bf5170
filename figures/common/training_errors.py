"""Errors of NCLaw's small trainings in rows, labelled by what their observations lack."""

import numpy as np
from matplotlib.ticker import NullFormatter

from .state_panels import finish


def differences(table, k, forms, base):
    """Describe, by `forms`, where row k of a table differs from a record; "" where it does not."""
    return ", ".join(form.format(table[key][k]) for key, form in forms.items()
                     if differs(table[key][k], getattr(base, key)))


def differs(written, value):
    """Return whether an entry of a table differs from a value of a record (tables store text)."""
    return written != (str(value) if isinstance(value, bool) else value)


def error_rows(ax, table, labels):
    """Draw a row for each training with a label: errors on its own run and thrown otherwise. Those
    without a label make a band.
    """
    baseline = [table["own"][k] for k, label in enumerate(labels) if not label]
    shown = [k for k, label in enumerate(labels) if label]
    if baseline:
        ax.axvspan(min(baseline), max(baseline), color="0.85", label="full data, by seed")
    y = np.arange(len(shown))
    ax.plot(table["own"][shown], y, "ko", ms=5, label="on the training run")
    ax.plot(table["thrown"][shown], y, "ko", ms=5, fillstyle="none", label="thrown differently")
    broken = ~np.isfinite(table["own"][shown]) | ~np.isfinite(table["thrown"][shown])
    mark_broken(ax, y[broken], "k", upright=False)
    ax.set_yticks(y, [labels[k] for k in shown], fontsize=7)
    ax.set(xscale="log", xlabel="error [m²]")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.invert_yaxis()


def mark_broken(ax, places, colour, upright=True):
    """Draw a cross on the upper edge, or the right one, at each place of a run that broke down."""
    for place in places:
        at = (place, 1.0) if upright else (1.0, place)
        transform = ax.get_xaxis_transform() if upright else ax.get_yaxis_transform()
        ax.plot(*at, "x", color=colour, ms=6, clip_on=False, transform=transform)


def legend_outside(figure, axes, columns):
    """Finish the figure with one legend below it for the labels of some axes."""
    handles = {}
    for ax in axes:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), ncols=columns, fontsize=7,
                  loc="outside lower center")
    return finish(figure, axes, None, "")
