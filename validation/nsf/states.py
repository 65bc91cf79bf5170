"""Points of reduced and full-order runs at some times, for NSF's figures of states."""

import numpy as np

from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.evaluate import level_of
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.symmetric import tensor

from ..common.even_points import even_subset
from ..ldm.published_bodies import keep

SHOTS = 3               # times, evenly spaced, the last among them
KINDS = "map", "weighed"    # of further reduced runs
MOST = 4000             # points shown of a scene


def keep_states(run, one, values, also=()):
    """Keep the runs of the tests of a `FittedStudy` with these parameters."""
    keep_runs(run, {f"{value:g}": (one, value) for value in values}, also)


def keep_runs(run, tests, also=()):
    """Keep points of full-order runs and of reduced ones, and of the training runs at the ends of
    the range, at `SHOTS` times. tests: {name: (`FittedStudy`, parameter)}, all of the same
    training. also: "map", reduced runs on the map alone; "weighed", those with weighted samples;
    "stress", sizes |tau| [Pa] of the Kirchhoff stress.
    """
    runs = next(iter(tests.values()))[0].runs
    shown = even_subset(runs.X, MOST)
    arrays = {"values": np.array(list(tests)), "levels": levels_of(runs)}
    for name, (one, value) in tests.items():
        arrays |= history_points(f"{name}_true", one.tests[value], 0, shown)
        for word in ("ours", *(word for word in KINDS if word in also)):
            variant = one._replace(map_alone=word == "map")
            arrays |= run_points(f"{name}_{word}", variant, value, shown, word == "weighed")
    for word, k in (("first", 0), ("last", -1)):
        arrays |= history_points(word, runs, k, shown)
    keep(run, **{name: a for name, a in arrays.items()
                 if "stress" in also or not name.endswith("_tau")})


def levels_of(histories):
    """Return the numbers of the states that are shown."""
    last = histories.x.shape[1] - 1
    return np.array([round(last * (k + 1) / SHOTS) for k in range(SHOTS)])


def history_points(name, histories, k, shown):
    """Return {NAME: points (SHOTS, m, d), NAME_tau: sizes (SHOTS, m)} of run k."""
    levels, d = levels_of(histories), histories.X.shape[1]
    tau = tensor(histories.tau[k, levels][:, shown].astype(float), d)
    return {name: histories.x[k, levels][:, shown], f"{name}_tau": sizes(tau)}


def run_points(name, one, value, shown, weighted=False):
    """Return {NAME: points (SHOTS, m, d), NAME_tau: sizes (SHOTS, m)} of a reduced run with as many
    samples as the study has, drawn or weighted by cubature, those of the first draw; NaN from where
    it breaks down.
    """
    test, fields = one.tests[value], one.fields_of_run(value)
    scene = nsf_full_model(one.study.run(value))
    levels = levels_of(test).tolist()
    x = np.full((SHOTS, len(shown), fields.dim), np.nan)
    tau = np.full(x.shape[:2], np.nan)
    sets = one.study.chosen(scene, one.study.samples, 0, one.fields if weighted else None)
    try:
        for t, latent, *_ in nsf_run(scene, fields, FieldRunOptions(sets), one.rest).states():
            level = level_of(t / test.dt)
            if level in levels:
                k = levels.index(level)
                x[k] = fields.place(shown, latent.xhat)
                tau[k] = sizes(fields.stress(shown, latent.xhat))
    except BREAKDOWNS:
        pass
    return {name: x, f"{name}_tau": tau}


def sizes(tau):
    """Frobenius norms (..,) of tensors (.., d, d)."""
    return np.linalg.norm(tau, axis=(-2, -1))
