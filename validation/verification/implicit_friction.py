"""Coulomb friction in implicit steps: a block on an incline, and one that is dragged over a floor.

On the incline the laws of `incline` hold with the sums of backward Euler steps, x = a t (t + dt)/2.
A block between a floor and a plate that drags it has no weight and is pressed together; once it
slides steadily, the force on the floor is that in the block: with nodal values phi that fall from 1
on the floor to 0 at the plate it is sum_p V0_p tau_p grad phi_p, the ratio of whose components is
mu.
"""

from dataclasses import replace
from math import radians, tan

import numpy as np

from mpm_ref.body import particles_at
from mpm_ref.core.boundary import Collider, Conditions, Prescribed
from mpm_ref.core.levelset import half_space
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.state import NONE
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import options_of
from mpm_ref.materials import make_law
from mpm_ref.plain.spline import pairs
from mpm_ref.problem import Clock, Problem
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import threads_for
from .bowl import bowl_scene, swing
from .incline import (
    DURATION,
    HEIGHT,
    LENGTH,
    NU,
    PLANES,
    RHO,
    SHOWN,
    SLIDING,
    STICKING,
    STIFFNESS,
    THETA,
    V0,
    Slope,
    block_scene,
    released,
    trajectory,
)
from .lattice import body, lattice
from .symplectic import distance_travelled

METHOD = "hot-plus"
EPS = 1e-8                  # of the solves
DT = 0.01                   # [s]
AGREED = 5e-3               # relative error that is allowed
TRANSFERS = ("apic", "mls")
SHARP = 1e-3                # of the momentum law: the loads of friction change by as much, at most
PRESSED, DRAG = 0.02, 0.5   # compression of the dragged block; speed of its plate [m/s]
SWING_DT = 0.01             # [s] of the saddle in the bowl
SETTLED = 0.3               # share of the drag after which it slides steadily
PLATE = 0.8                 # share of its height above which the plate holds it


def implicit(problem, transfer, dt=DT):
    """Return a problem with implicit steps of dt [s] and a transfer."""
    rest = problem.bodies[0]
    q = rest.particles
    moving = particles_at(q.x, q.v, q.m, q.V0, transfer)
    moving.F[:] = q.F
    clock = Clock(dt=dt, end=DURATION, interval=max(dt, DURATION / SHOWN))
    return replace(problem, bodies=(rest._replace(particles=moving),), clock=clock,
                   scheme=Scheme(transfer=transfer), integrator="implicit",
                   solver=options_of(METHOD, eps=EPS))


class ImplicitPlane:
    """A plane and a transfer, its slides, and how their numbers are recorded."""

    def __init__(self, run, name, transfer, dx):
        self.run, self.tilted, self.transfer, self.dx = run, PLANES[name], transfer, dx
        self.name = f"{name}.{transfer}"

    def slide(self, phi, E=STIFFNESS, v0=0.0, sudden=True):
        """Return the slope of friction angle phi [degrees] and the slide on it."""
        slope = Slope(THETA, phi, self.tilted)
        problem = released(build(block_scene(slope, E, self.dx, sudden)), slope, v0)
        return slope, trajectory(implicit(problem, self.transfer), slope)

    def record(self, quantity, value, s, **rule):
        """Record a number of a slide."""
        scale = (f"{s.particles} particles, {round(s.t[-1] / s.dt)} steps of {s.dt:.3g} s, dx = "
                 f"{self.dx} m, {METHOD}")
        self.run.record(f"verification.implicit_friction.{self.name}.{quantity}", float(value),
                        scale=scale, **rule)

    def measure(self):
        """Record slides from rest and with a speed, and a block that sticks."""
        (slope, soft), (_, stiff) = self.slide(SLIDING), self.slide(SLIDING, 4.0 * STIFFNESS)
        ends = [distance_travelled(0.0, slope.acceleration, s.t[-1], s.dt) for s in (soft, stiff)]
        ahead = [s.x[-1] - end for s, end in zip((soft, stiff), ends, strict=True)]
        self.record("way", (2.0 * ahead[1] - ahead[0]) / ends[1], stiff, paper=0.0,
                    comparator="band", bound=(-AGREED, AGREED),
                    note="relative error of x after 1 s from rest, extrapolated to E = infinity as "
                    "in verification.incline")
        slope, s = self.slide(SLIDING, v0=V0)
        exact = V0 + slope.acceleration * s.t
        error = np.abs(s.v + slope.friction * s.w - exact).max() / exact[-1]
        self.record("momentum_law", error, s, paper=0.0, comparator="<=", bound=SHARP,
                    note="v + tan phi w against v0 + a t, largest error over 1 s, relative")
        slope, s = self.slide(STICKING, sudden=False)
        free = distance_travelled(0.0, slope.pull, s.t[-1], s.dt)
        self.record("sticking", abs(s.x[-1]) / free, s, paper=0.0, comparator="<=", bound=AGREED,
                    note="way after 1 s over that without friction")


