"""Line styles of transfers and refinements, legends, slopes, and the text on a figure's scale."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

DEGREES = {1: "linear", 2: "quadratic", 3: "cubic"}
TRANSFERS = {"pic": "C3", "flip": "C1", "apic": "C2", "mls": "C0"}
OTHERS = ("C4", "C5", "C6", "C8", "C9", "0.5")     # curves that stand for no transfer
DASHES = {1: ":", 2: "-", 3: "--"}
PLACES = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)            # of a decade
MARKERS = {1: "v", 2: "o", 3: "s", 4: "D"}


def line_style(transfer, degree, per=2):
    """Return colour by transfer, dashes by degree and marker by particles per direction."""
    return {"color": TRANSFERS[transfer], "ls": DASHES[degree], "marker": MARKERS[per], "ms": 4}


def shades(n, transfer="mls"):
    """Return n colours from light to the transfer's own: from coarse to fine."""
    full = np.array(to_rgb(TRANSFERS[transfer]))
    return [1.0 - share * (1.0 - full) for share in np.linspace(1.0, 0.4, n)[::-1]]


def scales(results, experiment_id, part=""):
    """Describe the size of the runs behind an experiment's numbers, as recorded: the first clause
    of each scale, of the targets with `part` in their name.
    """
    return "; ".join(_clauses(results, experiment_id, part))


def shared_scale(results, experiment_id, part=""):
    """Return the phrases that all clauses of `scales` have in common."""
    phrases = [clause.split(", ") for clause in _clauses(results, experiment_id, part)]
    return ", ".join(p for p in phrases[0] if all(p in others for others in phrases))


def titled_scales(results, ids, titles):
    """Join the `shared_scale` of several experiments, each behind its panel's title."""
    return "; ".join(f"{title}: {shared_scale(results, id)}"
                     for id, title in zip(ids, titles, strict=True))


def _clauses(results, experiment_id, part):
    clauses = (r.scale.split("; ")[0] for r in results.records(experiment_id)
               if r.scale and part in r.target)
    return list(dict.fromkeys(clauses))


def counts(values):
    """Return sorted distinct numbers as text: 8, 16, 32."""
    return ", ".join(f"{v:g}" for v in sorted(set(values)))


def legend_below(figure, axes, columns=4):
    """Draw one legend under the figure for the labels of several axes, each once."""
    handles = {}
    for ax in axes:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    figure.tight_layout()
    figure.legend(handles.values(), handles.keys(), ncol=columns, fontsize=7, handlelength=3.2,
                  loc="upper center", bbox_to_anchor=(0.5, 0.02))


def readable(axis, places=PLACES):
    """Label a logarithmic axis with plain numbers at some places of each decade."""
    axis.set(major_locator=LogLocator(subs=places), minor_formatter=NullFormatter(),
             major_formatter=FuncFormatter(lambda x, _: f"{x:g}"))


def series(table, keys):
    """Return {values of the key columns: row mask}, in order of appearance."""
    rows = list(zip(*(table[key] for key in keys), strict=True))
    return {row: np.array([r == row for r in rows]) for row in dict.fromkeys(rows)}


def slope(ax, order, x, y, label):
    """Draw a grey line y ~ x^order through (x[0], y)."""
    x = np.asarray(x)
    ax.plot(x, y * (x / x[0]) ** order, "-", color="0.6", lw=1, zorder=0)
    ax.annotate(label, (x[-1], y * (x[-1] / x[0]) ** order), fontsize=7, color="0.5",
                xytext=(3, 0), textcoords="offset points", va="center")
