"""Reduced runs of a study, and their errors beside the full-order runs (LDM-err).

Errors are over all test runs, time levels (the start included) and points: || x - x' || over
|| x' ||, measured from the scene's origin, which is the centre of the end that is held; from the
centroid of the body at rest, the strictest choice; and over the displacement || x' - X ||, which
depends on no origin (LDM-X10).
"""

from math import inf
from typing import NamedTuple

import numpy as np
import threadpoolctl

from mpm_ref.cases import points_of
from mpm_ref.core.grid import OutOfRange
from mpm_ref.core.levelset import distances
from mpm_ref.materials import NoFlow
from mpm_ref.rom.eulerian import Eulerian
from mpm_ref.rom.lagrangian import lagrangian
from mpm_ref.rom.latent import initial
from mpm_ref.rom.projection import project_position
from mpm_ref.rom.samples import PER_GROUP, draw
from mpm_ref.rom.step import Reduced
from mpm_ref.scene import build
from mpm_ref.shapes import level_set

from ..verification.scenes import threads_for

QUADRATURES = ("lagrangian", "eulerian")
PROJECTIONS = ("nonlinear", "linear")
SCHEMES = tuple((q, p) for q in QUADRATURES for p in PROJECTIONS)


class Way(NamedTuple):
    """How a reduced run is made; `points` samples, or all of them where it is None."""

    quadrature: str = "lagrangian"
    projection: str = "linear"
    points: int | None = None
    velocity: str = "previous"
    per_cell: int = 2           # Eulerian quadrature points of a cell per axis

    @property
    def name(self):
        """As the targets call the scheme."""
        return f"{self.quadrature}_{self.projection}"


class Errors(NamedTuple):
    """Accumulated errors of the position, as shares."""

    origin: float           # of the distance from the scene's origin
    centroid: float         # of the distance from the body's centroid at rest
    displacement: float     # of the displacement


class Squares:
    """Sums of squares that `Errors` are made of."""

    def __init__(self, X):
        self.X, self.sums = X, np.zeros(4)

    def add(self, x, reference):
        """Add one state x (n, d) beside the full model's."""
        X = self.X
        for k, a in enumerate((x - reference, reference, reference - X.mean(axis=0),
                               reference - X)):
            self.sums[k] += np.sum(a**2)

    @property
    def errors(self):
        """`Errors` of all states added."""
        return Errors(*(float(np.sqrt(self.sums[0] / s)) for s in self.sums[1:]))


class Case(NamedTuple):
    """One run of a study: what a reduced model of it needs to know."""

    problem: object         # `Problem`; its body gives law, points, masses
    shape: object           # level set of the body at rest
    X: np.ndarray           # (n, d) points at rest [m]
    m: np.ndarray           # (n,) [kg]
    V0: np.ndarray          # (n,) [m^d]

    def held(self, t):
        """Index arrays: the points within a cell, at the start, of each prescribed region that
        holds in the step from time t [s] on; samples must not miss it (LDM-sec3.3-hyper).
        """
        middle = t + 0.5 * self.problem.clock.dt
        return tuple(np.flatnonzero(distances(self.X, part.shape) <= self.problem.dx)
                     for part in self.problem.conditions.prescribed
                     if part.since < middle < part.until)


def case(scene):
    """`Case` of a scene. Raises ValueError for what a reduced run does not know: more bodies,
    plastic flow, an affine transfer, a start that moves, forces of single particles, a box.
    """
    problem = build(scene)
    body = problem.bodies[0]
    unknown = {"more than one body": len(problem.bodies) > 1,
               "plastic flow": not isinstance(body.flow, NoFlow),
               f"the transfer {problem.scheme.transfer}": problem.scheme.transfer != "pic",
               "a start that moves": np.any(body.particles.v),
               "forces of single particles": body.particles.b.ndim > 1,
               "a box that clips": problem.clip is not None}
    for what in (name for name, has in unknown.items() if has):
        raise ValueError(f"the scene {problem.title!r} has {what}: reduced runs know none")
    return Case(problem, level_set(scene.body[0].shape), *points_of(body))


def model(case, map, way):
    """`Reduced` model of a `Case` on a map."""
    problem, degree = case.problem, case.problem.scheme.degree
    quadrature = lagrangian(case.X, case.m, case.V0, problem.dx, degree)
    if way.quadrature == "eulerian":
        rho = float(case.m.sum() / case.V0.sum())
        quadrature = Eulerian(case.X, rho, lambda X: distances(X, case.shape),
                              quadrature.blocks.center, problem.dx, degree, way.per_cell)
    return Reduced(map, quadrature, problem.bodies[0].law, problem.gravity,
                   problem.conditions, way.projection, way.velocity)


def march(case, map, way, rest, seed=0):
    """Yield (`Latent`, `Report` or None) of a reduced run, the start first; samples are drawn anew
    for each step (LDM-sec3.3-hyper). rest: latent coordinates near the body at rest.
    """
    stepper, clock = model(case, map, way), case.problem.clock
    n = len(case.X)
    rng = np.random.default_rng(seed)
    latent = initial(map, case.X, xhat=rest)
    yield latent, None
    for k in range(clock.steps):
        t = k * clock.dt
        pick = draw(n, way.points or n, map.r, map.dim, groups(case, way, t))
        latent, report = stepper.step(latent, pick(rng), t, clock.dt)
        yield latent, report


def groups(case, way, t):
    """What samples must not miss; nothing where they are all points, or too few for it."""
    held = case.held(t)
    return held if way.points and way.points >= PER_GROUP * len(held) else ()


def compared(cases, references, map, way, rest, seed=0):
    """`Errors` over runs: of `Case`s beside the full model's x (k + 1, n, d) of each; infinite
    where a run did not reach its end.
    """
    sums = Squares(cases[0].X)
    with threads_for((cases[0].problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
        for k, (one, x) in enumerate(zip(cases, references, strict=True)):
            states = march(one, map, way, rest, seed + k)
            try:
                for (latent, _), reference in zip(states, x, strict=True):
                    sums.add(map.place(one.X, latent.xhat), reference)
            except (OutOfRange, ValueError, np.linalg.LinAlgError):
                return Errors(inf, inf, inf)
    return sums.errors


def reconstructed(X, references, map, rest):
    """`Errors` of the nearest states of a map, without any dynamics: what no reduced run on it is
    expected to beat.
    """
    sums = Squares(X)
    for x in references:
        xhat = rest
        for reference in x:
            xhat = project_position(map, X, reference, xhat).y
            sums.add(map.place(X, xhat), reference)
    return sums.errors
