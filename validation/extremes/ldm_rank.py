"""Reduced runs with few equations or dependent coordinates: few samples, samples in one place, r
from 1 to full, and maps with latent coordinates that move nothing of their own.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.fields.network import Decoder
from mpm_ref.rom.fields.perceptron import layers_of, network
from mpm_ref.rom.fields.pod import PodModes, measured, numerical_rank
from mpm_ref.rom.study.run import SCHEMES, RunOptions
from mpm_ref.rom.study.samples import SampleSet

from ..common.registry import experiment
from ..ldm.studies import GRAVITY, TORSION
from .ldm_extrapolation import full_order_run
from .ldm_runs import (
    ReducedTrial,
    pod_reduction,
    record_false_alarms,
    record_silent,
    reduced_end,
    trained_reduction,
)
from .verdicts import STOPPED, trial_table

MU = {"gravity": tuple(GRAVITY.mu[21]), "torsion": tuple(TORSION.mu[20])}   # tests, of each study
COUNTS = {"quick": (1, 2, 3, 5, 10), "standard": (1, 2, 3, 4, 5, 6, 8, 10, 20)}
CLUSTERED = {"quick": (10, 200), "standard": (3, 10, 50, 200)}
OTHERS = "gravity-r3", "gravity-r5", "gravity-r6"     # maps whose runs set no bound of the monitor
PLACES = {"tip": (0.4, 0.0, 0.0), "held end": (0.0, 0.0, 0.0), "middle": (0.2, 0.0, 0.0),
          "side": (0.2, 0.0, 0.1)}          # of the cylinder [m]
SCALE = "gravity 7.5 m/s^2, torsion 0.36 m/s and 0.8 rad/s, as trained"


class ReductionBench:
    """A map, a run to try it on, and its usual error: that with all samples."""

    def __init__(self, reduction, study="gravity", usual=None):
        self.reduction, (self.full, self.x, _) = reduction, full_order_run(study, MU[study])
        self.ends = {}
        self.usual = self.end(RunOptions()).error if usual is None else usual

    def end(self, options):
        """Return the `ReducedEnd` of the run with some options, computed once."""
        if options not in self.ends:
            self.ends[options] = reduced_end(self.full, self.x, self.reduction, options)
        return self.ends[options]

    def trial(self, what, options, end=None):
        """Return the `ReducedTrial` of the run, or of another end."""
        return ReducedTrial(self.reduction.name, what, options.name,
                            options.points or len(self.full.X), self.usual,
                            end or self.end(options))

    def clustered_trial(self, place, count):
        """Return the `ReducedTrial` with the samples nearest to a place, in all steps."""
        options = RunOptions(points=count)
        nearest = np.sort(KDTree(self.full.X).query(PLACES[place], count)[1])
        end = reduced_end(self.full, self.x, self.reduction, options,
                          lambda t, latent: SampleSet(t, nearest))
        return self.trial(f"together at the {place}", options, end)


@experiment("extremes.ldm.points", title="LDM: few samples, samples in one place, r to full",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 120})
def points(run):
    """Check that no sampling spoils a run silently."""
    names = run.choose(quick=("gravity-r4",), standard=("gravity-r2", "gravity-r4", "gravity-r7",
                                                        "torsion-0"))
    trials = [t for name in run.progress(names, "maps") for t in few_samples_trials(run, name)]
    others = [t for name in run.choose(quick=(), standard=OTHERS)
              for t in few_samples_trials(run, name)]
    record_refused(run, trials)
    for part, group in (("", trials), (".other_maps", others)):
        if group:
            record_silent(run, f"extremes.ldm.points{part}", group, SCALE)
            record_false_alarms(run, f"extremes.ldm.points{part}", group)
    ranks = rank_trials(run)
    record_silent(run, "extremes.ldm.points.r", ranks, SCALE, "at full rank and with few samples: "
                  + (ranks[-1].end.message or "finished"))
    trial_table(run, trials + others + ranks)


def few_samples_trials(run, name):
    """Return the `ReducedTrial`s of a trained map with few samples, or with some in one place."""
    schemes = run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])
    bench = ReductionBench(trained_reduction(name), name.partition("-")[0])
    few = [bench.trial("few", RunOptions(*scheme, count)) for scheme in schemes
           for count in COUNTS[run.profile]]
    if not name.startswith("gravity"):
        return few
    return few + [bench.clustered_trial(place, count) for place in PLACES
                  for count in CLUSTERED[run.profile]]


def record_refused(run, trials):
    """Record whether runs with fewer equations than coordinates stopped before their first step."""
    short = [t for t in trials if 3 * t.points < len(trained_reduction(t.model).rest)]
    refused = [t for t in short if t.kind == STOPPED and t.end.steps == 0
               and "expected at least" in t.end.message]
    run.record("extremes.ldm.points.refused", len(refused) / len(short), paper=1.0, comparator="=",
               scale=f"{len(short)} runs with 3 |M| < r", note=short[0].end.message)


def rank_trials(run):
    """Return `ReducedTrial`s of learned maps with r = 1 .. 7, and of POD from 1 to all modes of its
    snapshots, with all samples and with few.
    """
    trials = [ReductionBench(trained_reduction(f"gravity-r{r}")).trial("learned",
                                                                       RunOptions(points=10))
              for r in run.choose(quick=(7,), standard=range(1, 8))]
    snapshots = GRAVITY.run(GRAVITY.train[::run.choose(quick=12, standard=6)])
    displacements = measured(snapshots.X, *snapshots.flat(), 0.0)
    full_rank = numerical_rank(np.linalg.svd(displacements, compute_uv=False))
    for r in (*run.choose(quick=(), standard=(1, 4, 15, 30, 60)), full_rank):
        bench = ReductionBench(pod_reduction(snapshots, r))
        trials += [bench.trial("POD", RunOptions()),
                   bench.trial("POD", RunOptions(points=max(10, r // 3 + 5)))]
    return trials


NET, R = "gravity-r4", 4
NEAR = {"quick": (1e-7, 1e-13), "standard": (1e-3, 1e-5, 1e-7, 1e-13)}     # from a column to its
                    # copy, over the column
RANKED = 1e-10      # the rank is counted down to this share
EQUAL_WITHIN = 1.1  # errors within this factor are as good
FEW = 10            # samples
SINGULAR_SCALE = "gravity 7.5 m/s^2, r = 4 and one coordinate more"


def with_extra_column(reduction, row, name):
    """Return a trained map with one more latent coordinate, given its weights (width,) in the first
    layer; it is zero in training.
    """
    (W, b), *rest = layers_of(reduction.field.net)
    net = network([(np.vstack([W, row]), b), *rest])
    return reduction._replace(name=name, field=Decoder(net, reduction.field.units),
                              xhat=with_zero(reduction.xhat), rest=with_zero(reduction.rest))


def with_last_column(reduction, row, name):
    """Return a trained map whose last latent coordinate has other weights in the first layer."""
    (W, b), *rest = layers_of(reduction.field.net)
    net = network([(np.vstack([W[:-1], row]), b), *rest])
    return reduction._replace(name=name, field=Decoder(net, reduction.field.units))


def deficient_maps(sound):
    """Return `Reduction`s that lack a coordinate of the sound one."""
    W = layers_of(sound.field.net)[0][0]
    return [with_last_column(sound, 0.0 * W[-1], "the last column zero"),
            with_last_column(sound, W[-2], "the last column as the one before")]


def with_repeated_mode(reduction, share, name):
    """Return POD modes with one more: a share of the first."""
    modes = reduction.field
    U, slope = (np.concatenate([a, share * a[..., :1]], axis=-1) for a in (modes.U, modes.slope))
    return reduction._replace(name=name, field=PodModes(modes.X, U, slope, modes.tree),
                              xhat=with_zero(reduction.xhat), rest=with_zero(reduction.rest))


def with_zero(a):
    """Return an array with one more entry, zero, on its last axis."""
    return np.concatenate([a, np.zeros_like(a[..., :1])], axis=-1)


def redundant_maps(sound, pod, near, rng):
    """Return [(`Reduction`, rank)] with one coordinate more than the sound ones and no more
    freedom; near: distances of columns.
    """
    W = layers_of(sound.field.net)[0][0]
    noise = rng.normal(size=W.shape[1]) * np.abs(W[-1]).max()
    maps = [(with_extra_column(sound, 0.0 * W[-1], "a column of zeros"), R),
            (with_extra_column(sound, W[-1], "a column twice"), R),
            (with_repeated_mode(pod, 1.0, "a mode twice"), R),
            (with_repeated_mode(pod, 0.0, "a mode of zeros"), R)]
    return maps + [(with_extra_column(sound, W[-1] + eps * noise, f"a column and one {eps:g} from "
                                      "it"), R + (eps > RANKED)) for eps in near]


@experiment("extremes.ldm.singular", title="LDM: latent coordinates that depend on each other",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 40})
def singular(run):
    """Check that the rank is reported, that a redundant coordinate does no harm, and that a missing
    one is noticed.
    """
    sound = trained_reduction(NET)
    pod = pod_reduction(GRAVITY.run(GRAVITY.train[::run.choose(quick=12, standard=6)]), R)
    choices = [RunOptions(*scheme)
               for scheme in run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])]
    sound_benches = {False: ReductionBench(sound), True: ReductionBench(pod)}
    redundant, sparse = [], []
    maps = redundant_maps(sound, pod, NEAR[run.profile], run.rng)
    for reduction, rank in run.progress(maps, "maps"):
        sound_bench = sound_benches[isinstance(reduction.field, PodModes)]
        bench = ReductionBench(reduction, usual=sound_bench.usual)
        redundant += [(bench.trial("redundant", options), sound_bench.end(options).error, rank)
                      for options in choices]
        sparse.append(bench.trial("redundant", RunOptions(points=FEW)))
    usual = sound_benches[False].usual
    deficient = [ReductionBench(reduction, usual=usual).trial("lacking", options)
                 for reduction in deficient_maps(sound) for options in choices]
    record_redundant(run, redundant, sparse)
    trials = [trial for trial, *_ in redundant] + sparse + deficient
    record_silent(run, "extremes.ldm.singular", trials, SINGULAR_SCALE)
    trial_table(run, trials)


def record_redundant(run, redundant, sparse):
    """Record ranks and errors of maps with too many coordinates, rows (`ReducedTrial`, error of the
    sound map, rank), and the errors of trials with few samples.
    """
    wrong = [f"{t.model}: {t.end.rank}" for t, _, rank in redundant if t.end.rank != rank]
    run.record("extremes.ldm.singular.rank", 1.0 - len(wrong) / len(redundant), paper=1.0,
               comparator="=", scale=f"{len(redundant)} runs, {SINGULAR_SCALE}",
               note="; ".join(("share whose reported rank is right", *wrong)))
    ratios = {t: max(t.end.error / error, error / t.end.error) for t, error, _ in redundant}
    worst = max(ratios, key=ratios.get)
    run.record("extremes.ldm.singular.harm", ratios[worst], comparator="<=", bound=EQUAL_WITHIN,
               scale=f"{len(redundant)} runs, {SINGULAR_SCALE}", note="error over that of the map "
               f"without the coordinate, or the reverse, at most: {worst.model}, {worst.scheme}")
    worst = max(sparse, key=lambda t: t.end.error / t.usual)
    run.record("extremes.ldm.singular.few", worst.end.error, unit="%", comparator="info",
               scale=f"{FEW} samples", note=f"largest error: {worst.model}; the sound map's with "
               f"all samples is {worst.usual:.3g} %")
