"""Runs of learned laws at their extremes: the end of each, compared with the same run of the true
laws, and its strain reports (see `mpm_ref.nclaw.strain_watch`).

A run is bad where its error is above BAD times the usual one, that of the law on its training run,
and where it stops. It stops where a point has no finite position any more, and is flagged where
strains are outside of those of training, the time step is another one, or the law is poor: its
error on its own training run is large; `verdicts` has the four verdicts. Runs are not stopped for
their energy: a wrong law usually ends at the walls.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.bodies import body_maker, copy_body
from mpm_ref.nclaw.strain_watch import is_poor, strain_report
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.scenes import threads_for
from ..common.weights_needed import load_available
from ..nclaw.environments import ENVIRONMENTS, environment
from ..nclaw.strain_bounds import visited_bounds
from ..nclaw.trained_laws import trained
from .verdicts import SILENT, verdict, verdict_counts

BAD = 3.0           # times the usual mean squared error of the law
BAD_FACTORS = 2.0, BAD, 5.0, 10.0
LOST = 10.0         # widths of the bounds: a point farther out is lost
EVERY = 20          # steps between frames, of the trained length
SHORT = 200         # steps, quick
CHOSEN = ("jelly", "plasticine")        # laws on whose runs the monitor's bound was chosen


class Law(NamedTuple):
    """A learned law to run."""

    name: str
    environment: str
    make: object        # copies a body with the learned law
    bounds: dict        # of the strains in training
    dt: float           # [s] of training


class LawSetup(NamedTuple):
    """A run: a scene, and the initial deformation gradient (d, d) of all points."""

    what: str
    scene: object
    F: tuple = ()       # empty: that of the scene


class LawEnd(NamedTuple):
    """The end of a run with a learned law, and the extremes of its strain reports."""

    error: float        # mean squared, of the frames that it reached [m^2]; infinite if it stopped
    steps: int          # completed
    first: int          # the first step that was flagged, -1 for none
    flags: str          # all quantities that were ever out of bounds
    beyond: float       # largest
    lost: int           # the step in which a point was LOST out of bounds, or stopped; -1 for none
    J: float            # smallest, of the points that were farthest out of bounds
    mean: float         # largest mean over all points of their distance out of bounds
    message: str        # the sentence with which it stopped, "" if it ran to its end


class LawTrial(NamedTuple):
    """A run of an experiment with a learned law."""

    law: str
    what: str
    usual: float        # error of the law on its training run [m^2]
    end: LawEnd

    @property
    def kind(self):
        """The verdict on the run."""
        return verdict(self.end, self.is_bad())

    def is_bad(self, factor=BAD):
        """Return whether the error is above `factor` times the usual one, or infinite."""
        return not (np.isfinite(self.end.error) and self.end.error <= factor * self.usual)


@cache
def trained_law(name):
    """Return the `Law` with the weights of an environment. Raises `Untrained`."""
    laws = trained(name)
    return Law(name, name, body_maker(laws), visited_bounds(name), environment(name).dt)


def laws(run):
    """Return the `Law`s of an experiment: one at quick, all that are trained at standard."""
    names = run.choose(quick=CHOSEN[:1], standard=ENVIRONMENTS)
    return list(load_available(run, names, trained_law).values())


def scene_for(run, name, **changes):
    """Return the scene of an environment with a frame every EVERY steps; cut short at quick."""
    steps = run.choose(quick=SHORT, standard=environment(name).steps)
    return environment(name, **{"every": EVERY, "steps": steps, **changes})


def law_end(law, setup):
    """Run a `LawSetup` with a learned law and with the scene's own laws. Returns the `LawEnd`."""
    problem, reference = build(setup.scene), build(setup.scene)
    body, true = law.make(problem.bodies[0]), copy_body(reference.bodies[0])
    for one in (body, true):
        set_deformation(one, setup.F)
    errors, reports, message = [], [], ""
    with threads_for(problem.bodies), np.errstate(invalid="ignore", over="ignore"):
        run = positions(problem, (body,))
        for x in positions(reference, (true,)):
            try:
                errors.append(float(np.mean((next(run) - x) ** 2)))
            except RunBroken as end:
                message = str(end)
                break
            reports.append(strain_report(body, law.bounds))
    return summarize_reports(reports, np.inf if message else np.mean(errors), message,
                             (setup.scene.every, setup.scene.dt != law.dt))


