"""Runs of points beside each other: the start, laws at the end, the truth there."""

import numpy as np

from .bodies import Panel, nothing
from .state_panels import cloud, spacing

TITLES = {"start": "start", "true": "truth", "ours": "ours", "neural": "neural", "gnn": "gnn",
          "admissible": "admissible", "init": "before training"}
LOW, HIGH = np.array([0.91, 0.68, 0.35]), np.array([0.25, 0.43, 0.66])


def sides(kept, rows, words=("ours",)):
    """Panels of runs NAME_true and NAME_WORD (frames, n, 3) for rows {NAME: words}; rows and words
    that were not kept are left out.
    """
    found = []
    for name, said in rows.items():
        if f"{name}_true" not in kept:
            continue
        runs = {word: kept[f"{name}_{word}"].astype(float)
                for word in present(kept, [name], (*words, "true"))}
        shown = {"start": runs["true"][0], **{word: x[-1] for word, x in runs.items()}}
        for word, x in shown.items():
            found.append(Panel(dyed(x, shown["start"]), nothing(),
                               titled("" if found[len(shown) - 1:] else TITLES[word], x),
                               said if word == "start" else ""))
    return found


def present(kept, names, words):
    """Those words of which any name has runs NAME_WORD."""
    return [word for word in words if any(f"{name}_{word}" in kept for name in names)]


def titled(title, x):
    """The title of a panel of points x (n, 3), which says if there are none any more."""
    return title if np.isfinite(x).any() else f"{title}\nbroke down".strip()


def dyed(x, start):
    """Balls of points x (n, 3), y upwards, with the colours of their heights at the start; none of
    points that have no place any more.
    """
    placed = np.isfinite(x).all(axis=1)
    share = (start[:, 1] - start[:, 1].min()) / np.ptp(start[:, 1])
    colour = LOW + share[:, None] * (HIGH - LOW)
    if not placed.any():
        return nothing()
    return cloud(x[placed], np.zeros(placed.sum()), colour[placed], spacing(start))
