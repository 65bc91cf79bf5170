"""Reduced runs: the four schemes of LDM, and ways that are cheaper or steadier, step by step."""

from typing import NamedTuple

import numpy as np

from ...sampling import Regular, sample
from ...shapes.inside import solid
from ..kinematics import CLOSE
from ..latent import initial
from ..quadrature.eulerian import Eulerian
from ..quadrature.lagrangian import Resampled, lagrangian
from ..sampling import PER_GROUP, draw, pivoted
from ..step import ldm_stepper
from .case import distance

PRECISIONS = ("double", "single")
QUADRATURES = ("lagrangian", "eulerian")
PROJECTIONS = ("nonlinear", "linear")
SCHEMES = tuple((q, p) for q in QUADRATURES for p in PROJECTIONS)
ENOUGH = 4000       # points that tell where a body is at the start, and are pivoted among
SINGLE = 1e-4       # nearest that preimages can be asked for in single precision [dx]
COARSE = 8          # blocks over a body's longest side, from which Eulerian points are traced back


class Way(NamedTuple):
    """How a reduced run is made; `points` samples, or all of them where it is None.

    Samples are "redrawn" for each step (LDM-sec3.3-hyper), "kept" from the start (LDMW-sets), or
    kept and "pivoted": those that tell the latent coordinates best at the start, of ENOUGH points.
    The quadrature is that of `SCHEMES`, or "resampled".
    """

    quadrature: str = "lagrangian"
    projection: str = "linear"
    points: int | None = None
    velocity: str = "previous"
    per_cell: int = 2           # quadrature points of a cell per axis, if they are not material
    samples: str = "redrawn"
    close: float = CLOSE        # how near Eulerian points must be to their places [dx]
    precision: str = "double"   # of a learned map, or "single"

    @property
    def name(self):
        """As the targets call the scheme."""
        return f"{self.quadrature}_{self.projection}"


def model(case, map, way):
    """Return LDM's `ReducedStepper` of a `Case` on a map. Raises ValueError for a quadrature that
    does not exist.
    """
    problem = case.problem
    make = {"lagrangian": of_material, "eulerian": of_cells, "resampled": of_another_sampling}
    if way.quadrature not in make:
        raise ValueError(f"quadrature = {way.quadrature!r}: expected one of {', '.join(make)}")
    return ldm_stepper(precise(map, way), make[way.quadrature](case, way), problem.bodies[0].law,
                       problem.gravity, way.projection, conditions=problem.conditions,
                       velocity=way.velocity)


def precise(map, way):
    """A map in the precision of a way. Raises ValueError for one that there is not, a map that has
    only doubles, and preimages nearer than single precision can tell.
    """
    if way.precision == "double":
        return map
    if way.precision not in PRECISIONS:
        raise ValueError(f"precision = {way.precision!r}: expected {' or '.join(PRECISIONS)}")
    if not hasattr(map, "single"):
        raise ValueError("precision = 'single': learned maps alone have it, this is one of "
                         f"{type(map).__name__}")
    if way.quadrature == "eulerian" and way.close < SINGLE:
        raise ValueError(f"close = {way.close:g} dx in single precision: expected at least "
                         f"{SINGLE:g}")
    return map.single()


def of_material(case, way):
    """Quadrature with the material points of a `Case`."""
    return lagrangian(case.X, case.m, case.V0, case.problem.dx, case.problem.scheme.degree)


def of_cells(case, way):
    """Quadrature with points of the grid's cells."""
    size = np.ptp(case.X, axis=0).max() / COARSE
    seeds = np.unique(np.floor(case.X / size), axis=0, return_index=True)[1]
    return Eulerian(case.X, case.rho, lambda X: distance(X, case.shape), case.X[seeds],
                    case.problem.dx, case.problem.scheme.degree, way.per_cell, way.close)


def of_another_sampling(case, way):
    """Quadrature with another sampling of the body at rest."""
    dx, degree = case.problem.dx, case.problem.scheme.degree
    X, V0 = sample(Regular(per_cell=way.per_cell), solid(case.shape), dx, 0)
    return Resampled(case.X, lagrangian(X, case.rho * V0, V0, dx, degree))


def march(case, map, way, rest, seed=0, pick=None):
    """Yield (`Latent`, `Report` or None) of a reduced run, the start first. rest: latent
    coordinates near the body at rest; pick: the samples as `picked` gives them, or others.
    """
    first = start(case, map, rest)
    pick = pick or picked(case, map, way, first.xhat, seed)
    yield from continued([(first, None)], case, map, way, pick)


def continued(known, case, map, way, pick):
    """Yield the same of a run whose first states (`Latent`, `Report` or None) are known, these too.
    Their samples are picked again, so that those of later steps are the run's own.
    """
    stepper, clock = model(case, map, way), case.problem.clock
    for k, state in enumerate(known):
        if k > 0:
            pick((k - 1) * clock.dt)
        yield state
    yield from stepped(stepper, clock, known[-1][0], lambda t, latent: pick(t), len(known) - 1)


def stepped(stepper, clock, latent, choose, begin=0):
    """Yield (`Latent`, `Report`) after each step from step `begin` on; choose(t, latent) gives the
    samples.
    """
    for k in range(begin, clock.steps):
        t = k * clock.dt
        latent, report = stepper.step(latent, choose(t, latent), t, clock.dt)
        yield latent, report


def start(case, map, rest):
    """`Latent` of the body at rest, searched from latent coordinates near it."""
    return initial(map, case.X[::-(-len(case.X) // ENOUGH)], xhat=rest)


def picked(case, map, way, xhat, seed):
    """Function of the time [s] -> indices of the samples of the step that begins then. Raises
    ValueError for ways to choose them that there are not, and as `drawing` does.
    """
    rng = np.random.default_rng(seed)
    if way.samples == "redrawn":
        return lambda t: drawing(case, map, way, t)(rng)
    if way.samples == "kept":
        first = drawing(case, map, way)(rng)
    elif way.samples == "pivoted":
        first = chosen(case.X, drawing(case, map, way), lambda X: map.derivatives(X, xhat)[2], rng)
    else:
        raise ValueError(f"samples = {way.samples!r}: expected redrawn, kept or pivoted")
    return lambda t: first


def drawing(case, map, way, t=0.0):
    """`Draw` of the samples of the step that begins at t [s]. Raises ValueError where they do not
    suffice, and for more to be pivoted than are looked at.
    """
    n = len(case.X)
    count = way.points or n
    if way.samples == "pivoted" and count > ENOUGH:
        raise ValueError(f"{count} samples that are pivoted: expected at most {ENOUGH}; take fewer "
                         'points, or samples = "kept"')
    return draw(n, count, map.r, map.dim, groups(case, way, t))


def chosen(X, draw, G, rng):
    """Sorted indices of the samples of a `Draw` from points X (n, d): those of its groups at
    random, the others pivoted by dg/dxhat, G(X).
    """
    forced = np.unique(np.concatenate([np.empty(0, dtype=int), *(
        rng.choice(group, min(draw.per_group, len(group)), replace=False)
        for group in draw.groups)]))
    some = np.setdiff1d(rng.choice(draw.n, min(draw.n, ENOUGH), replace=False), forced)
    best = some[pivoted(G(X[some]), draw.count - len(forced))]
    return np.union1d(best, forced)


def groups(case, way, t):
    """What samples must not miss; nothing where they are all points, or so few that these would be
    more than half of them: what is held tells little of the body's motion.
    """
    held = case.held(t)
    return held if way.points and way.points >= 2 * PER_GROUP * len(held) else ()
