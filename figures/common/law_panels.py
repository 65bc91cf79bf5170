"""Panels that compare runs of points: the start, the end by each law, and the true end."""

import re

import numpy as np

from validation.nclaw.environments import environment

from .bodies import Panel, failure_note, no_balls, pictures, shades
from .state_panels import cloud, spacing

TITLES = {"start": "start", "true": "truth", "ours": "ours", "neural": "neural", "gnn": "gnn",
          "admissible": "admissible", "init": "before\ntraining"}
HEIGHT = "height at the start, over that of the body"


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
                                  "" if contents[len(shown) - 1:] else TITLES[law],
                                  label if law == "start" else "",
                                  failure_note(x, np.isfinite(x).all(axis=1))))
    return contents


def pictures_by_height(contents, view):
    """Draw `Panel`s whose balls are coloured by height, with the colour bar of these."""
    return pictures(contents, view, shades(np.linspace(0.0, 1.0))[1], HEIGHT)


def with_end_times(results, experiment_id, rows):
    """Return rows {NAME: label} with the time under each label at which its runs end, by the steps
    of its records; those without records as they are.
    """
    steps = {}
    for record in results.records(experiment_id):
        count = re.search(r"(\d+) steps", record.scale)
        if count:
            name = record.target.removeprefix(f"{experiment_id}.").rpartition(".")[0]
            steps[name.replace(".", "_")] = int(count[1])
    dt = environment("jelly").dt        # the same in all scenes of NCLaw
    return {name: f"{label}\nt = {steps[name] * dt:.3g} s" if name in steps else label
            for name, label in rows.items()}


def available(bodies, names, laws):
    """Return the laws for which any name has a stored run NAME_LAW."""
    return [law for law in laws if any(f"{name}_{law}" in bodies for name in names)]


def colour_by_height(x, start):
    """Return balls at points x (n, 3), y upwards, coloured by their height at the start. Points
    without a finite position are left out.
    """
    finite = np.isfinite(x).all(axis=1)
    if not finite.any():
        return no_balls()
    share = (start[:, 1] - start[:, 1].min()) / np.ptp(start[:, 1])
    return cloud(x[finite], np.zeros(finite.sum()), shades(share)[0][finite], spacing(start))
