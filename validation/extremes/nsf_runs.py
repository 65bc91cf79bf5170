"""Reduced runs with inferred stress at their extremes: how each ended, beside the full-order run,
and what its watch said (see `mpm_ref.rom.study.nsf_watch`). The four ends are those of `ldm_runs`.

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
from .ldm_runs import End as LdmEnd
from .ldm_runs import Trial

ERRORS = "errors of the displacement"
GONE = 10.0     # times as far from the trained mean as any trained latent coordinates: runs are
                # ended here, as the grid of a body that flies apart takes gigabytes


def studies(run):
    """{name: `Study`} of an elastic scene and of a plastic one; in the quick profile with one test
    each.
    """
    found = run.choose(quick=lambda: {"jelly": jelly(2), "metal": metal(3, train=5)},
                       standard=lambda: {"jelly": jelly(), "metal": metal(2)})()
    count = run.choose(quick=1, standard=None)
    return {name: study._replace(test=study.test[:count]) for name, study in found.items()}


def scenes(run):
    """Yield (name, `FittedStudy`) of each of the `studies`, made when it is its turn."""
    for name, study in run.progress(studies(run).items(), "scenes"):
        yield name, fit_study(study)


class End(NamedTuple):
    """How a run ended, and the extremes of what its watch saw."""

    error: float            # of the displacement; infinite of a run that broke down or was GONE,
                            # and where a point has no finite place or stress [%]
    origin: float           # of the position, NSF-eq11, likewise [%]
    stress: float           # of the Kirchhoff stress, over its norm, likewise [%]
    steps: int              # made; -1 without a start
    first: int              # the step that was flagged first, -1 for none
    flags: str              # what was ever out of bounds
    beyond: float           # largest
    rank: int               # smallest
    off: float              # largest rms distance of trial positions from the manifold; NaN where
                            # they were not finite [dx]
    said: str               # the sentence with which it stopped, "" if it ran to its end

    kind = LdmEnd.kind


class Bench:
    """The fields of a study, and what is usual for them: the largest error of its tests."""

    def __init__(self, name, one):
        self.name, self.one = name, one
        self.monitor = field_monitor(one.fields, one.xhat)
        self.value, self.count = one.study.test[0], one.study.samples
        self.tests = [self.ended(value, self.drawn(self.count)) for value in one.study.test]
        self.usual = max(end.error for end in self.tests)

    def drawn(self, count, draw=0):
        """`Chosen` samples of any points."""
        return drawn_samples(len(self.one.fields.X), count, draw)

    def ended(self, value, chosen, test=None, fields=None):
        """`End` of a reduced run with `Chosen` samples beside `Histories` of the full-order run, of
        the study's fields or others.
        """
        one = self.one if fields is None else self.one._replace(fields=fields)
        scene, test = nsf_full_model(one.study.run(value)), test or one.tests[value]
        states, sights, off, said = [], [], [], ""
        with np.errstate(all="ignore"):
            try:
                for state in self.inferred(scene, one.fields_of_run(value), chosen):
                    states.append((level_of(state.t / test.dt), state.latent.xhat))
                    sights.append(self.monitor.check(state))
                    off.append(state.report.residual / scene.problem.dx if state.report else 0.0)
            except BREAKDOWNS as stop:
                said = " ".join(str(stop).split())
            found = path_errors(one.fields_of_run(value), history_reference(test), states)
        errors = np.array([found.errors.displacement, found.errors.origin,
                           stress_share(found.stress)])
        whole_run = len(states) == scene.problem.clock.steps + 1
        return End(*(100.0 * (errors if whole_run else np.full(3, np.inf))),
                   *of_sights(sights, one.fields.r), float(np.max(off, initial=0.0)), said)

    def inferred(self, scene, fields, chosen):
        """Yield what `nsf_run` does of a `Whole` scene, until latent coordinates are GONE."""
        run = nsf_run(scene, fields, FieldRunOptions((chosen,)), self.one.rest)
        for state in run.states():
            yield state
            if self.monitor.extent.outlying(state.latent.xhat) > GONE:
                return

    def trial(self, what, chosen, fields=None):
        """`Trial` of the first test."""
        return self.named(what, self.ended(self.value, chosen, fields=fields), len(chosen.points))

    def named(self, what, end, count):
        """`Trial` of a run's `End` with so many samples."""
        return Trial(self.name, what, "inferred", count, self.usual, end)


def of_sights(sights, r):
    """What an `End` has of the `StateCheck`s of a run: steps, first, flags, beyond and rank."""
    flagged = [k for k, sight in enumerate(sights) if sight.out_of_bounds]
    flags = dict.fromkeys(word for sight in sights for word in sight.out_of_bounds)
    return (len(sights) - 1, flagged[0] if flagged else -1, " ".join(flags),
            max((sight.beyond for sight in sights), default=np.nan),
            r - max((sight.blind for sight in sights), default=0))


def made(study, value):
    """`Histories` of a full-order run, and "", or None and the sentence with which it stopped."""
    try:
        return simulate_history(study.run(value), [value], np.float32, study.spacing), ""
    except (Unstable, TooLarge, OutOfRange) as stop:
        return None, str(stop)
