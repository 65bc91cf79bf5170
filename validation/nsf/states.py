"""What NSF's state figures show: reduced runs beside full-order ones at some times."""

import numpy as np

from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.evaluate import level_of
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.symmetric import tensor

from ..ldm.published_bodies import keep

SHOTS = 3               # times, evenly spaced, the last among them
WAYS = "map", "weighed"     # of reduced runs, beside the usual one
MOST = 4000             # points shown of a scene


def keep_states(run, one, values, also=()):
    """`keep_runs` of the tests of a `Tested` with these parameters."""
    keep_runs(run, {f"{value:g}": (one, value) for value in values}, also)


def keep_runs(run, tests, also=()):
    """Keep points of full-order runs and of reduced ones, and of the training runs at the ends of
    the range, at `SHOTS` times. tests: {name: (`Tested`, parameter)}, all of the same training.
    also: "map", reduced runs on the map alone; "weighed", such with weighted samples; "stress",
    sizes |tau| [Pa] of the Kirchhoff stress.
    """
    runs = next(iter(tests.values()))[0].runs
    shown = np.arange(0, len(runs.X), -(-len(runs.X) // MOST))
    found = {"values": np.array(list(tests)), "levels": levels_of(runs)}
    for name, (one, value) in tests.items():
        found |= of_history(f"{name}_true", one.tests[value], 0, shown)
        for word in ("ours", *(word for word in WAYS if word in also)):
            own = one._replace(map_alone=word == "map")
            found |= of_run(f"{name}_{word}", own, value, shown, word == "weighed")
    for word, k in (("first", 0), ("last", -1)):
        found |= of_history(word, runs, k, shown)
    keep(run, **{name: a for name, a in found.items()
                 if "stress" in also or not name.endswith("_tau")})


def levels_of(histories):
    """Numbers of the states that are shown."""
    last = histories.x.shape[1] - 1
    return np.array([round(last * (k + 1) / SHOTS) for k in range(SHOTS)])


def of_history(name, histories, k, shown):
    """{NAME: points (SHOTS, m, d), NAME_tau: sizes (SHOTS, m)} of run k."""
    levels, d = levels_of(histories), histories.X.shape[1]
    tau = tensor(histories.tau[k, levels][:, shown].astype(float), d)
    return {name: histories.x[k, levels][:, shown], f"{name}_tau": sizes(tau)}


def of_run(name, one, value, shown, weighed=False):
    """The same of a reduced run with as many samples as the study has, drawn or weighed by
    cubature, those of the first draw; NaN from where it breaks down.
    """
    test, scene, fields = one.tests[value], nsf_full_model(one.study.run(value)), one.of(value)
    levels = levels_of(test).tolist()
    x = np.full((SHOTS, len(shown), fields.dim), np.nan)
    tau = np.full(x.shape[:2], np.nan)
    sets = one.study.chosen(scene, one.study.samples, 0, one.fields if weighed else None)
    try:
        for t, at, *_ in nsf_run(scene, fields, FieldRunOptions(sets), one.rest).states():
            level = level_of(t / test.dt)
            if level in levels:
                k = levels.index(level)
                x[k] = fields.place(shown, at.xhat)
                tau[k] = sizes(fields.stress(shown, at.xhat))
    except BREAKDOWNS:
        pass
    return {name: x, f"{name}_tau": tau}


def sizes(tau):
    """Frobenius norms (..,) of tensors (.., d, d)."""
    return np.linalg.norm(tau, axis=(-2, -1))
