"""Collapse of columns of sand against published scalings of the run-out with the aspect ratio.

A column of width L (half of it in the plane case, a quarter of the cylinder in 3D, beside smooth
walls) and height a L collapses on a rough floor. Its run-out is (front - L)/L once it has come to
rest. FLIP is the transfer: the others damp a little of the shear in each step, so that sand which
flows over a rough floor runs the less the more steps are taken; see the records `dt`.

Exponents as the abstracts of their papers state them: in plane channels 0.65 +- 0.05 (narrow) and
0.9 +- 0.1 (wide) [BalmforthKerswell2005]; 0.52 for tall cylinders [Larrieu2006]. The laws of
[Lube2005] and [Lube2004] are quoted so in later work; the papers are not at hand: `unconfirmed`.
"""

from itertools import combinations
from math import sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.scene import (
    Box,
    Collider,
    Cylinder,
    HalfSpace,
    Intersection,
    Regular,
    Scene,
    Scheme,
    build,
)
from mpm_ref.scene.crossing import crossing_time
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, threads_for, with_
from .convergence import order

G = 9.81                # [m/s^2]
WIDTH = 0.1             # L [m]
DURATION = 6.0          # over sqrt(max(height, L)/g)
BULK = 0.99             # of the sand lies behind the front; the rest is a foot of single particles
FRAMES = 60
TALL = {2: 2.8, 3: 1.7}         # aspect ratios above which a column is tall [Lube2005] [Lube2004]
EXPONENT = {                    # of tall columns: band, and why
    2: ((0.6, 1.0), "from the narrow channels' 0.65 - 0.05 to the wide ones' 0.9 + 0.1; the plane "
                    "column has no side walls"),
    3: ((0.47, 0.57), "0.52 with the +- 0.05 that the plane channels' exponents have"),
}
SAME = 0.05                     # that exponents over the same ratios may differ on two grids
STEADY = 0.05                   # of the run-out: change that a third of the time step may make
FRICTION = "friction angle 30 degrees, rough floor"


class SandColumn(NamedTuple):
    """A column and the settings of its run."""

    dim: int
    a: float                        # height/L
    cells: int                      # L/dx
    transfer: str = "flip"
    cfl: float = 0.9                # share of the stable time step
    friction_angle: float = 30.0    # degrees
    crossings: float = 0.0          # relaxation of the transfer, in times dx/c of the sand at rest

    @property
    def kind(self):
        """Return the kind of column: plane or axisymmetric."""
        return {2: "plane", 3: "axisymmetric"}[self.dim]


class Collapse(NamedTuple):
    """A collapse of a column: its front at S times, and the deposit."""

    t: np.ndarray           # (S,)   over sqrt(height/g)
    front: np.ndarray       # (S,)   position behind which 99 percent of the sand lie/L
    foremost: float         # last distance of the foremost particle/L
    deposit: np.ndarray     # (K, 2) distance and height of its surface/L, cell by cell
    J: float                # mean volume ratio of F at the end
    particles: int
    steps: int

    @property
    def runout(self):
        """Return the run-out of the bulk."""
        return float(self.front[-1] - 1.0)

    @property
    def creep(self):
        """Return the last run-out less that at 9/10 of the time."""
        return float(self.front[-1] - self.front[int(0.9 * len(self.front))])


def column_scene(column):
    """Return the scene of a column of the catalogue's sand, 2^dim particles per cell."""
    dim, height, dx = column.dim, column.a * WIDTH, WIDTH / column.cells
    sand = catalogue_scene("column_collapse").body[0]
    flow = with_(sand.material.flow, friction_angle=column.friction_angle)
    sand = with_(sand, shape=column_shape(dim, height), sampling=Regular(per_cell=2),
                 material=with_(sand.material, flow=flow))
    end = DURATION * sqrt(max(height, WIDTH) / G)
    scene = Scene(dim=dim, dx=dx, cfl=column.cfl, end=end, interval=end / FRAMES, body=(sand,),
                  gravity=tuple(-G * unit(dim - 1, dim)), collider=walls(dim))
    relaxation = column.crossings * crossing_time(scene)
    return with_(scene, scheme=Scheme(transfer=column.transfer, relaxation=relaxation))


