"""Calibration of the bound on `departure` in LDM's runs (see `mpm_ref.rom.study.monitor`).

The runs have parameters of training runs, which no other experiment of this group runs, on maps of
r = 1, 2, 4 and 7 of gravity and on two of torsion: all samples, few, samples in one place, and
longer steps. The maps r = 3, 5 and 6 of gravity and one of torsion set no bound.
"""

import numpy as np
from scipy.spatial import KDTree

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.monitor import DEPARTURE
from mpm_ref.rom.study.run import SCHEMES, RunOptions
from mpm_ref.rom.study.samples import SampleSet

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.studies import GRAVITY, STUDIES, TORSION
from .ldm_extrapolation import full_order_run
from .ldm_rank import PLACES
from .ldm_runs import ReducedTrial, reduced_end, trained_reduction
from .verdicts import STOPPED, record_bound, trial_table

MAPS = {"quick": ("gravity-r4",),
        "standard": (*(f"gravity-r{r}" for r in (1, 2, 4, 7)), "torsion-0", "torsion-2")}
VALUES = {"gravity": [tuple(GRAVITY.mu[k]) for k in GRAVITY.train[2::8]],
          "torsion": [tuple(TORSION.mu[k]) for k in TORSION.train[4::9][:3]]}
COUNTS = {"quick": (3, 10), "standard": (2, 3, 4, 5, 6, 8, 10, 20, 50)}
CLUSTERED = 10, 100
FACTORS = 2, 3, 5       # of the time step


@experiment("extremes.ldm.bound", title="LDM: calibration of the bound on departure",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 250})
def calibration(run):
    """Record the errors of the bound, and the table `curve` of other bounds. Runs that stop, or
    have coordinates that no sample shows, need no bound and are left out.
    """
    names = MAPS[run.profile]
    trials = [t for name in run.progress(names, "maps") for mu in values_of(run, name)
              for t in calibration_trials(run, name, mu)]
    trials = [t for t in trials if t.kind != STOPPED and "blind" not in t.end.flags]
    record_bound(run, "extremes.ldm.bound", trials, lambda t: t.end.departure, DEPARTURE)
    trial_table(run, trials)


def values_of(run, name):
    """Return the parameters of a map's runs."""
    return VALUES[name.partition("-")[0]][:run.choose(quick=1, standard=None)]


def calibration_trials(run, name, mu):
    """Return the `ReducedTrial`s of a map at one parameter; the usual error is with all samples."""
    study, reduction = name.partition("-")[0], trained_reduction(name)
    full, x, _ = full_order_run(study, mu)

    def trial(what, options, full=full, x=x, sampler=None):
        end = reduced_end(full, x, reduction, options, sampler)
        return ReducedTrial(name, f"{mu}: {what}", options.name, options.points or len(full.X),
                            np.nan, end)

    trials = [trial("all", RunOptions())]
    trials += [trial("few", RunOptions(*scheme, count)) for count in COUNTS[run.profile]
               for scheme in SCHEMES[:2]]
    if study == "gravity":
        trials += [trial(f"together at the {place}", RunOptions(points=count),
                         sampler=nearest_sampler(full.X, PLACES[place], count))
                   for place in PLACES for count in CLUSTERED]
        for factor in FACTORS:
            scene = STUDIES[study].scene(*mu)
            longer = ldm_full_model(with_(scene, dt=factor * scene.dt,
                                          steps=scene.steps // factor))
            trials += [trial(f"{factor} dt", RunOptions(points=points), longer, x[::factor])
                       for points in (None, 50)]
    return [t._replace(usual=trials[0].end.error) for t in trials]


def nearest_sampler(X, place, count):
    """Return the function of the time and the `Latent` that gives the `SampleSet` of the points X
    nearest to a place.
    """
    nearest = np.sort(KDTree(X).query(place, count)[1])
    return lambda t, latent: SampleSet(t, nearest)
