"""Reduced runs with inferred stress on too few samples, down to one equation for each latent
coordinate and below, and on samples in one corner.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.reduced.inferring import Chosen

from ..registry import experiment
from .ldm_runs import FLAGGED, STOPPED, record_silent, table_of
from .nsf_runs import ERRORS, Bench, scenes

COUNTS = {"quick": (1, 3), "standard": (1, 2, 3, 4, 6, 10, 20)}
TOGETHER = {"quick": (10, 100), "standard": (2, 10, 50, 200)}
DRAWS = {"quick": 1, "standard": 3}


@experiment("extremes.nsf.samples", title="NSF: too few samples, and samples in one corner",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 250})
def samples(run):
    """No sampling may spoil a run without a word."""
    found, short = [], []
    for name, one in scenes(run):
        bench, X = Bench(name, one), one.fields.X
        few = [bench.trial(f"draw {draw}", bench.drawn(count, draw))
               for count in run.progress(COUNTS[run.profile], f"{name}, numbers")
               for draw in range(DRAWS[run.profile])]
        short += [t for t in few if t.points * X.shape[1] < one.fields.r]
        found += few
        found += [bench.trial(f"at the {place} corner", clustered(X, corner, count))
                  for place, corner in corners(X).items() for count in TOGETHER[run.profile]]
    record_all(run, found)
    record_short(run, short)
    record_silent(run, "extremes.nsf.samples", found, ERRORS)
    table_of(run, found)


def corners(X):
    """{name: place (d,)} of two opposite corners of the points' box."""
    return {"lower": X.min(axis=0), "upper": X.max(axis=0)}


def clustered(X, place, count):
    """`Chosen`: the points X (n, d) nearest to a place."""
    return Chosen(0.0, np.sort(KDTree(X).query(place, count)[1]))


def record_all(run, trials):
    """Record the error of every run."""
    for t in trials:
        words = t.what.replace(" ", "-")
        run.record(f"extremes.nsf.samples.{t.map}.{t.points}.{words}", t.end.error, unit="%",
                   comparator="info", scale=f"{t.map}, {ERRORS}",
                   note="; ".join(filter(None, (
                       t.kind, f"with as many samples as usual {t.usual:.3g} %",
                       f"rank at least {t.end.rank}", t.end.said))))


def record_short(run, trials):
    """Record whether runs with fewer equations than latent coordinates were told as such."""
    told = [t for t in trials
            if t.kind == STOPPED or (t.kind == FLAGGED and "blind" in t.end.flags)]
    run.record("extremes.nsf.samples.short", len(told) / len(trials), paper=1.0, comparator="=",
               scale=f"{len(trials)} runs with 3 |S| < r", note="share flagged as blind or "
               "stopped; `mpm-ref rom` refuses them before the first step")
