"""Runs of learned laws at their extremes: how each ended, beside the same run of the true laws, and
what the watch of strains said (see `mpm_ref.nclaw.strain_watch`).

A run is bad where its error is above BAD times that of the run that the law was trained on, made
again. It ends in one of four ways: it stopped, since a point has no finite place any more; it was
flagged, since strains are astray or the time step is not that of training; it is fine; or it is
silent: bad, and neither stopped nor flagged. Runs are not stopped for their energy: a wrong law
usually ends at the walls.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpm_ref.nclaw.bodies import body_maker, copy_body
from mpm_ref.nclaw.strain_watch import strain_report
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.scenes import threads_for
from ..common.weights_needed import load_available
from ..nclaw.environments import ENVIRONMENTS, environment
from ..nclaw.strain_bounds import visited_bounds
from ..nclaw.trained_laws import trained

BAD = 3.0           # times the mean squared error that is usual for the law
BADS = 2.0, BAD, 5.0, 10.0
LOST = 10.0         # widths of the bounds, out of which a point makes no body
EVERY = 20          # steps between looks, of the trained length
SHORT = 200         # steps, quick
CHOSEN = ("jelly", "plasticine")        # laws from whose runs the watch's bound is chosen
STOPPED, FLAGGED, FINE, SILENT = "stopped", "flagged", "fine", "silent"


class Law(NamedTuple):
    """A learned law to run."""

    name: str
    environment: str
    make: object        # what makes bodies of it
    bounds: dict        # strains that it has met
    dt: float           # [s] of training


class Setup(NamedTuple):
    """A run: a scene, and the deformation gradient (d, d) of all points at its start."""

    what: str
    scene: object
    F: tuple = ()       # none: as it is


class End(NamedTuple):
    """How a run ended, and the extremes of what its watch saw."""

    error: float        # mean squared, of the frames that it reached [m^2]; infinite if it stopped
    steps: int          # made
    first: int          # the step in which it was flagged first, -1 for none
    flags: str          # what was ever out of bounds
    beyond: float       # largest
    lost: int           # the step in which a point was LOST out of bounds, or stopped; -1 for none
    J: float            # smallest, of the points that were farthest out of bounds
    said: str           # the sentence with which it stopped, "" if it ran to its end

    def kind(self, usual):
        """Which of the four ends it is, for a law whose usual error is so."""
        if self.said:
            return STOPPED
        if self.flags:
            return FLAGGED
        return FINE if self.error <= BAD * usual else SILENT


class Trial(NamedTuple):
    """A run of an experiment."""

    law: str
    what: str
    usual: float        # error of the law on the run that it was trained on [m^2]
    end: End

    @property
    def kind(self):
        """Which of the four ends it is."""
        return self.end.kind(self.usual)

    def bad(self, factor=BAD):
        """Whether the error is so many times the usual one, or infinite."""
        return not self.end.error <= factor * self.usual


@cache
def law(name):
    """`Law` of the weights of an environment. Raises `Untrained`."""
    laws = trained(name)
    return Law(name, name, body_maker(laws), visited_bounds(name), environment(name).dt)


def laws(run):
    """`Law`s of an experiment: at quick one, at standard all that are trained."""
    names = run.choose(quick=CHOSEN[:1], standard=ENVIRONMENTS)
    return list(load_available(run, names, law).values())


def scene_for(run, name, **changes):
    """The scene of an environment, looked at every EVERY steps; cut short at quick."""
    steps = run.choose(quick=SHORT, standard=environment(name).steps)
    return environment(name, **{"every": EVERY, "steps": steps, **changes})


def ended(law, setup):
    """`End` of a `Setup` with a learned law, beside its own laws."""
    problem, beside = build(setup.scene), build(setup.scene)
    body, true = law.make(problem.bodies[0]), copy_body(beside.bodies[0])
    for one in (body, true):
        strain(one, setup.F)
    errors, sights, said = [], [], ""
    with threads_for(problem.bodies), np.errstate(invalid="ignore", over="ignore"):
        run = positions(problem, (body,))
        for x in positions(beside, (true,)):
            try:
                errors.append(float(np.mean((next(run) - x) ** 2)))
            except RunBroken as end:
                said = str(end)
                break
            sights.append(strain_report(body, law.bounds))
    return of_sights(sights, np.inf if said else np.mean(errors), said,
                     (setup.scene.every, setup.scene.dt != law.dt))


def strain(body, F):
    """Give all points of a body the same deformation gradient, if one is given."""
    if len(F):
        of = body.particles.F
        of[:] = np.array(F) if of.ndim == 3 else np.linalg.det(F)


def of_sights(sights, error, said, how):
    """`End` from the `StrainReport`s of a run; how: steps between them, whether they are of another
    length than in training.
    """
    every, other = how
    astray = [k * every for k, sight in enumerate(sights) if sight.out_of_range]
    lost = [k * every for k, sight in enumerate(sights) if not sight.excess <= LOST]
    lost += [len(sights) * every] if said else []
    flags = [*(["strain"] if astray else []), *(["dt"] if other else [])]
    first = 0 if other else astray[0] if astray else -1
    return End(float(error), (len(sights) - 1) * every, first, " ".join(flags),
               max(sight.excess for sight in sights), lost[0] if lost else -1,
               min(sight.J for sight in sights), said)


def trials(run, law, setups, usual=None):
    """`Trial`s of setups; the usual error is that of the first, or given."""
    ends = [ended(law, setup) for setup in run.progress(setups, law.name)]
    usual = ends[0].error if usual is None else usual
    return [Trial(law.name, setup.what, usual, end)
            for setup, end in zip(setups, ends, strict=True)]


def record_silent(run, found, scale):
    """Record how many runs were silent, the share of bad runs that were (misses), and the share of
    the others that were flagged or stopped all the same (false alarms).
    """
    name = run.experiment.id
    silent = [t for t in found if t.kind == SILENT]
    ways = ", ".join(f"{sum(t.kind == kind for t in found)} {kind}"
                     for kind in (STOPPED, FLAGGED, FINE))
    words = [f"{t.law}, {t.what}: {t.end.error / t.usual:.3g} times" for t in silent[:6]]
    run.record(f"{name}.silent", len(silent), unit="runs", paper=0, comparator="=",
               scale=f"{scale}, {len(found)} runs", note="; ".join((ways, *words)))
    for factor in BADS:
        bad = [t for t in found if t.bad(factor)]
        good = [t for t in found if not t.bad(factor)]
        told = {True: "misses", False: "false_alarms"}
        for is_bad, some in ((True, bad), (False, good)):
            wrong = [t for t in some if is_bad != bool(t.end.flags or t.end.said)]
            run.record(f"{name}.{told[is_bad]}.{factor:g}", len(wrong) / max(len(some), 1),
                       comparator="info", scale=f"{scale}, {len(some)} runs",
                       note=f"of runs {'above' if is_bad else 'up to'} {factor:g} times the usual "
                            "error" + "".join(f"; {t.law}, {t.what}" for t in wrong[:6]))


def table_of(run, found):
    """Write the trials as a table."""
    run.table("runs", (*Trial._fields[:-1], "kind", *End._fields),
              [(*t[:-1], t.kind, *t.end) for t in found])
