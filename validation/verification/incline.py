"""A block on an incline with Coulomb friction: sliding, sticking, and sliding without friction.

A rigid block slides by x = g t^2 (sin theta - tan phi cos theta)/2 or sticks, if tan phi >= tan
theta. An elastic one obeys, at any time and however it shakes, the sum of its momentum equations
along and away from the plane: while all of its foot slides,

    v + tan phi w = v0 + g (sin theta - tan phi cos theta) t.

From rest its foot sticks until the shear stress has built up, in a time of the order of height /
wave speed; the distance gained thereby falls with the square root of its stiffness. The plane is
flat with gravity turned, or truly inclined.
"""

from dataclasses import replace
from math import cos, radians, sin, tan
from typing import NamedTuple

import numpy as np

from mpm_ref.body import particles_at
from mpm_ref.explicit import Scheme
from mpm_ref.problem import Clock
from mpm_ref.scene import (
    Body,
    Box,
    Collider,
    HalfSpace,
    Material,
    Regular,
    Scene,
    Transformed,
    build,
)
from mpm_ref.scene import Scheme as SceneScheme
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import mean, threads_for
from .symplectic import distance_travelled

G = 9.81                        # [m/s^2]
LENGTH, HEIGHT = 0.4, 0.2       # of the block [m]
RHO, NU = 1000.0, 0.3
DURATION = 1.0                     # [s]
SETTLING = 0.3                  # [s] before the slide, some 15 times the slowest wave's period
SHOWN = 100                     # times at which a slide is measured
THETA, SLIDING, STICKING = 24.0, 15.0, 30.0     # degrees; the first two from a public code's test
V0 = 0.5                    # [m/s] at which the foot slides from the start
STIFFNESS = 1e6             # [Pa]
AGREED = 1e-3               # relative error that a public code's test of this problem allows
ROUND_OFF = 1e-11           # of v: rounding of some 1e3 steps, amplified by the block's shaking
PLANES = {"flat": False, "tilted": True}


class Slope(NamedTuple):
    """A plane of slope theta with Coulomb friction tan(phi); angles in degrees."""

    theta: float
    phi: float
    tilted: bool                # the plane itself, not gravity in the grid's frame
    boundary: str = "nodes"     # or "surface": where the condition of the plane holds

    @property
    def along(self):
        """Return the unit vector down the plane."""
        t = radians(self.theta)
        return np.array([cos(t), -sin(t)]) if self.tilted else np.array([1.0, 0.0])

    @property
    def normal(self):
        """Return the unit vector out of the plane."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def pull(self):
        """Return the part of gravity down the plane [m/s^2]."""
        return G * sin(radians(self.theta))

    @property
    def press(self):
        """Return the part of gravity into the plane [m/s^2]."""
        return G * cos(radians(self.theta))

    @property
    def gravity(self):
        """Return the vector of gravity [m/s^2]."""
        return self.pull * self.along - self.press * self.normal

    @property
    def sticks(self):
        """Return whether a rigid block sticks."""
        return self.friction * self.press >= self.pull

    @property
    def friction(self):
        """Return Coulomb's coefficient of friction."""
        return tan(radians(self.phi))

    @property
    def acceleration(self):
        """Return the acceleration of a rigid block [m/s^2]: 0 where it sticks."""
        return 0.0 if self.sticks else self.pull - self.friction * self.press


