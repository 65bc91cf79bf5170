"""What NSF's state figures share: a reduced run beside the full-order one, from left to right by
time; with runs of other ways below.
"""

import numpy as np

from validation.ldm.published_bodies import read

from .bodies import Panel, View, body, nothing, pictures, shades
from .state_panels import spacing

WORDS = {"true": "full order", "ours": "reduced", "map": "map alone",
         "weighed": "with weights"}
COLOURS = {"true": "#e9e9ec", "ours": "#e8b53d", "map": "#c46a5a", "weighed": "#7fb069"}
TOP = 0.98          # quantile of the stresses at which the colours end
ROOM = 0.4          # around the full-order runs, of their longest side: points beyond are left out


def beside(results, id, words=("true", "ours"), choice=slice(1), turn=25.0, lift=15.0):
    """The figure of the chosen parameters of an experiment: a row for each word. Points that are
    far from all full-order runs are left out.
    """
    kept, found = read(results.folder, id), []
    values = kept["values"][choice]
    ends = room(np.concatenate([kept[f"{value}_true"].reshape(-1, 3) for value in values]))
    for value in values:
        for word in words:
            side = f"{value}: {WORDS[word]}"
            found += row(kept[f"{value}_{word}"], COLOURS[word], side, ends)
    return pictures(found, View(len(kept["levels"]), 8.0, turn, lift))


def room(x):
    """Corners (2, 3) of the box of points x (n, 3), and ROOM around it."""
    low, high = x.min(axis=0), x.max(axis=0)
    spare = ROOM * (high - low).max()
    return np.array([low - spare, high + spare])


def row(x, colour, side, ends=(-np.inf, np.inf)):
    """Panels of points x (times, n, 3) of one colour, of those within corners."""
    return [Panel(*drawn(one, colour, spacing(x[0]), ends), "", "" if k else side)
            for k, one in enumerate(x)]


def drawn(x, colour, apart, ends=(-np.inf, np.inf)):
    """Balls of points x (n, 3) within corners, none of a run that broke down; and none behind."""
    within = ((x >= ends[0]) & (x <= ends[1])).all(axis=1)
    if not np.isfinite(x).all() or not within.any():
        return nothing(), nothing()
    return body(x[within], colour if isinstance(colour, str) else colour[within], apart), nothing()


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
