"""Errors of NCLaw's small trainings in rows: of what each did not see, or saw wrong."""

import numpy as np
from matplotlib.ticker import NullFormatter

from .state_panels import settled


def named(table, k, forms, base):
    """What row k of a table has otherwise than a record, in words by `forms`; "" for nothing."""
    return ", ".join(form.format(table[key][k]) for key, form in forms.items()
                     if differs(table[key][k], getattr(base, key)))


def differs(written, value):
    """Whether an entry of a table is not a value of a record; what is no number is text there."""
    return written != (str(value) if isinstance(value, bool) else value)


def dots(ax, table, words):
    """A row for each training that has words, with its error on its own run and thrown otherwise;
    a band for those that have none.
    """
    usual = [table["own"][k] for k, said in enumerate(words) if not said]
    shown = [k for k, said in enumerate(words) if said]
    if usual:
        ax.axvspan(min(usual), max(usual), color="0.85", label="with nothing amiss, by seed")
    y = np.arange(len(shown))
    ax.plot(table["own"][shown], y, "ko", ms=5, label="on the run that was learned from")
    ax.plot(table["thrown"][shown], y, "ko", ms=5, fillstyle="none", label="thrown otherwise")
    ax.set_yticks(y, [words[k] for k in shown], fontsize=7)
    ax.set(xscale="log", xlabel="error [m²]")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.invert_yaxis()


def below(figure, axes, columns):
    """The figure, laid out for good, with one legend below for the labels of some axes."""
    found = {}
    for ax in axes:
        found |= {label: line for line, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(found.values(), found.keys(), ncols=columns, fontsize=7,
                  loc="outside lower center")
    return settled(figure, axes, None, "")