def column_shape(dim, height):
    """Return half of a plane column, or a quarter of a cylinder."""
    if dim == 2:
        return Box(lower=(0.0, 0.0), upper=(WIDTH, height))
    cylinder = Cylinder(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, height), radius=WIDTH)
    quarter = Box(lower=(0.0, 0.0, 0.0), upper=(WIDTH, WIDTH, height))
    return Intersection(shapes=(cylinder, quarter))


def walls(dim):
    """Return a sticky floor, and smooth walls along the planes of symmetry."""
    def wall(axis, kind):
        plane = HalfSpace(point=(0.0,) * dim, normal=tuple(unit(axis, dim)))
        return Collider(shape=plane, kind=kind)

    return (wall(dim - 1, "sticky"), *(wall(axis, "slip") for axis in range(dim - 1)))


def unit(axis, dim):
    """Return the unit vector of an axis."""
    return np.eye(dim)[axis]


def collapse(column):
    """Run a column until it rests."""
    problem, rows = build(column_scene(column)), []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            q = frame.state.bodies[0].particles
            rows.append((frame.t, np.quantile(distance(q.x), BULK)))
    t, front = np.array(rows).T
    J = float(np.mean(np.linalg.det(q.F)))
    return Collapse(t / sqrt(column.a * WIDTH / G), front / WIDTH,
                    float(distance(q.x).max() / WIDTH), surface(q.x, WIDTH / column.cells) / WIDTH,
                    J, len(q.x), frame.state.step)


def distance(x):
    """Return the distances (N,) of particles x (N, d) from the plane or axis of symmetry."""
    return x[:, 0] if x.shape[1] == 2 else np.hypot(x[:, 0], x[:, 1])


def surface(x, dx):
    """Return the middle and the greatest height of each ring of width dx with particles (K, 2)."""
    ring = (distance(x) / dx).astype(int)
    return np.array([((k + 0.5) * dx, x[ring == k, -1].max()) for k in np.unique(ring)])


def lube(dim, a):
    """Return the run-out by the unconfirmed laws; None in the gap between them."""
    if dim == 2:
        return 1.2 * a if a < 1.8 else (1.9 * a ** (2.0 / 3.0) if a > TALL[2] else None)
    return 1.24 * a if a < TALL[3] else 1.6 * a**0.5


@experiment("verification.column", title="Column collapse of sand: run-out against aspect ratio",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 2400})
def sand_column(run):
    """Run plane and axisymmetric columns of several aspect ratios; fit the tall ones' exponent."""
    plans = run.choose(
        quick=((2, 6, (4.0, 8.0)), (3, 4, (2.0,))),
        standard=((2, 8, (0.5, 1.0, 2.0, 4.0, 8.0)), (2, 16, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)),
                  (2, 32, (0.5, 1.0, 2.0, 4.0)), (3, 6, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)),
                  (3, 10, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0))))
    columns = [SandColumn(dim, a, cells) for dim, cells, ratios in plans for a in ratios]
    collapses = {column: collapse(column) for column in run.progress(columns, "columns")}
    for column, c in collapses.items():
        record_runout(run, column, c)
    for dim, cells, _ in plans:
        record_exponent(run, {column.a: (column, c) for column, c in collapses.items()
                              if (column.dim, column.cells) == (dim, cells)
                              and column.a > TALL[dim]})
    for dim in (2, 3):
        record_grids(run, {column: c for column, c in collapses.items()
                           if column.dim == dim and column.a > TALL[dim]})
    record_time_steps(run, *run.choose(quick=(4, ("flip", "mls")),
                                       standard=(8, ("flip", "apic", "mls"))))
    write_tables(run, collapses)