def dragged(mu, transfer, dx, steps):
    """Return the rows (t, force on the floor along and into it [N]) of the dragged block."""
    law = make_law("fixed_corotated", E=STIFFNESS, nu=NU)
    X = lattice([0.0, 0.0], [LENGTH, HEIGHT], dx / 2)
    block = body(X, dx / 2, RHO, law, transfer)
    block = block._replace(particles=block.particles._replace(b=NONE))
    q = block.particles
    q.F[:] = np.diag((1.0, 1.0 - PRESSED))
    q.x[:, 1] *= 1.0 - PRESSED
    floor = Collider(half_space((0.0, 0.0), (0.0, 1.0)), "separate", friction=mu)
    plate = Prescribed(half_space((0.0, PLATE * HEIGHT), (0.0, -1.0)), Motion(Steady((DRAG, 0.0))))
    problem = Problem(
        bodies=(block,), scheme=Scheme(transfer=transfer), dx=dx, gravity=np.zeros(2),
        conditions=Conditions((floor,), (plate,)), clock=Clock(dt=DT, steps=steps, every=1),
        integrator="implicit", solver=options_of(METHOD, eps=EPS))
    rows = []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            rows.append((frame.t, *force_on_floor(frame.state.bodies[0].particles, dx, transfer)))
    return np.array(rows)


def force_on_floor(q, dx, transfer):
    """Return the force (2,) [N] that particles q pass on to the floor, from their stress."""
    ip = pairs(q.x, dx, 2)
    dw = ip.w[..., None] * ip.r / (dx * dx / 4.0) if transfer == "mls" else ip.dw
    phi = np.clip(1.0 - ip.node[..., 1] * dx / (PLATE * HEIGHT), 0.0, 1.0)
    return np.einsum("p,pab,pi,pib->a", q.V0, q.tau, phi, dw)


def sheared_block(run, transfer, dx):
    """Record the ratio of the forces on the floor while the dragged block slides."""
    mu, steps = tan(radians(SLIDING)), run.choose(quick=20, standard=60)
    rows = dragged(mu, transfer, dx, steps)
    steady = rows[rows[:, 0] > SETTLED * rows[-1, 0]]
    ratio = abs(float(np.mean(steady[:, 1]) / np.mean(steady[:, 2])))
    run.record(f"verification.implicit_friction.dragged.{transfer}.ratio", ratio, paper=mu,
               comparator="=", tolerance=AGREED,
               scale=f"block {LENGTH} m x {HEIGHT} m, dx = {dx} m, {steps} steps of {DT} s",
               note="mean force along the floor over that into it, from the stress of the block")
    return [(transfer, *row) for row in rows]


def pendulum(run, dx):
    """Record the speed of the saddle at the bottom of the bowl, which has no friction."""
    steps = (SWING_DT, SWING_DT / 2)
    swings = [swing(implicit(build(bowl_scene(dx)), "apic", dt)) for dt in steps]
    speeds = [s.bottom / s.exact for s in swings]
    scale = f"{swings[1].particles} particles, dx = {dx} m, steps of {steps} s, {METHOD}"
    run.record("verification.implicit_friction.bowl.speed", 2.0 * speeds[1] - speeds[0], paper=1.0,
               comparator="=", tolerance=AGREED, scale=scale,
               note="over the pendulum's, extrapolated to dt = 0 with errors in dt")
    for dt, speed in zip(steps, speeds, strict=True):
        run.record(f"verification.implicit_friction.bowl.speed_{dt:g}s", speed, comparator="info",
                   scale=scale, note=f"the same with steps of {dt:g} s")


@experiment("verification.implicit_friction", title="Coulomb friction in implicit steps",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 240})
def implicit_friction(run):
    """Record slides and sticking on two planes, the bowl, and a block that is dragged."""
    dx = run.choose(quick=0.05, standard=0.025)
    cases = [(name, transfer) for name in PLANES for transfer in TRANSFERS]
    for name, transfer in run.progress(run.choose(quick=cases[:1], standard=cases), "planes"):
        ImplicitPlane(run, name, transfer, dx).measure()
    rows = [row for transfer in TRANSFERS for row in sheared_block(run, transfer, dx)]
    pendulum(run, 2.0 * dx)
    run.table("dragged", ("transfer", "t", "along", "into"), rows)
