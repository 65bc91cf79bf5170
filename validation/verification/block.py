"""An elastic block on a plane: flat with gravity turned, or truly inclined."""

from dataclasses import replace
from math import cos, radians, sin, tan
from typing import NamedTuple

import numpy as np

from mpm_ref.body import particles_at
from mpm_ref.explicit import Scheme
from mpm_ref.problem import Clock
from mpm_ref.scene import Body, Box, Collider, HalfSpace, Material, Moved, Regular, Scene, build
from mpm_ref.scene import Scheme as SceneScheme
from mpm_ref.simulate import simulate

from ..common.scenes import mean, threads_for

G = 9.81                        # [m/s^2]
LENGTH, HEIGHT = 0.4, 0.2       # of the block [m]
RHO, NU = 1000.0, 0.3
LASTS = 1.0                     # [s]
SETTLING = 0.3                  # [s] before the slide, some 15 times the slowest wave's period
SHOWN = 100                     # times at which a slide is measured


class Slope(NamedTuple):
    """A plane of slope theta with Coulomb friction tan(phi); angles in degrees."""

    theta: float
    phi: float
    tilted: bool                # the plane itself, not gravity in the grid's frame

    @property
    def along(self):
        """Unit vector down the plane."""
        t = radians(self.theta)
        return np.array([cos(t), -sin(t)]) if self.tilted else np.array([1.0, 0.0])

    @property
    def normal(self):
        """Unit vector out of the plane."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def pull(self):
        """Gravity down the plane [m/s^2]."""
        return G * sin(radians(self.theta))

    @property
    def press(self):
        """Gravity into the plane [m/s^2]."""
        return G * cos(radians(self.theta))

    @property
    def gravity(self):
        """Vector [m/s^2]."""
        return self.pull * self.along - self.press * self.normal

    @property
    def sticks(self):
        """Whether a rigid block stays."""
        return self.friction * self.press >= self.pull

    @property
    def friction(self):
        """Coulomb's coefficient."""
        return tan(radians(self.phi))

    @property
    def acceleration(self):
        """Of a rigid block [m/s^2]: g (sin theta - tan phi cos theta), or 0 where it sticks."""
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


def scene(slope, E, dx, sudden):
    """The block at rest on the plane, 3 x 3 particles per cell, under gravity or, where the pull
    down the plane is to come suddenly, its part into the plane.
    """
    box = Box(lower=(0.0, 0.0), upper=(LENGTH, HEIGHT))
    block = Body(name="block", density=RHO, sampling=Regular(per_cell=3),
                 shape=Moved(shape=box, angle=-slope.theta) if slope.tilted else box,
                 material=Material(law="fixed_corotated", E=E, nu=NU))
    plane = Collider(shape=HalfSpace(point=(0.0, 0.0), normal=tuple(slope.normal)),
                     kind="separate", friction=slope.friction)
    return Scene(dim=2, dx=dx, cfl=0.5, end=SETTLING, body=(block,), collider=(plane,),
                 gravity=tuple(-slope.press * slope.normal if sudden else slope.gravity),
                 scheme=SceneScheme(transfer="pic"))


def released(problem, slope, v0):
    """The problem once the block has come to rest under the gravity of `scene`, by PIC, which
    damps; then it has the speed v0 down the plane and all of gravity, and MLS-MPM takes over.
    """
    for frame in simulate(problem):
        rest = frame.state.bodies[0]
    q = rest.particles
    v = np.tile(v0 * slope.along, (len(q.x), 1))
    moving = particles_at(q.x, v, q.m, q.V0, "mls")
    moving.F[:] = q.F
    return replace(problem, bodies=(rest._replace(particles=moving),), scheme=Scheme(),
                   gravity=slope.gravity)


def slide(slope, E, dx, v0=0.0, sudden=True):
    """`Slide` for `LASTS` seconds from speed v0 [m/s]; E [Pa], grid spacing dx [m]."""
    problem, rows = build(scene(slope, E, dx, sudden)), []
    with threads_for(problem.bodies):
        problem = released(problem, slope, v0)
        problem = replace(problem, clock=Clock(end=LASTS, interval=LASTS / SHOWN))
        for frame in simulate(problem):
            x, v = (mean(frame.state.bodies[0], name) for name in "xv")
            rows.append((frame.t, x @ slope.along, v @ slope.along, x @ slope.normal,
                         v @ slope.normal))
    t, x, v, y, w = np.array(rows).T
    dt = t[-1] / frame.state.step
    return Slide(t, x - x[0], v, y - y[0], w, dt, len(frame.state.bodies[0].particles.x))
