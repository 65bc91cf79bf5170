"""Reduced runs with parameters outside those that their map was trained with, and inside."""

from functools import cache

import numpy as np

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions

from ..common.registry import experiment
from ..ldm.studies import GRAVITY, STUDIES, TORSION
from .ldm_runs import Trial, ended, full, learned, record_silent, table_of

OUTSIDE = {         # of the studies: parameters; trained 1 .. 10, and 0 .. 0.6, 0 .. 2
    "gravity": {"quick": (-5.0, 15.0, 30.0), "standard": (-10.0, -5.0, -1.0, 0.0, 0.5, 11.0, 12.0,
                                                          15.0, 20.0, 30.0, 50.0)},
    "torsion": {"quick": ((0.0, 10.0),),
                "standard": ((0.0, 3.0), (0.0, 10.0), (0.0, -1.0), (0.6, 3.0), (0.6, 5.0),
                             (0.8, 2.0), (1.0, 0.0), (2.0, 0.0), (1.2, 4.0), (-0.3, 0.0))}}
CHOSEN = {"quick": ("gravity-r4", "torsion-0"),         # maps that the watch's bounds are from
          "standard": ("gravity-r4", "gravity-r7", "torsion-0")}
LINEAR = SCHEMES[1:2]   # the cheapest scheme
OTHER = {"quick": (), "standard": ("gravity-r3", "gravity-r6", "torsion-1")}
FEW = {"gravity": 10, "torsion": 20}    # samples, beside all: half of them at ends that are held


@cache
def beside(study, mu):
    """`Case` of a run of a study by name, its full-order x, and what that said if it stopped."""
    one = ldm_full_model(STUDIES[study].scene(*mu))
    return one, *full(one.problem)


@experiment("extremes.ldm.range", title="LDM: parameters outside the trained range",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def parameters(run):
    """Errors and flags by parameter; runs within the range must not be flagged."""
    chosen, other = CHOSEN[run.profile], OTHER[run.profile]
    found = {name: of_map(run, name, name in other)
             for name in run.progress((*chosen, *other), "maps")}
    table_of(run, [t for both in found.values() for trials in both for t in trials])
    record_rates(run, "extremes.ldm.range", [found[name] for name in chosen])
    if other:
        record_rates(run, "extremes.ldm.range.other_maps", [found[name] for name in other])


def of_map(run, name, is_other):
    """Lists of `Trial`s of a map: within the range, and outside."""
    study = GRAVITY if name.startswith("gravity") else TORSION
    tests = [tuple(study.mu[k]) for k in study.test[::run.choose(quick=5, standard=1)]]
    far = [mu if isinstance(mu, tuple) else (mu,) for mu in OUTSIDE[study.name][run.profile]]
    schemes = LINEAR if is_other else run.choose(quick=LINEAR, standard=(*SCHEMES[:2], SCHEMES[3]))
    inside = [trial for scheme in schemes for trial in trials(name, study, tests, scheme)]
    usual = max(t.end.error for t in inside if t.points != FEW[study.name])
    return [[t._replace(usual=usual) for t in found]
            for found in (inside, trials(name, study, far, *LINEAR))]


def trials(name, study, parameters, scheme):
    """`Trial`s of a map over parameters, with all samples and with few."""
    found, reduction = [], learned(name)
    for mu in parameters:
        one, x, said = beside(study.name, mu)
        for points in (None, FEW[study.name]):
            way = RunOptions(*scheme, points)
            what = ", ".join(f"{a:g}" for a in mu) + (" (full order stopped)" if said else "")
            found.append(Trial(name, what, way.name, points or len(one.X), np.nan,
                               ended(one, x, reduction, way)))
    return found


def record_rates(run, name, found):
    """Record how often the watch erred in maps' runs, (inside, outside) of each, and what it saw
    within the range.
    """
    inside, outside = ([t for both in found for t in both[k]] for k in (0, 1))
    flagged = [t for t in inside if t.end.flags]
    scale = f"{len(inside)} runs within the range, with all samples and with 10 or 20"
    words = (f"{t.map}, {t.what}, {t.scheme} with {t.points}: {t.end.flags}" for t in flagged[:6])
    run.record(f"{name}.false_alarms", len(flagged) / len(inside), comparator="<=", bound=0.05,
               scale=scale, note="; ".join(("share flagged in any step", *words)))
    for field, pick in (("beyond", max), ("off", max), ("coverage", min), ("lost", max)):
        worst = pick(inside, key=lambda t, field=field: getattr(t.end, field))
        run.record(f"{name}.inside.{field}", getattr(worst.end, field), comparator="info",
                   scale=scale, note=f"{pick.__name__}imum: {worst.map}, {worst.what}, "
                                     f"{worst.scheme} with {worst.points} samples")
    record_silent(run, name, inside + outside, "gravity up to 50 m/s^2, torsion up to 2 m/s and "
                  "10 rad/s", broken(outside))


def broken(trials):
    """How many full-order runs there were that did not reach their end, in words."""
    stopped = {t.what for t in trials if "stopped" in t.what}
    return f"of the full-order runs themselves {len(stopped)} did not reach their end"