def set_deformation(body, F):
    """Give all points of a body the same deformation gradient, if one is given."""
    if len(F):
        gradients = body.particles.F
        gradients[:] = np.array(F) if gradients.ndim == 3 else np.linalg.det(F)


def summarize_reports(reports, error, message, stepping):
    """Return the `LawEnd` from the `StrainReport`s of a run. stepping: steps between the reports,
    and whether these steps are of another length than in training.
    """
    every, other_dt = stepping
    outside = [k * every for k, report in enumerate(reports) if report.out_of_range]
    lost = [k * every for k, report in enumerate(reports) if not report.excess <= LOST]
    lost += [len(reports) * every] if message else []
    flags = [*(["strain"] if outside else []), *(["dt"] if other_dt else [])]
    first = 0 if other_dt else outside[0] if outside else -1
    return LawEnd(float(error), (len(reports) - 1) * every, first, " ".join(flags),
                  max(report.excess for report in reports), lost[0] if lost else -1,
                  min(report.J for report in reports), max(report.mean for report in reports),
                  message)


def law_trials(run, law, setups):
    """Return the `LawTrial`s of setups, of which the first is the training run: it has the usual
    error, and says whether the law is poor.
    """
    ends = [law_end(law, setup) for setup in run.progress(setups, law.name)]
    poor = is_poor(np.sqrt(ends[0].error / motion_of(setups[0].scene)))
    return [LawTrial(law.name, setup.what, ends[0].error, flagged_as_poor(end) if poor else end)
            for setup, end in zip(setups, ends, strict=True)]


def motion_of(scene):
    """Return the mean square displacement of the points of a scene's own run [m^2]."""
    problem = build(scene)
    with threads_for(problem.bodies):
        x = np.array(list(positions(problem, (copy_body(problem.bodies[0]),))))
    return float(np.mean((x - x[0]) ** 2))


def flagged_as_poor(end):
    """Return a `LawEnd` that is flagged before its first step for the law's poor training."""
    return end._replace(first=0, flags=" ".join(filter(None, (end.flags, "poor"))))


def record_silent(run, trials, scale, judged=True):
    """Record the number of silent runs, the share of bad runs without a warning (misses), and the
    share of the others that were flagged or stopped (false alarms). The number is not judged where
    every run has a warning, whatever becomes of it.
    """
    rule = {"paper": 0, "comparator": "="} if judged else {"comparator": "info"}
    name = run.experiment.id
    silent = [t for t in trials if t.kind == SILENT]
    examples = [f"{t.law}, {t.what}: {t.end.error / t.usual:.3g} times" for t in silent[:6]]
    run.record(f"{name}.silent", len(silent), unit="runs", **rule,
               scale=f"{scale}, {len(trials)} runs",
               note="; ".join((verdict_counts(trials), *examples)))
    for factor in BAD_FACTORS:
        for is_bad, rate in ((True, "misses"), (False, "false_alarms")):
            group = [t for t in trials if t.is_bad(factor) == is_bad]
            wrong = [t for t in group if is_bad != bool(t.end.flags or t.end.message)]
            run.record(f"{name}.{rate}.{factor:g}", len(wrong) / max(len(group), 1),
                       comparator="info", scale=f"{scale}, {len(group)} runs",
                       note=f"of runs {'above' if is_bad else 'up to'} {factor:g} times the usual "
                            "error" + "".join(f"; {t.law}, {t.what}" for t in wrong[:6]))
