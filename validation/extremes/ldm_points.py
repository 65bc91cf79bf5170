"""Reduced runs with very few samples, with samples in one place, and with r from 1 to full."""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.fields.pod import measured, numerical_rank
from mpm_ref.rom.study.run import SCHEMES, RunOptions

from ..common.registry import experiment
from ..ldm.studies import GRAVITY, TORSION
from .ldm_range import beside
from .ldm_runs import STOPPED, Trial, ended, learned, linear, record_silent, table_of

MU = {"gravity": tuple(GRAVITY.mu[21]), "torsion": tuple(TORSION.mu[20])}   # tests, of each study
COUNTS = {"quick": (1, 2, 3, 5, 10), "standard": (1, 2, 3, 4, 5, 6, 8, 10, 20)}
TOGETHER = {"quick": (10, 200), "standard": (3, 10, 50, 200)}
PLACES = {"tip": (0.4, 0.0, 0.0), "held end": (0.0, 0.0, 0.0), "middle": (0.2, 0.0, 0.0),
          "side": (0.2, 0.0, 0.1)}          # of the cylinder [m]
SCALE = "gravity 7.5 m/s^2, torsion 0.36 m/s and 0.8 rad/s, as trained"


class Bench:
    """A map, the run that it is tried on, and what is usual for it: the error with all samples."""

    def __init__(self, reduction, study="gravity", usual=None):
        self.reduction, (self.case, self.x, _) = reduction, beside(study, MU[study])
        self.known = {}
        self.usual = self.ended(RunOptions()).error if usual is None else usual

    def ended(self, way):
        """`End` of the run, made once."""
        if way not in self.known:
            self.known[way] = ended(self.case, self.x, self.reduction, way)
        return self.known[way]

    def trial(self, what, way, end=None):
        """`Trial` of the run, or of another end."""
        return Trial(self.reduction.name, what, way.name, way.points or len(self.case.X),
                     self.usual, end or self.ended(way))

    def together(self, place, count):
        """`Trial` with the samples nearest to a place, in all steps."""
        way, near = RunOptions(points=count), np.sort(KDTree(self.case.X).query(PLACES[place],
                                                                                count)[1])
        return self.trial(f"together at the {place}", way,
                          ended(self.case, self.x, self.reduction, way, lambda t: near))


@experiment("extremes.ldm.points", title="LDM: few samples, samples in one place, r to full",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 120})
def points(run):
    """No sampling may spoil a run without a word."""
    names = run.choose(quick=("gravity-r4",), standard=("gravity-r2", "gravity-r4", "gravity-r7",
                                                        "torsion-0"))
    schemes = run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])
    found = []
    for name in run.progress(names, "maps"):
        bench = Bench(learned(name), name.partition("-")[0])
        found += [bench.trial("few", RunOptions(*scheme, count)) for scheme in schemes
                  for count in COUNTS[run.profile]]
        if name.startswith("gravity"):
            found += [bench.together(place, count) for place in PLACES
                      for count in TOGETHER[run.profile]]
    record_refused(run, found)
    record_silent(run, "extremes.ldm.points", found, SCALE)
    ranks = dimensions(run)
    record_silent(run, "extremes.ldm.points.r", ranks, SCALE,
                  f"at full rank and with few samples: {ranks[-1].end.said or 'ran to its end'}")
    table_of(run, found + ranks)


def record_refused(run, trials):
    """Record whether runs with fewer equations than coordinates stopped before their first step."""
    short = [t for t in trials if 3 * t.points < r_of(t.map)]
    refused = [t for t in short if t.kind == STOPPED and t.end.steps == 0
               and "expected at least" in t.end.said]
    run.record("extremes.ldm.points.refused", len(refused) / len(short), paper=1.0, comparator="=",
               scale=f"{len(short)} runs with 3 |M| < r", note=short[0].end.said)


def r_of(name):
    """Number of latent coordinates of a trained map."""
    return len(learned(name).rest)


def dimensions(run):
    """`Trial`s with r = 1 .. 7 learned, and POD from 1 to all modes that its snapshots have, with
    all samples and with few.
    """
    found = [Bench(learned(f"gravity-r{r}")).trial("learned", RunOptions(points=10))
             for r in run.choose(quick=(7,), standard=range(1, 8))]
    runs = GRAVITY.train[::run.choose(quick=12, standard=6)]
    snapshots = GRAVITY.run(runs)
    displaced = measured(snapshots.X, *snapshots.flat(), 0.0)
    everything = numerical_rank(np.linalg.svd(displaced, compute_uv=False))
    for r in (*run.choose(quick=(), standard=(1, 4, 15, 30, 60)), everything):
        bench = Bench(linear(snapshots, r))
        found += [bench.trial("POD", RunOptions()),
                  bench.trial("POD", RunOptions(points=max(10, r // 3 + 5)))]
    return found
