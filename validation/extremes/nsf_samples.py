"""Reduced runs with inferred stress on too few samples, down to one equation for each latent
coordinate and below, and on samples in one corner.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.cubature import misfit
from mpm_ref.rom.study.monitor import SPARSE
from mpm_ref.rom.study.samples import SampleSet

from ..common.registry import experiment
from ..nsf.reduced_runs import fit_study
from ..nsf.studies import ball, bread, cake, sand
from .ldm_runs import FLAGGED, SILENT, STOPPED, record_silent, table_of
from .nsf_beyond import is_bad
from .nsf_runs import ERRORS, Bench, scenes

COUNTS = {"quick": (1, 3), "standard": (1, 2, 3, 4, 6, 10, 20)}
TOGETHER = {"quick": (10, 100), "standard": (2, 10, 50, 200)}
DRAWS = {"quick": 1, "standard": 3}
LEFT = "map", "what", "samples", "left", "error", "kind"


@experiment("extremes.nsf.samples", title="NSF: too few samples, and samples in one corner",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 250})
def samples(run):
    """No sampling may spoil a run without a word."""
    found, short = [], []
    for name, one in scenes(run):
        bench = Bench(name, one)
        for what, chosen in run.progress(sets_of(bench, run.profile), f"{name}, sets"):
            found.append(judged(bench, what, chosen))
            if not suffices(bench, chosen):
                short.append(found[-1][0])
    record_short(run, short)
    record_judged(run, "extremes.nsf.samples", found)


@experiment("extremes.nsf.unseen", title="NSF: too few samples in scenes that the bound has not "
            "seen", profiles=("quick", "standard"), budget={"quick": 30, "standard": 600})
def unseen(run):
    """Whether what samples leave of the products tells bad runs of scenes by which its bound was
    not chosen. Samples with fewer equations than latent coordinates are left out: `mpm-ref rom`
    refuses them.
    """
    found = []
    for name, study in run.progress(others(run).items(), "scenes"):
        bench = Bench(name, fit_study(study))
        sets = [(what, chosen) for what, chosen in few(bench, run.profile)
                if suffices(bench, chosen)]
        found += [judged(bench, *own) for own in run.progress(sets, f"{name}, sets")]
    record_judged(run, "extremes.nsf.unseen", found)


def others(run):
    """{name: `Study`} of the scenes by which the bound was not chosen, whose samples are anywhere;
    but toothpaste, of which nearly all runs are bad.
    """
    found = run.choose(quick=lambda: {"ball": ball(4), "sand": sand(4, train=4)},
                       standard=lambda: {"ball": ball(2), "sand": sand(2), "bread": bread(2),
                                         "cake": cake(2)})()
    return {name: study._replace(test=study.test[:2], column=None, later=None)
            for name, study in found.items()}


def judged(bench, what, chosen):
    """The `Trial` of a run on `SampleSet` samples, and what these leave of the products."""
    fields = bench.one.fields
    return bench.trial(what, chosen), misfit(fields.U, fields.r, chosen.points)


def suffices(bench, chosen):
    """Whether `SampleSet` samples have as many equations as there are latent coordinates."""
    return len(chosen.points) * bench.one.fields.dim >= bench.one.fields.r


def record_judged(run, id, found):
    """Record (`Trial`, what its samples left)."""
    trials = [trial for trial, _ in found]
    record_all(run, id, trials)
    record_told(run, id, found)
    record_silent(run, id, trials, ERRORS)
    run.table("left", LEFT, [(t.map, t.what, t.points, left, t.end.error, t.kind)
                             for t, left in found])
    table_of(run, trials)


def sets_of(bench, profile):
    """[(name, `SampleSet`)] of samples: few, and many in a corner."""
    X = bench.one.fields.X
    return [*few(bench, profile),
            *((f"at the {place} corner", clustered(X, corner, count))
              for place, corner in corners(X).items() for count in TOGETHER[profile])]


def few(bench, profile):
    """(name, `SampleSet`) of few samples each."""
    return ((f"draw {draw}", bench.drawn(count, draw)) for count in COUNTS[profile]
            for draw in range(DRAWS[profile]))


def corners(X):
    """{name: place (d,)} of two opposite corners of the points' box."""
    return {"lower": X.min(axis=0), "upper": X.max(axis=0)}


def clustered(X, place, count):
    """`SampleSet`: the points X (n, d) nearest to a place."""
    return SampleSet(0.0, np.sort(KDTree(X).query(place, count)[1]))


def record_all(run, id, trials):
    """Record the error of every run of an experiment."""
    for t in trials:
        words = t.what.replace(" ", "-")
        run.record(f"{id}.{t.map}.{t.points}.{words}", t.end.error, unit="%",
                   comparator="info", scale=f"{t.map}, {ERRORS}",
                   note="; ".join(filter(None, (
                       t.kind, f"with as many samples as usual {t.usual:.3g} %",
                       f"rank at least {t.end.rank}", t.end.said))))


def record_told(run, id, found):
    """Record the share of the bad runs of (`Trial`, what its samples left) that are told before
    they begin, and of those among them that nothing tells later.
    """
    told = {True: [], False: []}
    for t, left in found:
        told[is_bad(t)].append((left > SPARSE, t.kind))
    bad, good = ([tells for tells, _ in told[wrong]] for wrong in (True, False))
    silent = [tells for tells, kind in told[True] if kind == SILENT]
    run.record(f"{id}.told", sum(bad) / max(len(bad), 1), comparator="info",
               scale=f"{len(found)} runs", note=f"share of the {len(bad)} bad runs whose samples "
               f"leave more than {SPARSE:g} of the products; so do those of {sum(silent)} of the "
               f"{len(silent)} silent ones, and of {sum(good)} of the {len(good)} that are good")


def record_short(run, trials):
    """Record whether runs with fewer equations than latent coordinates were told as such."""
    told = [t for t in trials
            if t.kind == STOPPED or (t.kind == FLAGGED and "blind" in t.end.flags)]
    run.record("extremes.nsf.samples.short", len(told) / len(trials), paper=1.0, comparator="=",
               scale=f"{len(trials)} runs with 3 |S| < r", note="share flagged as blind or "
               "stopped; `mpm-ref rom` refuses them before the first step")
