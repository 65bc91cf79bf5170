"""Reduced runs with network stress at their extremes: the end of each, compared with the full-order
run, and the checks of its monitor (see `mpm_ref.rom.study.monitor`). `verdicts` has the verdicts.

Errors are of the displacement, which depend on no origin: those of the position are much smaller,
and none would be above `ldm_runs.TOLERABLE`.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.evaluate import history_reference, level_of, path_errors, stress_share
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.monitor import field_monitor
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.study.samples import drawn_samples
from mpm_ref.timestep import TooLarge

from ..nsf.reduced_runs import fit_study
from ..nsf.studies import jelly, metal
from .ldm_runs import ReducedTrial
from .verdicts import flag_history

ERRORS = "errors of the displacement"
MAX_OUTLYING = 10.0     # distance from the mean trained latent coordinates, over the largest in
                        # training, that ends a run: the grid of a scattered body takes gigabytes


def studies(run):
    """Return {name: `Study`} of an elastic and of a plastic scene, at quick with one test each."""
    chosen = run.choose(quick=lambda: {"jelly": jelly(2), "metal": metal(3, train=5)},
                       standard=lambda: {"jelly": jelly(), "metal": metal(2)})()
    count = run.choose(quick=1, standard=None)
    return {name: study._replace(test=study.test[:count]) for name, study in chosen.items()}


def scenes(run):
    """Yield (name, `FittedStudy`) of each of the `studies`, computed one by one."""
    for name, study in run.progress(studies(run).items(), "scenes"):
        yield name, fit_study(study)


class FieldEnd(NamedTuple):
    """The end of a reduced run with network stress, and the extremes of its monitor's checks."""

    error: float            # of the displacement; infinite where the run broke down or ended early,
                            # or a point has no finite position or stress [%]
    origin: float           # of the position, NSF-eq11, likewise [%]
    stress: float           # of the Kirchhoff stress, over its norm, likewise [%]
    steps: int              # completed; -1 without a start
    first: int              # the first step that was flagged, -1 for none
    flags: str              # all quantities that were ever out of bounds
    beyond: float           # largest
    rank: int               # smallest
    departure: float        # largest
    off: float              # largest rms distance of trial positions from the manifold; NaN where
                            # they were not finite [dx]
    message: str            # the sentence with which it stopped, "" if it ran to its end


class FieldBench:
    """The fields of a study, and their usual error: the largest of its tests."""

    def __init__(self, name, tested):
        self.name, self.tested, study = name, tested, tested.study
        self.monitor = field_monitor(tested.fields, tested.xhat, tested.study.spacing)
        self.value, self.count = study.test[0], study.samples
        self.tests = [self.end(value, self.drawn(self.count)) for value in study.test]
        self.usual = max(end.error for end in self.tests)

    def drawn(self, count, draw=0):
        """Return a `SampleSet` of random points."""
        return drawn_samples(len(self.tested.fields.X), count, draw)

    def end(self, value, samples, test=None, fields=None):
        """Run a reduced model with a `SampleSet`, on the study's fields or on others. Returns the
        `FieldEnd`, with errors against the `Histories` of the full-order run.
        """
        tested = self.tested if fields is None else self.tested._replace(fields=fields)
        full, test = nsf_full_model(tested.study.run(value)), test or tested.tests[value]
        states, checks, off, message = [], [], [], ""
        with np.errstate(all="ignore"):
            try:
                for state in self.states(full, tested.fields_of_run(value), samples):
                    states.append((level_of(state.t / test.dt), state.latent.xhat))
                    checks.append(self.monitor.check(state, checks[-1] if checks else None))
                    off.append(state.report.residual / full.problem.dx if state.report else 0.0)
            except BREAKDOWNS as stop:
                message = " ".join(str(stop).split())
            path = path_errors(tested.fields_of_run(value), history_reference(test), states)
        errors = np.array([path.errors.displacement, path.errors.origin,
                           stress_share(path.stress)])
        completed = len(states) == full.problem.clock.steps + 1
        return FieldEnd(*(100.0 * (errors if completed else np.full(3, np.inf))),
                        *summarize_checks(checks, tested.fields.r),
                        float(np.max(off, initial=0.0)), message)

    def states(self, full, fields, samples):
        """Yield the states of a reduced run until its latent coordinates are MAX_OUTLYING."""
        run = nsf_run(full, fields, FieldRunOptions((samples,)), self.tested.rest)
        for state in run.states():
            yield state
            if self.monitor.extent.outlying(state.latent.xhat) > MAX_OUTLYING:
                return

    def trial(self, what, samples, fields=None):
        """Return the `ReducedTrial` of the first test."""
        end = self.end(self.value, samples, fields=fields)
        return self.trial_of(what, end, len(samples.points))

    def trial_of(self, what, end, count):
        """Return the `ReducedTrial` of a run's `FieldEnd` with a number of samples."""
        return ReducedTrial(self.name, what, "inferred", count, self.usual, end)


def summarize_checks(checks, r):
    """Return steps, first, flags, beyond, rank and departure of a `FieldEnd` from a run's
    `StateCheck`s.
    """
    return (len(checks) - 1, *flag_history(checks),
            max((check.beyond for check in checks), default=np.nan),
            r - max((check.blind for check in checks), default=0),
            max((check.departure for check in checks), default=np.nan))


def simulate_test(study, value):
    """Run the full order. Returns `Histories` and "", or None and its sentence if it stopped."""
    try:
        return simulate_history(study.run(value), [value], np.float32, study.spacing), ""
    except (Unstable, TooLarge, OutOfRange) as stop:
        return None, str(stop)