def record_runout(run, column, c):
    """Record the run-out of one column beside the unconfirmed law."""
    run.record(f"verification.column.{column.kind}.a{column.a:g}.n{column.cells}.runout", c.runout,
               paper=lube(column.dim, column.a), comparator="info",
               scale=f"{c.particles} particles, {c.steps} steps; {FRICTION}",
               note=f"unconfirmed law of Lube et al.; foremost particle {c.foremost - 1.0:.2f}, "
               f"moved in the last tenth of the time {c.creep:.1e}, mean J {c.J:.3f}")


def record_exponent(run, tall):
    """Record the exponent of the run-out of tall columns {a: (column, collapse)} of one kind."""
    if len(tall) < 2:
        return
    column = next(iter(tall.values()))[0]
    bound, why = EXPONENT[column.dim]
    ratios, runouts = list(tall), [c.runout for _, c in tall.values()]
    local = [order(ratios[k:k + 2], runouts[k:k + 2]) for k in range(len(tall) - 1)]
    run.record(f"verification.column.{column.kind}.n{column.cells}.exponent",
               order(ratios, runouts), comparator="band", bound=bound,
               scale=f"aspect ratios {', '.join(f'{a:g}' for a in ratios)}; {FRICTION}",
               note=f"{why}; from ratio to ratio {', '.join(f'{p:.2f}' for p in local)}, so that a "
               "power law is reached at best by the tallest")


def record_grids(run, tall):
    """Record by how much the exponents of tall columns {column: collapse} differ between
    the two grids with the most common aspect ratios, over these.
    """
    grids = sorted({column.cells for column in tall})
    ratios = {n: {column.a for column in tall if column.cells == n} for n in grids}
    shared, coarse, fine = max(
        ((sorted(ratios[m] & ratios[n]), m, n) for m, n in combinations(grids, 2)),
        key=lambda row: len(row[0]), default=((), 0, 0))
    if len(shared) < 2:
        return
    runouts = {(column.cells, column.a): c.runout for column, c in tall.items()}
    exponents = [order(shared, [runouts[n, a] for a in shared]) for n in (coarse, fine)]
    kind = next(iter(tall)).kind
    run.record(f"verification.column.{kind}.grids", exponents[1] - exponents[0],
               comparator="band", bound=(-SAME, SAME),
               scale=f"aspect ratios {', '.join(f'{a:g}' for a in shared)}; L = {coarse}, {fine} "
               f"dx; {FRICTION}",
               note=f"difference of the exponents over the same ratios, {exponents[0]:.2f} and "
               f"{exponents[1]:.2f}; the exponent of each grid above is over all of its ratios")


def record_time_steps(run, cells, transfers):
    """Record the change that a third of the time step makes, with each transfer."""
    rows = []
    for transfer in run.progress(transfers, "time steps"):
        columns = [SandColumn(2, 1.0, cells, transfer, cfl) for cfl in (0.9, 0.3)]
        long, short = (collapse(column) for column in columns)
        run.record(f"verification.column.dt.{transfer}", abs(short.runout / long.runout - 1.0),
                   scale=f"plane, a = 1, L = {cells} dx; {long.steps} and {short.steps} steps",
                   comparator="<=", bound=STEADY, note="relative change of the run-out")
        rows += [(transfer, c.steps, c.runout) for c in (long, short)]
    run.table("dt", ("transfer", "steps", "runout"), rows)


def write_tables(run, collapses):
    """Write the run-outs, the fronts over time and the deposits."""
    keys = ("kind", "cells", "a")

    def head(column):
        return column.kind, column.cells, column.a

    run.table("runout", (*keys, "runout", "foremost", "lube"),
              [(*head(column), c.runout, c.foremost - 1.0,
                lube(column.dim, column.a) or float("nan")) for column, c in collapses.items()])
    run.table("front", (*keys, "t", "front"),
              [(*head(column), t, x) for column, c in collapses.items()
               for t, x in zip(c.t, c.front, strict=True)])
    run.table("deposit", (*keys, "r", "height"),
              [(*head(column), r, h) for column, c in collapses.items() for r, h in c.deposit])
