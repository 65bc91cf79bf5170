"""A slide without friction along a curve: a saddle swings down in a bowl.

A piece of a ring that fits the bowl can only turn about the bowl's centre, a pendulum of which
every point is rigid: from rest at the angle a,

    omega^2 = 2 g l (1 - cos a)/k^2          at the bottom,

with l the distance of its centre of mass and k^2 the mean square distance of its mass from the
bowl's centre. (A disk would do worse: it rests on an arc of nodes, which makes it turn as well.)
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.scene import (
    Body,
    Collider,
    Difference,
    Intersection,
    Material,
    Regular,
    Scene,
    Sphere,
    Wedge,
    build,
)
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import mean, threads_for

G = 9.81            # [m/s^2]
RADIUS, THICKNESS, HALF_ANGLE, START = 1.0, 0.2, 15.0, 60.0     # [m], [m], degrees, degrees
AGREED = 1e-3       # relative error of the speed that a public code's test of such a slide allows


class Swing(NamedTuple):
    """A swing from rest to the bottom, at S times."""

    t: np.ndarray
    omega: np.ndarray       # (S,) angular momentum / m k^2 [rad/s]
    energy: np.ndarray      # (S,) [J]
    bottom: float           # omega at the bottom, interpolated
    exact: float
    released: float         # energy of the height lost by the exact pendulum [J]
    particles: int
    steps: int


def bowl_scene(dx):
    """Return the scene of the saddle at rest in the bowl."""
    a = np.radians(START)
    around = Sphere(center=(0.0, 0.0), radius=RADIUS)
    hollow = Sphere(center=(0.0, 0.0), radius=RADIUS - THICKNESS)
    sector = Wedge(tip=(0.0, 0.0), direction=(np.sin(a), -np.cos(a)), half_angle=HALF_ANGLE,
                   length=2.0 * RADIUS)
    saddle = Body(name="saddle", density=1000.0, sampling=Regular(per_cell=3),
                  shape=Intersection(shapes=(Difference(shape=around, minus=(hollow,)), sector)),
                  material=Material(law="fixed_corotated", E=1e7, nu=0.3))
    return Scene(dim=2, dx=dx, cfl=0.5, end=1.0, interval=0.005, gravity=(0.0, -G), body=(saddle,),
                 collider=(Collider(shape=around, kind="separate", inside=True),))


def swing(problem):
    """Run a problem of `bowl_scene` until the centre of mass has passed the bottom."""
    rows = []
    q = problem.bodies[0].particles
    k2 = float(q.m @ np.sum(q.x**2, axis=1) / q.m.sum())
    center = mean(problem.bodies[0], "x")
    exact = pendulum_speed(np.hypot(*center), k2, -center[1])
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            q = frame.state.bodies[0].particles
            L = q.m @ (q.x[:, 1] * q.v[:, 0] - q.x[:, 0] * q.v[:, 1]) / q.m.sum()
            E = energy(frame.state.bodies, problem.gravity, problem.inertia).sum
            rows.append((frame.t, mean(frame.state.bodies[0], "x")[0], L / k2, E))
            if rows[-1][1] < 0.0:
                break
    t, x, omega, E = np.array(rows).T
    bottom = float(np.interp(0.0, -x[-2:], omega[-2:]))
    released = 0.5 * float(q.m.sum()) * k2 * exact**2
    return Swing(t, omega, E, bottom, exact, released, len(q.x), frame.state.step)


def pendulum_speed(l, k2, depth):
    """Return omega at the bottom [rad/s], from rest at the depth [m] of the centre of mass.

    l [m] is its distance from the axis, k2 [m^2] the mean square distance of the mass.
    """
    return float(np.sqrt(2.0 * G * (l - depth) / k2))


@experiment("verification.bowl", title="Slide without friction along a curve",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def bowl(run):
    """Record the speed at the bottom against the pendulum's."""
    rows = []
    for dx in run.progress(run.choose(quick=(0.1, 0.05), standard=(0.1, 0.05, 0.025)), "dx"):
        s = swing(build(bowl_scene(dx)))
        rows += [(dx, *row) for row in zip(s.t, s.omega, s.energy, strict=True)]
    run.table("course", ("dx", "t", "omega", "energy"), rows)
    scale = f"{s.particles} particles, {s.steps} steps, dx = {dx} m, bowl of 1 m"
    run.record("verification.bowl.speed", s.bottom, unit="rad/s", paper=s.exact, comparator="=",
               tolerance=AGREED, scale=scale)
    ratio = 1.0 - (s.energy[0] - s.energy[-1]) / s.released
    run.record("verification.bowl.energy_kept", float(ratio), comparator="info", scale=scale,
               note="of the energy of the height lost")
