"""A column of sand collapses on a rough floor, plane or axisymmetric, and how far it runs.

A column of width L (half of it in the plane case, a quarter of the cylinder in 3D, beside smooth
walls) and height a L. Its run-out is (front - L)/L once it has come to rest.

FLIP is the transfer: the others damp a little of the shear in each step, so that sand which flows
over a rough floor runs the less the more steps are taken; see the records `dt` of `column`.
"""

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
from mpm_ref.simulate import simulate

from ..common.scenes import catalogue_scene, threads_for, with_

G = 9.81                # [m/s^2]
WIDTH = 0.1             # L [m]
LASTS = 6.0             # duration over sqrt(max(height, L)/g)
BULK = 0.99             # of the sand lies behind the front; the rest is a foot of single particles
FRAMES = 60


class Case(NamedTuple):
    """A column and how it is run."""

    dim: int
    a: float                        # height/L
    cells: int                      # L/dx
    transfer: str = "flip"
    cfl: float = 0.9                # share of the stable time step
    friction_angle: float = 30.0    # degrees

    @property
    def kind(self):
        """In words."""
        return {2: "plane", 3: "axisymmetric"}[self.dim]


class Collapse(NamedTuple):
    """A collapse of a column: its front at S times, and the deposit."""

    t: np.ndarray           # (S,)   over sqrt(height/g)
    front: np.ndarray       # (S,)   what 99 percent of the sand lie behind/L
    foremost: float         # last distance of the foremost particle/L
    deposit: np.ndarray     # (K, 2) distance and height of its surface/L, cell by cell
    J: float                # mean volume ratio of F at the end
    particles: int
    steps: int

    @property
    def runout(self):
        """Of the bulk."""
        return float(self.front[-1] - 1.0)

    @property
    def creep(self):
        """Last run-out less that at 9/10 of the time."""
        return float(self.front[-1] - self.front[int(0.9 * len(self.front))])


def scene(case):
    """The shipped scene's sand in a column, 2^dim particles per cell."""
    dim, height, dx = case.dim, case.a * WIDTH, WIDTH / case.cells
    sand = catalogue_scene("column_collapse").body[0]
    flow = with_(sand.material.flow, friction_angle=case.friction_angle)
    sand = with_(sand, shape=column(dim, height), sampling=Regular(per_cell=2),
                 material=with_(sand.material, flow=flow))
    end = LASTS * sqrt(max(height, WIDTH) / G)
    return Scene(dim=dim, dx=dx, cfl=case.cfl, end=end, interval=end / FRAMES, body=(sand,),
                 gravity=tuple(-G * unit(dim - 1, dim)), collider=walls(dim),
                 scheme=Scheme(transfer=case.transfer))


def column(dim, height):
    """Half of a plane column, or a quarter of a cylinder."""
    if dim == 2:
        return Box(lower=(0.0, 0.0), upper=(WIDTH, height))
    whole = Cylinder(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, height), radius=WIDTH)
    quarter = Box(lower=(0.0, 0.0, 0.0), upper=(WIDTH, WIDTH, height))
    return Intersection(shapes=(whole, quarter))


def walls(dim):
    """A floor that holds, and smooth walls along the planes of symmetry."""
    def wall(axis, kind):
        plane = HalfSpace(point=(0.0,) * dim, normal=tuple(unit(axis, dim)))
        return Collider(shape=plane, kind=kind)

    return (wall(dim - 1, "sticky"), *(wall(axis, "slip") for axis in range(dim - 1)))


def unit(axis, dim):
    """Unit vector of an axis."""
    return np.eye(dim)[axis]


def collapse(case):
    """Run a column until it rests."""
    problem, rows = build(scene(case)), []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            q = frame.state.bodies[0].particles
            rows.append((frame.t, np.quantile(distance(q.x), BULK)))
    t, front = np.array(rows).T
    J = float(np.mean(np.linalg.det(q.F)))
    return Collapse(t / sqrt(case.a * WIDTH / G), front / WIDTH,
                    float(distance(q.x).max() / WIDTH), surface(q.x, WIDTH / case.cells) / WIDTH,
                    J, len(q.x), frame.state.step)


def distance(x):
    """Distance of particles x (N, d) from the plane or axis of symmetry (N,)."""
    return x[:, 0] if x.shape[1] == 2 else np.hypot(x[:, 0], x[:, 1])


def surface(x, dx):
    """Middle and greatest height of each ring of width dx that holds particles (K, 2)."""
    ring = (distance(x) / dx).astype(int)
    held = np.unique(ring)
    return np.array([((k + 0.5) * dx, x[ring == k, -1].max()) for k in held])
