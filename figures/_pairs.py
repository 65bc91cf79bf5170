"""Runs of points beside each other: the start, ours at the end, the truth there."""

import numpy as np

from ._bodies import Panel, nothing
from ._states import cloud, spacing

LOW, HIGH = np.array([0.91, 0.68, 0.35]), np.array([0.25, 0.43, 0.66])


def sides(kept, rows):
    """Panels of runs NAME_true and NAME_ours (frames, n, 3) for rows {NAME: words}; those that
    were not kept are left out.
    """
    found = []
    for name, words in rows.items():
        if f"{name}_true" not in kept:
            continue
        true, ours = (kept[f"{name}_{word}"].astype(float) for word in ("true", "ours"))
        titles = ("", "", "") if found else ("start", "ours", "truth")
        for x, title in zip((true[0], ours[-1], true[-1]), titles, strict=True):
            said = title if np.isfinite(x).any() else f"{title}\nbroke down".strip()
            found.append(Panel(dyed(x, true[0]), nothing(), said,
                               "" if len(found) % 3 else words))
    return found


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