class Slide(NamedTuple):
    """Motion of the block's centre at S times, along (x, v) and away from (y, w) the plane."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    y: np.ndarray
    w: np.ndarray
    dt: float                   # mean step [s]
    particles: int


def block_scene(slope, E, dx, sudden):
    """Return the scene of the block at rest on the plane, 3 x 3 particles per cell.

    It is under gravity or, where the pull down the plane comes suddenly, its part into the plane.
    """
    box = Box(lower=(0.0, 0.0), upper=(LENGTH, HEIGHT))
    block = Body(name="block", density=RHO, sampling=Regular(per_cell=3),
                 shape=Transformed(shape=box, angle=-slope.theta) if slope.tilted else box,
                 material=Material(law="fixed_corotated", E=E, nu=NU))
    plane = Collider(shape=HalfSpace(point=(0.0, 0.0), normal=tuple(slope.normal)),
                     kind="separate", friction=slope.friction)
    return Scene(dim=2, dx=dx, cfl=0.5, end=SETTLING, body=(block,), collider=(plane,),
                 boundary=slope.boundary,
                 gravity=tuple(-slope.press * slope.normal if sudden else slope.gravity),
                 scheme=SceneScheme(transfer="pic"))


def released(problem, slope, v0):
    """Return the problem of the block released from rest with the speed v0 down the plane.

    It comes to rest under the gravity of `block_scene` by PIC, which damps; then all of gravity
    acts, and MLS-MPM takes over.
    """
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            rest = frame.state.bodies[0]
    q = rest.particles
    v = np.tile(v0 * slope.along, (len(q.x), 1))
    moving = particles_at(q.x, v, q.m, q.V0, "mls")
    moving.F[:] = q.F
    return replace(problem, bodies=(rest._replace(particles=moving),), scheme=Scheme(),
                   gravity=slope.gravity)


def slide(slope, E, dx, v0=0.0, sudden=True):
    """Return the `Slide` of `DURATION` seconds from speed v0 [m/s]; E [Pa], spacing dx [m]."""
    problem = released(build(block_scene(slope, E, dx, sudden)), slope, v0)
    return trajectory(replace(problem, clock=Clock(end=DURATION, interval=DURATION / SHOWN)), slope)


def trajectory(problem, slope):
    """Return the `Slide` of a problem of the block on a slope."""
    rows = []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            x, v = (mean(frame.state.bodies[0], name) for name in "xv")
            rows.append((frame.t, x @ slope.along, v @ slope.along, x @ slope.normal,
                         v @ slope.normal))
    t, x, v, y, w = np.array(rows).T
    dt = t[-1] / frame.state.step
    return Slide(t, x - x[0], v, y - y[0], w, dt, len(frame.state.bodies[0].particles.x))


@experiment("verification.incline", title="Block on an incline: friction, sticking, free slide",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 60})
def incline(run):
    """Record slides on a flat wall with gravity turned, and on a truly tilted plane."""
    dx = run.choose(quick=0.05, standard=0.025)
    rows = []
    for name, tilted in run.progress(PLANES.items(), "planes"):
        plane = Plane(run, name, tilted, dx)
        rows += [*sliding(plane), *momentum_law(plane), *sticking(plane), *frictionless(plane)]
    run.table("course", ("plane", "case", "t", "x", "exact"), rows)


class Plane:
    """One plane, its slides, and how its numbers are recorded."""

    def __init__(self, run, name, tilted, dx):
        self.run, self.name, self.tilted, self.dx = run, name, tilted, dx

    def slide(self, phi, E=STIFFNESS, **start):
        """Return the slope of friction angle phi and the slide on it."""
        slope = Slope(THETA, phi, self.tilted)
        return slope, slide(slope, E, self.dx, **start)

    def record(self, quantity, value, s, **rule):
        """Record a number of a slide."""
        scale = (f"{s.particles} particles, {round(s.t[-1] / s.dt)} steps, block {LENGTH} m x "
                 f"{HEIGHT} m, dx = {self.dx} m")
        self.run.record(f"verification.incline.{self.name}.{quantity}", float(value), scale=scale,
                        **rule)

    def rows(self, case, s, exact):
        """Return the rows of a slide for the table."""
        return [(self.name, case, t, x, e) for t, x, e in zip(s.t, s.x, exact, strict=True)]


def sliding(plane):
    """Record slides from rest with two stiffnesses; extrapolate to a rigid block."""
    (slope, soft), (_, stiff) = plane.slide(SLIDING), plane.slide(SLIDING, 4.0 * STIFFNESS)
    distances = [distance_travelled(0.0, slope.acceleration, s.t, s.dt) for s in (soft, stiff)]
    ahead = [s.x[-1] - distance[-1]
             for s, distance in zip((soft, stiff), distances, strict=True)]
    plane.record("way", (2.0 * ahead[1] - ahead[0]) / distances[1][-1], stiff, paper=0.0,
                 comparator="band", bound=(-AGREED, AGREED),
                 note="relative error of x after 1 s from rest, extrapolated to E = infinity from "
                 f"E and 4 E = {4.0 * STIFFNESS:g} Pa, with errors in 1/sqrt(E)")
    for s, distance, error, E in zip((soft, stiff), distances, ahead, (1, 4), strict=True):
        plane.record(f"way_{E}E", error / distance[-1], s, paper=0.0, comparator="info",
                     note="the same as it is, with the start during which the foot sticks")
    return plane.rows("sliding", stiff, distances[1])


def momentum_law(plane):
    """Record the momentum law above from a speed at which the foot slides at once."""
    slope, s = plane.slide(SLIDING, v0=V0)
    exact = V0 + slope.acceleration * s.t
    error = np.abs(s.v + slope.friction * s.w - exact).max() / exact[-1]
    plane.record("momentum_law", error, s, paper=0.0, comparator="<=", bound=ROUND_OFF,
                 note="v + tan phi w against v0 + a t, largest error over 1 s, relative")
    return plane.rows("thrown", s, distance_travelled(V0, slope.acceleration, s.t, s.dt))


def sticking(plane):
    """Record a block that sticks, tan phi > tan theta, from rest under all of gravity."""
    slope, s = plane.slide(STICKING, sudden=False)
    free = distance_travelled(0.0, slope.pull, s.t[-1], s.dt)
    plane.record("sticking", abs(s.x[-1]) / free, s, paper=0.0, comparator="<=", bound=AGREED,
                 note="way after 1 s over that without friction")
    _, shaken = plane.slide(STICKING)
    plane.record("sticking_shaken", abs(shaken.x[-1]) / free, shaken, paper=0.0, comparator="info",
                 note="the same if the pull comes suddenly: the shear stress of the elastic block "
                 "then overshoots what friction holds, and nothing but friction damps its shaking")
    return plane.rows("sticking", s, np.zeros_like(s.t))


def frictionless(plane):
    """Record a slide without friction: the exact sum of symplectic Euler's steps."""
    slope, s = plane.slide(0.0)
    exact = distance_travelled(0.0, slope.pull, s.t, s.dt)
    plane.record("frictionless", abs(s.x[-1] / exact[-1] - 1.0), s, paper=0.0, comparator="<=",
                 bound=ROUND_OFF, note="against g sin(theta) t (t + dt)/2, the sum of the steps")
    return plane.rows("frictionless", s, exact)
