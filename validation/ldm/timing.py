"""Times of full and reduced runs of one scene, a step of each in turn, from the start to the end of
the motion: disturbances from other processes meet all of them alike.
"""

from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.core.blas import one_thread
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.scene import Scheme, build
from mpm_ref.simulate import State, advance

from ..common.scenes import with_

TRACKED = 4000              # points that errors are of
OPTIONS = RunOptions._fields
COLUMNS = (*OPTIONS, "wall", "cpu", "quadrature_points", "origin", "centroid", "displacement")


class StepTime(NamedTuple):
    """Time that a step takes."""

    wall: float         # [s]
    cpu: float          # [s], of all threads


class TimedRun(NamedTuple):
    """Times and errors of a reduced run."""

    options: RunOptions
    spent: StepTime         # median over the steps
    points: int             # quadrature points of a step, median
    errors: PositionErrors

    @property
    def row(self):
        """The row of a table with COLUMNS."""
        return (*self.options._replace(points=self.options.points or "all"), *self.spent,
                self.points, *self.errors)

    @property
    def label(self):
        """The options as part of a name: quadrature, projection, points and other choices."""
        usual, points = RunOptions("eulerian", "linear")._asdict(), self.options.points or "all"
        other = {name: a for name, a in self.options._asdict().items()
                 if name not in ("quadrature", "projection", "points") and a != usual[name]}
        return "-".join(map(str, (self.options.quadrature, self.options.projection, points,
                                  *other.values())))


class Race(NamedTuple):
    """Times of a full-order run, of the same with the fastest transfer, and of reduced runs."""

    full: StepTime
    fastest: StepTime
    reduced: list           # of `TimedRun`, one for each `RunOptions`


def timed(step):
    """Return the result of step(), and its `StepTime`."""
    wall, cpu = perf_counter(), process_time()
    result = step()
    return result, StepTime(perf_counter() - wall, process_time() - cpu)


def median(spent):
    """Return the median of a list of `StepTime`."""
    return StepTime(*map(float, np.median(spent, axis=0)))


class SteppedFullRun:
    """A full-order run, a step at a time."""

    def __init__(self, scene):
        self.problem = build(scene)
        self.stepper, self.state = self.problem.stepper(), State(self.problem.bodies)
        self.stepper.start(self.state.bodies)
        self.spent = []

    def step(self):
        """Make one step, timed."""
        self.spent.append(timed(lambda: advance(self.problem, self.stepper, self.state))[1])

    def positions(self, every):
        """Return x (n, d) of one point in `every`."""
        body = self.state.bodies[0]
        return restore_order(body.particles.x, body.id)[::every]


class SteppedReducedRun:
    """A reduced run, a step at a time; it ends early where the coordinates give no body."""

    def __init__(self, one, mapping, options, every):
        (self.map, rest), self.X, self.options = mapping, one.X[::every], options
        self.states = ldm_run(one, self.map, options, rest).states()
        self.sums, self.spent, self.points, self.ended = Squares(self.X), [], [], False
        start = next(self.states)
        self.sums.add(self.map.place(self.X, start.latent.xhat), self.X)

    def step(self, reference):
        """Make one step, timed, and add its error."""
        if self.ended:
            return
        try:
            (_, latent, report, _), spent = timed(lambda: next(self.states))
        except BREAKDOWNS:
            self.ended = True
            return
        self.spent.append(spent)
        self.points.append(report.points)
        self.sums.add(self.map.place(self.X, latent.xhat), reference)

    def result(self):
        """Return the `TimedRun` after the last step; infinite if the run ended early."""
        if self.ended:
            return TimedRun(self.options, StepTime(np.inf, np.inf), 0,
                            PositionErrors(np.inf, np.inf, np.inf))
        return TimedRun(self.options, median(self.spent), int(np.median(self.points)),
                        self.sums.errors)


def time_alone(one, mapping, options, x):
    """Return the `TimedRun` of a reduced run of a `FullModel`, given the full-order positions
    x (k + 1, n, d).
    """
    with one_thread():
        run = SteppedReducedRun(one, mapping, options, 1)
        for reference in x[1:]:
            run.step(reference)
    return run.result()


def race(scene, mapping, options, steps):
    """Return the `Race` of the full model, of the same with MLS-MPM, and of a reduced run with each
    `RunOptions` on mapping = (map, rest): each makes a step in turn.
    """
    one = ldm_full_model(scene)
    every = -(-len(one.X) // TRACKED)
    full, fastest = SteppedFullRun(scene), SteppedFullRun(fastest_scene(scene))
    with one_thread():
        reduced = [SteppedReducedRun(one, mapping, own, every) for own in options]
        for _ in range(steps):
            full.step()
            fastest.step()
            reference = full.positions(every)
            for run in reduced:
                run.step(reference)
    return Race(median(full.spent), median(fastest.spent), [run.result() for run in reduced])


def fastest_scene(scene):
    """Return the scene with MLS-MPM, the fastest transfer there is."""
    return with_(scene, scheme=Scheme(transfer="mls", degree=2))


def full_step(scene, steps):
    """Return the `StepTime` of the full model over the first steps of a run."""
    full = SteppedFullRun(scene)
    with one_thread():
        for _ in range(steps):
            full.step()
    return median(full.spent)
