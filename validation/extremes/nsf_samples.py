"""Reduced runs with network stress on too few samples, down to fewer equations than latent
coordinates, and on samples in one corner.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.cubature import misfit
from mpm_ref.rom.study.monitor import SPARSE
from mpm_ref.rom.study.samples import SampleSet

from ..common.registry import experiment
from ..nsf.reduced_runs import fit_study
from ..nsf.studies import ball, bread, cake, sand
from .ldm_runs import record_false_alarms, record_silent
from .nsf_runs import ERRORS, FieldBench, scenes
from .verdicts import FLAGGED, SILENT, STOPPED, trial_table

COUNTS = {"quick": (1, 3), "standard": (1, 2, 3, 4, 6, 10, 20)}
CLUSTERED = {"quick": (10, 100), "standard": (2, 10, 50, 200)}
DRAWS = {"quick": 1, "standard": 3}
LEFT = "model", "what", "samples", "left", "error", "kind"


@experiment("extremes.nsf.samples", title="NSF: too few samples, and samples in one corner",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 250})
def samples(run):
    """Check that no sampling spoils a run silently."""
    sampled, short = [], []
    for name, tested_study in scenes(run):
        bench = FieldBench(name, tested_study)
        for what, sample_set in run.progress(sample_sets(bench, run.profile), f"{name}, sets"):
            sampled.append(sampled_trial(bench, what, sample_set))
            if not has_enough_equations(bench, sample_set):
                short.append(sampled[-1][0])
    record_short(run, short)
    record_sampling(run, "extremes.nsf.samples", sampled)


@experiment("extremes.nsf.unseen", title="NSF: too few samples in scenes that did not set the "
            "bound", profiles=("quick", "standard"), budget={"quick": 30, "standard": 600})
def other_scenes(run):
    """Test whether the products' misfit on the samples tells bad runs of scenes that did not set
    its bound. Samples with fewer equations than latent coordinates, which `mpm-ref rom` refuses,
    are left out.
    """
    sampled = []
    for name, study in run.progress(other_studies(run).items(), "scenes"):
        bench = FieldBench(name, fit_study(study))
        sets = [(what, sample_set) for what, sample_set in small_sets(bench, run.profile)
                if has_enough_equations(bench, sample_set)]
        sampled += [sampled_trial(bench, *one) for one in run.progress(sets, f"{name}, sets")]
    record_sampling(run, "extremes.nsf.unseen", sampled)


def other_studies(run):
    """Return {name: `Study`} of the scenes that did not set the bound, with samples anywhere;
    without toothpaste, of which nearly all runs are bad.
    """
    studies = run.choose(quick=lambda: {"ball": ball(4), "sand": sand(4, train=4)},
                         standard=lambda: {"ball": ball(2), "sand": sand(2), "bread": bread(2),
                                           "cake": cake(2)})()
    return {name: study._replace(test=study.test[:2], column=None, later=None)
            for name, study in studies.items()}


def sampled_trial(bench, what, sample_set):
    """Return the `ReducedTrial` of a run on a `SampleSet`, and the products' misfit there."""
    fields = bench.tested.fields
    return bench.trial(what, sample_set), misfit(fields.U, fields.r, sample_set.points)


def has_enough_equations(bench, sample_set):
    """Return whether a `SampleSet` has as many equations as there are latent coordinates."""
    return len(sample_set.points) * bench.tested.fields.dim >= bench.tested.fields.r


def record_sampling(run, experiment_id, sampled):
    """Record pairs (`ReducedTrial`, misfit)."""
    trials = [trial for trial, _ in sampled]
    record_errors(run, experiment_id, trials)
    record_misfit(run, experiment_id, sampled)
    record_silent(run, experiment_id, trials, ERRORS)
    record_false_alarms(run, experiment_id, trials)
    run.table("left", LEFT, [(t.model, t.what, t.points, left, t.end.error, t.kind)
                             for t, left in sampled])
    trial_table(run, trials)


def sample_sets(bench, profile):
    """Return [(name, `SampleSet`)]: small random sets, and larger ones in a corner."""
    X = bench.tested.fields.X
    return [*small_sets(bench, profile),
            *((f"at the {place} corner", clustered(X, corner, count))
              for place, corner in corners(X).items() for count in CLUSTERED[profile])]


def small_sets(bench, profile):
    """Return (name, `SampleSet`) of small random sets."""
    return ((f"draw {draw}", bench.drawn(count, draw)) for count in COUNTS[profile]
            for draw in range(DRAWS[profile]))


def corners(X):
    """Return {name: place (d,)} of two opposite corners of the points' box."""
    return {"lower": X.min(axis=0), "upper": X.max(axis=0)}


def clustered(X, place, count):
    """Return the `SampleSet` of the points X (n, 3) nearest to a place."""
    return SampleSet(0.0, np.sort(KDTree(X).query(place, count)[1]))


def record_errors(run, experiment_id, trials):
    """Record the error of every run of an experiment."""
    for t in trials:
        what = t.what.replace(" ", "-")
        run.record(f"{experiment_id}.{t.model}.{t.points}.{what}", t.end.error, unit="%",
                   comparator="info", scale=f"{t.model}, {ERRORS}",
                   note="; ".join(filter(None, (
                       t.kind, f"with the usual number of samples {t.usual:.3g} %",
                       f"rank at least {t.end.rank}", t.end.message))))


def record_misfit(run, experiment_id, sampled):
    """Record the share of bad runs, pairs (`ReducedTrial`, misfit), that the misfit tells before
    they begin, also among the silent ones.
    """
    warned = {True: [], False: []}
    for t, left in sampled:
        warned[t.is_bad].append((left > SPARSE, t.kind))
    bad, good = ([warns for warns, _ in warned[is_bad]] for is_bad in (True, False))
    silent = [warns for warns, kind in warned[True] if kind == SILENT]
    run.record(f"{experiment_id}.told", sum(bad) / max(len(bad), 1), comparator="info",
               scale=f"{len(sampled)} runs", note=f"share of the {len(bad)} bad runs whose samples "
               f"leave more than {SPARSE:g} of the products; so do those of {sum(silent)} of the "
               f"{len(silent)} silent ones, and of {sum(good)} of the {len(good)} that are good")


def record_short(run, trials):
    """Record the share of runs with fewer equations than latent coordinates that were noticed."""
    noticed = [t for t in trials
               if t.kind == STOPPED or (t.kind == FLAGGED and "blind" in t.end.flags)]
    run.record("extremes.nsf.samples.short", len(noticed) / len(trials), paper=1.0, comparator="=",
               scale=f"{len(trials)} runs with 3 |S| < r", note="share flagged as blind or "
               "stopped; `mpm-ref rom` refuses them before the first step")
