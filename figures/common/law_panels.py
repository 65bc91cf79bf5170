"""Panels that compare runs of points: the start, the end by each law, and the true end."""

import numpy as np

from .bodies import Panel, no_balls
from .state_panels import cloud, spacing

TITLES = {"start": "start", "true": "truth", "ours": "ours", "neural": "neural", "gnn": "gnn",
          "admissible": "admissible", "init": "before training"}
LOW, HIGH = np.array([0.91, 0.68, 0.35]), np.array([0.25, 0.43, 0.66])


def comparison_rows(bodies, rows, laws=("ours",)):
    """Return the panels of runs NAME_true and NAME_LAW (frames, n, 3) for rows {NAME: label}. Runs
    that are not among the stored bodies are left out.
    """
    contents = []
    for name, label in rows.items():
        if f"{name}_true" not in bodies:
            continue
        runs = {law: bodies[f"{name}_{law}"].astype(float)
                for law in available(bodies, [name], (*laws, "true"))}
        shown = {"start": runs["true"][0], **{law: x[-1] for law, x in runs.items()}}
        for law, x in shown.items():
            contents.append(Panel(colour_by_height(x, shown["start"]), no_balls(),
                                  panel_title("" if contents[len(shown) - 1:] else TITLES[law], x),
                                  label if law == "start" else ""))
    return contents


def available(bodies, names, laws):
    """Return the laws for which any name has a stored run NAME_LAW."""
    return [law for law in laws if any(f"{name}_{law}" in bodies for name in names)]


def panel_title(title, x):
    """Return the title of a panel of points x (n, 3), which says if the run broke down."""
    return title if np.isfinite(x).any() else f"{title}\nbroke down".strip()


def colour_by_height(x, start):
    """Return balls at points x (n, 3), y upwards, coloured by their height at the start. Points
    without a finite position are left out.
    """
    finite = np.isfinite(x).all(axis=1)
    share = (start[:, 1] - start[:, 1].min()) / np.ptp(start[:, 1])
    colour = LOW + share[:, None] * (HIGH - LOW)
    if not finite.any():
        return no_balls()
    return cloud(x[finite], np.zeros(finite.sum()), colour[finite], spacing(start))
