"""What NSF's state figures share: a reduced run beside the full-order one, from left to right by
time; with runs of other ways below.
"""

import numpy as np

from validation.ldm.kept_bodies import read

from ._bodies import Panel, View, body, nothing, pictures, shades
from ._states import spacing

WORDS = {"true": "full order", "ours": "reduced", "map": "map alone"}
COLOURS = {"true": "#e9e9ec", "ours": "#e8b53d", "map": "#c46a5a"}
TOP = 0.98          # quantile of the stresses at which the colours end


def beside(results, id, words=("true", "ours"), choice=slice(1), turn=25.0, lift=15.0):
    """The figure of the chosen parameters of an experiment: a row for each word."""
    kept, found = read(results.folder, id), []
    for value in kept["values"][choice]:
        for word in words:
            side = f"{value}: {WORDS[word]}"
            found += row(kept[f"{value}_{word}"], COLOURS[word], side)
    return pictures(found, View(len(kept["levels"]), 8.0, turn, lift))


def row(x, colour, side):
    """Panels of points x (times, n, 3) of one colour."""
    return [Panel(*drawn(one, colour, spacing(x[0])), "", "" if k else side)
            for k, one in enumerate(x)]


def drawn(x, colour, apart):
    """Balls of points x (n, 3), none of a run that broke down; and none behind them."""
    if not np.isfinite(x).all():
        return nothing(), nothing()
    return body(x, colour, apart), nothing()


def stresses(results, id, turn=25.0, lift=15.0):
    """The figure of |tau|, full order above, reduced below."""
    kept = read(results.folder, id)
    value = kept["values"][0]
    runs = {word: (kept[f"{value}_{word}"], kept[f"{value}_{word}_tau"])
            for word in ("true", "ours")}
    top, found = np.quantile(runs["true"][1], TOP), []
    for word, (x, tau) in runs.items():
        paint, shown = shades(np.nan_to_num(tau), "viridis", top)
        apart = spacing(x[0])
        found += [Panel(*drawn(one, colour, apart), "", "" if k else WORDS[word])
                  for k, (one, colour) in enumerate(zip(x, paint, strict=True))]
    return pictures(found, View(len(kept["levels"]), 8.0, turn, lift), shown, r"$|\tau|$")


def ends(results, id, turn=25.0, lift=15.0):
    """The figure of the training runs at both ends of the range."""
    kept = read(results.folder, id)
    found = [panel for word in ("first", "last")
             for panel in row(kept[word], COLOURS["true"], f"{word} of training")]
    return pictures(found, View(len(kept["levels"]), 8.0, turn, lift))
