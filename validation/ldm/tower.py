"""The tower: what reduced runs of up to three million points cost (LDM-sec5.4, Figure 16).

The map is trained on one in sixteen of 34 thousand points on a grid three times as coarse. The full
model and all reduced ones take their steps in turn, so that a ratio of times is of one run.
"""

from time import perf_counter
from typing import NamedTuple

import numpy as np

from mpm_ref.cases import in_order
from mpm_ref.core.grid import OutOfRange
from mpm_ref.reduced.case import case
from mpm_ref.reduced.errors import Errors, Squares
from mpm_ref.reduced.march import PROJECTIONS, SCHEMES, Way, march
from mpm_ref.scene import Scheme, build
from mpm_ref.simulate import State, advance

from ..registry import experiment
from ..verification.scenes import with_
from .nets import trained
from .references import share
from .studies import TOWER, refined

NET = "tower"
GRIDS = {34: (1.44, 2), 385: (0.96, 3), 3076: (0.48, 3)}     # thousand points: dx [m], per axis
TRACKED = 4000              # points that errors are of
POINTS = (25, 50)
COLUMNS = ("particles", "quadrature", "projection", "points", "per_cell", "samples",
           "wall_full", "wall_fastest", "wall_reduced", "wall_per_second", "speed_up",
           "quadrature_points", "origin", "centroid", "displacement")


class Raced(NamedTuple):
    """A reduced run beside the full one."""

    way: Way
    wall: float             # of a step, median [s]
    points: int             # quadrature points of a step, median
    errors: object          # `Errors`


class Full:
    """The full model, a step at a time."""

    def __init__(self, scene):
        self.problem = build(scene)
        self.stepper, self.state = self.problem.stepper(), State(self.problem.bodies)
        self.stepper.start(self.state.bodies)
        self.walls = []

    def step(self):
        """One step, and the time it takes."""
        begin = perf_counter()
        advance(self.problem, self.stepper, self.state)
        self.walls.append(perf_counter() - begin)

    def positions(self, every):
        """x (n, d) of one point in so many."""
        body = self.state.bodies[0]
        return in_order(body.particles.x, body.id)[::every]


class Online:
    """A reduced run, a step at a time; at its end where the coordinates give no body."""

    def __init__(self, one, way, every):
        self.model, self.X, self.way = trained(NET), one.X[::every], way
        self.states = march(one, self.model.decoder, way, self.model.rest)
        self.sums, self.walls, self.points, self.ended = Squares(self.X), [], [], False
        next(self.states)

    def step(self, reference):
        """One step, the time it takes, and its error."""
        if self.ended:
            return
        begin = perf_counter()
        try:
            latent, report = next(self.states)
        except (OutOfRange, ValueError, np.linalg.LinAlgError):
            self.ended = True
            return
        self.walls.append(perf_counter() - begin)
        self.points.append(report.points)
        self.sums.add(self.model.decoder.place(self.X, latent.xhat), reference)

    def raced(self):
        """`Raced` after the last step; infinite if it did not get there."""
        if self.ended:
            return Raced(self.way, np.inf, 0, Errors(np.inf, np.inf, np.inf))
        return Raced(self.way, float(np.median(self.walls)), int(np.median(self.points)),
                     self.sums.errors)


def race(scene, ways, steps):
    """The full model's median wall time of a step [s], and `Raced` of each way."""
    one, full = case(scene), Full(scene)
    every = -(-len(one.X) // TRACKED)
    online = [Online(one, way, every) for way in ways]
    for _ in range(steps):
        full.step()
        reference = full.positions(every)
        for run in online:
            run.step(reference)
    return float(np.median(full.walls)), [run.raced() for run in online]


def fastest(scene, steps=4):
    """Wall time of a step of the full model with the fastest transfer there is [s]."""
    full = Full(with_(scene, scheme=Scheme(transfer="mls", degree=2)))
    for _ in range(steps):
        full.step()
    return float(np.median(full.walls[1:]))


def ways(points):
    """The paper's schemes and cheaper ones, at numbers of samples."""
    cheap = [Way("resampled", "linear", n, per_cell=k) for n in points for k in (1, 2)]
    return [Way(*scheme, n) for scheme in SCHEMES for n in points] + cheap


@experiment("ldm.fig16", title="LDM: speed on the tower",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 3600})
def speed(run):
    """Error and wall time of reduced runs of one test run, by size."""
    rows, dt = [], TOWER.problem(TOWER.test[0]).clock.dt
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        scene = refined(TOWER.scene(*TOWER.mu[TOWER.test[0]]), *GRIDS[size])
        chosen = run.choose(quick=[Way("eulerian", "linear", 25), Way("resampled", "linear", 25)],
                            standard=ways(POINTS))
        steps = run.choose(quick=10, standard=scene.steps)
        wall, found = race(scene, chosen, steps)
        best, count = fastest(scene), len(build(scene).bodies[0].id)
        rows += [(count, *row(one), wall, best, one.wall, one.wall / dt, wall / one.wall,
                  one.points, *one.errors) for one in found]
        report(run, f"ldm.fig16.{size}", found, (wall, best, dt),
               f"{count} particles, {steps} steps, one of {len(TOWER.test)} test runs")
    printed(run, [r for r in rows if r[0] == rows[-1][0]])
    run.table("ways", COLUMNS, rows)


def row(one):
    """How a `Raced` was made."""
    way = one.way
    return way.quadrature, way.projection, way.points, way.per_cell, way.samples


def report(run, name, found, times, scale):
    """Record speed-ups and errors of all ways at a size."""
    wall, best, dt = times
    for one in found:
        words = "-".join(map(str, row(one)))
        run.record(f"{name}.{words}.speed_up", wall / one.wall, unit="x", comparator="info",
                   scale=scale, note=f"{one.wall / dt:.3g} s a second; {best / one.wall:.3g} x "
                   f"over the fastest transfer; {one.points} quadrature points")
        share(run, f"{name}.{words}.error", one.errors, scale, comparator="info")


def printed(run, rows):
    """Record what the paper prints, of the largest size."""
    if run.profile != "standard":
        return
    own = [r for r in rows if r[1:3] == ("eulerian", PROJECTIONS[1]) and r[3] < 50]
    best = min(own, key=lambda r: r[8])
    scale = f"{best[0]} particles, {best[3]} samples"
    run.record("ldm.fig16.speedup", best[10], scale=scale)
    run.record("ldm.fig16.realtime", best[9], scale=scale)
    most = next(r for r in rows if r[1] == "eulerian" and r[3] == 50)
    run.record("ldm.sec5_4.quadrature_points", most[11], scale=f"{most[0]} particles, 50 samples")
