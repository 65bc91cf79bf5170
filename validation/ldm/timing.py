"""Full and reduced runs of one scene, a step of each in turn, so that a ratio of their times is of
one run of the machine.
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
WAY = RunOptions._fields
COLUMNS = (*WAY, "wall", "cpu", "quadrature_points", "origin", "centroid", "displacement")


class Spent(NamedTuple):
    """What a step takes."""

    wall: float         # [s]
    cpu: float          # [s], of all threads


class Raced(NamedTuple):
    """A reduced run beside the full one."""

    way: RunOptions
    spent: Spent            # median over the steps
    points: int             # quadrature points of a step, median
    errors: PositionErrors

    @property
    def row(self):
        """Of a table with COLUMNS."""
        return (*self.way._replace(points=self.way.points or "all"), *self.spent, self.points,
                *self.errors)

    @property
    def words(self):
        """The way, as part of a name: what differs from the paper's."""
        usual, points = RunOptions("eulerian", "linear")._asdict(), self.way.points or "all"
        own = {name: a for name, a in self.way._asdict().items()
               if name not in ("quadrature", "projection", "points") and a != usual[name]}
        return "-".join(map(str, (self.way.quadrature, self.way.projection, points,
                                  *own.values())))


def clocked(step):
    """What step() gives, and what it `Spent`."""
    wall, cpu = perf_counter(), process_time()
    found = step()
    return found, Spent(perf_counter() - wall, process_time() - cpu)


def median(spent):
    """`Spent` in the middle of a list."""
    return Spent(*map(float, np.median(spent, axis=0)))


class Full:
    """The full model, a step at a time."""

    def __init__(self, scene):
        self.problem = build(scene)
        self.stepper, self.state = self.problem.stepper(), State(self.problem.bodies)
        self.stepper.start(self.state.bodies)
        self.spent = []

    def step(self):
        """One step, and what it takes."""
        self.spent.append(clocked(lambda: advance(self.problem, self.stepper, self.state))[1])

    def positions(self, every):
        """x (n, d) of one point in so many."""
        body = self.state.bodies[0]
        return restore_order(body.particles.x, body.id)[::every]


class Online:
    """A reduced run, a step at a time; at its end where the coordinates give no body."""

    def __init__(self, one, at, way, every):
        (self.map, rest), self.X, self.way = at, one.X[::every], way
        self.states = ldm_run(one, self.map, way, rest).states()
        self.sums, self.spent, self.points, self.ended = Squares(self.X), [], [], False
        start = next(self.states)
        self.sums.add(self.map.place(self.X, start.latent.xhat), self.X)

    def step(self, reference):
        """One step, what it takes, and its error."""
        if self.ended:
            return
        try:
            (_, latent, report, _), spent = clocked(lambda: next(self.states))
        except BREAKDOWNS:
            self.ended = True
            return
        self.spent.append(spent)
        self.points.append(report.points)
        self.sums.add(self.map.place(self.X, latent.xhat), reference)

    def raced(self):
        """`Raced` after the last step; infinite if it did not get there."""
        if self.ended:
            return Raced(self.way, Spent(np.inf, np.inf), 0, PositionErrors(np.inf, np.inf, np.inf))
        return Raced(self.way, median(self.spent), int(np.median(self.points)), self.sums.errors)


def alone(one, at, way, x):
    """`Raced` of a reduced run of a `Case` beside positions x (k + 1, n, d) that are known."""
    with one_thread():
        run = Online(one, at, way, 1)
        for reference in x[1:]:
            run.step(reference)
    return run.raced()


def race(scene, at, ways, steps):
    """What a step of the full model `Spent`, and `Raced` of each way on at = (map, rest)."""
    one, full = ldm_full_model(scene), Full(scene)
    every = -(-len(one.X) // TRACKED)
    with one_thread():
        online = [Online(one, at, way, every) for way in ways]
        for _ in range(steps):
            full.step()
            reference = full.positions(every)
            for run in online:
                run.step(reference)
    return median(full.spent), [run.raced() for run in online]


def fastest(scene, steps=4):
    """What a step of the full model `Spent` with the fastest transfer there is."""
    full = Full(with_(scene, scheme=Scheme(transfer="mls", degree=2)))
    for _ in range(steps):
        full.step()
    return median(full.spent[1:])
