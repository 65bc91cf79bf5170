"""Calibration of the bounds on strains beyond training (see `mpm_ref.nclaw.strain_watch`): small
laws at the end of their training, whose bodies are thrown, strained at the start, or of another
density. The laws of the paper's tables, by which the bounds are judged, are not among them.
"""

import numpy as np

from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.strain_watch import MAX_EXCESS, MEAN_EXCESS

from ..common.registry import experiment
from ..common.scenes import with_
from ..common.weights_needed import load_available
from ..nclaw.small_trainings import OF_EPOCHS, bundled
from .nclaw_extrapolation import denser, thrown
from .nclaw_runs import EVERY, SHORT, Law, LawSetup, law_trials
from .verdicts import record_bound, trial_table

THROWS = {"quick": (2.0,), "standard": (0.0, 0.7, 1.25, 1.5, 1.75, 2.0, 2.5)}
STRETCHES = {"quick": (1.3,), "standard": (0.6, 0.75, 0.9, 1.1, 1.3, 1.4, 1.6, 1.8)}    # along x
ASIDE = {"quick": (), "standard": (0.7, 0.9, 1.15, 1.3, 1.5)}       # along y
DENSITIES = {"quick": (4.0,), "standard": (0.1, 0.15, 0.25, 0.35, 0.5, 0.7, 1.5, 3.0, 4.0)}


@experiment("extremes.nclaw.bound", title="NCLaw: calibration of the bounds on strains",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 150})
def calibration(run):
    """Record how often the two bounds together err, as a share of either bound, and the table
    `curve` of other common factors. A law that breaks down in its training run is left out.
    """
    names = run.choose(quick=list(OF_EPOCHS)[:1], standard=list(OF_EPOCHS))
    trials = [t for name, bundle in load_available(run, names, bundled).items()
              for t in calibration_trials(run, OF_EPOCHS[name], bundle.laws)
              if np.isfinite(t.usual)]
    judged = [JudgedTrial(t) for t in trials]
    record_bound(run, "extremes.nclaw.bound", judged, share_of_bounds, 1.0)
    trial_table(run, trials)


class JudgedTrial:
    """A `LawTrial` whose badness is a property, as `verdicts` asks for it."""

    def __init__(self, trial):
        self.end, self.is_bad = trial.end, trial.is_bad()


def share_of_bounds(trial):
    """Return the largest excess over its bound, or the largest mean excess over its own."""
    return max(trial.end.beyond / MAX_EXCESS, trial.end.mean / MEAN_EXCESS)


def calibration_trials(run, net, by_epoch):
    """Return the `LawTrial`s of the last laws {epoch: laws} of a `Small`."""
    laws = by_epoch[max(by_epoch)]
    law = Law(net.environment, net.environment, body_maker(laws), laws.about["seen"],
              laws.about["dt"])
    scene = with_(net.scene, every=EVERY)
    if run.profile == "quick":
        scene = with_(scene, steps=SHORT)
    setups = [LawSetup("as trained", scene),
              *(LawSetup(f"thrown {k:g} times as fast", thrown(scene, k))
                for k in THROWS[run.profile]),
              *(LawSetup(f"stretched {k:g} times", scene, np.diag([k, 1.0, 1.0]))
                for k in STRETCHES[run.profile]),
              *(LawSetup(f"stretched {k:g} times along y", scene, np.diag([1.0, k, 1.0]))
                for k in ASIDE[run.profile]),
              *(LawSetup(f"{k:g} times as dense", denser(scene, k))
                for k in DENSITIES[run.profile])]
    return law_trials(run, law, setups)
