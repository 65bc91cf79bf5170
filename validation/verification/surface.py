"""Conditions at the surface of colliders, beside those at nodes: how far the wall is off.

*bar*: axial vibration of a bar that a plane holds, at several angles to the grid and offsets from
its nodes; the exact frequency is that of `bar`. *ring*: torsional vibration of a ring between two
cylinders that hold it, u_theta = A cos(omega t) (J_1(k r) Y_1(k a) - Y_1(k r) J_1(k a)), omega =
k sqrt(mu/rho), where k is the first root of the bracket at r = b: curved walls. *cantilever*: a
beam clamped at its end. *mms*: the manufactured solution of `mms` between slip walls. *incline*: a
block that slides on a plane along the grid or inclined.

A wall that acts a depth delta behind its surface lengthens the bar by delta, and the gap of the
ring by 2 delta: the depth follows from the frequency.
"""

from itertools import pairwise
from math import ceil, cos, pi, radians, sin, sqrt
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import j1, jvp, y1, yvp

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space, sphere
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow, lame, stiffness

from ..common.registry import experiment
from ..common.scenes import threads_for
from . import bar, mms
from .cantilever import Support, small_error
from .convergence import order
from .incline import SLIDING, STIFFNESS, THETA, Slope, slide
from .lattice import body, lattice
from .manufactured import follow
from .mms import name
from .symplectic import distance_travelled

BOUNDARIES = {"nodes": Conditions, "surface": SurfaceConditions}
WIDTH = 0.5 * bar.L
PERIODS, CFL = 3, 0.4
ORDER = {"paper": 2.0, "comparator": "band", "bound": (1.8, 2.3)}


# the bar

class Placement(NamedTuple):
    """The angle of a bar to the x axis [degrees], and the offset of its end from a node [cells]."""

    angle: float
    offset: float

    def __str__(self):
        return f"{self.angle:g}-{self.offset:g}"


ALONG = (Placement(0.0, 0.0), Placement(0.0, 0.2), Placement(0.0, 0.55), Placement(0.0, 0.8))
INCLINED = (Placement(17.0, 0.3), Placement(35.0, 0.6))


def bar_frequency(scheme, cells, placement, conditions):
    """Return measured omega / exact omega - 1 of a bar that a plane holds.

    scheme is (transfer, degree, particles per cell and direction); cells over the length;
    conditions: the class.
    """
    transfer, degree, per = scheme
    dx, angle = bar.L / cells, radians(placement.angle)
    along, across = np.array([cos(angle), sin(angle)]), np.array([-sin(angle), cos(angle)])
    X = lattice([0.0, 0.0], [bar.L, WIDTH], dx / per)
    foot = placement.offset * dx * np.array([1.0, 0.37])
    matter = body(foot + X @ np.stack([along, across]), dx / per, bar.RHO, bar.LAW, transfer)
    plane = Collider(half_space(foot, along), "sticky")
    stepper = Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), conditions((plane,)))
    mode = bar.V * np.sin(bar.BETA * X[:, :1]) * along
    slope = bar.V * bar.BETA * np.cos(bar.BETA * X[:, 0])
    growth = slope[:, None, None] * np.outer(along, along)
    return vibrate(matter, stepper, (mode, growth), (bar.OMEGA, bar.SOUND))


def vibrate(matter, stepper, mode, waves):
    """Return measured omega / exact omega - 1 of a body that begins in a mode of vibration; -1 if
    it does not return, since nothing holds it.

    mode is its velocity v (N, d) and velocity gradient (N, d, d) at time 0, the undeformed state;
    waves: the exact omega [1/s], and the speed of the fastest waves [m/s].
    """
    (v, growth), (omega, sound) = mode, waves
    steps = ceil(PERIODS * 2.0 * pi / omega * sound / stepper.dx / CFL)
    dt = PERIODS * 2.0 * pi / omega / steps
    q, weight = matter.particles, matter.particles.m[:, None] * v
    q.v[:] = cos(0.5 * omega * dt) * v
    if q.C.ndim == 3:
        q.C[:] = cos(0.5 * omega * dt) * growth
    amplitude = np.empty(steps)
    stepper.start([matter])
    with threads_for([matter]):
        for k in range(steps):
            stepper.step([matter], k * dt, dt)
            amplitude[k] = np.sum(weight * q.v) / np.sum(weight * v)
    return bar.frequency(amplitude, dt) / omega - 1.0 if amplitude.min() < 0.0 else -1.0


# the ring

INNER, OUTER = 0.75, 1.25
RING = FixedCorotated(*lame(100.0, 0.3))
AMPLITUDE = 1e-4                    # of the displacement [m]: the response is linear
CENTER = np.array([0.13, 0.29])     # of the ring, from a node [cells]
CORNER = np.array([0.3, 0.6])       # of the square of the manufactured solution, likewise


def bracket(k, r):
    """Return J_1(k r) Y_1(k a) - Y_1(k r) J_1(k a)."""
    return j1(k * r) * y1(k * INNER) - y1(k * r) * j1(k * INNER)


def bracket_slope(k, r):
    """Return its derivative by r."""
    return k * (jvp(1, k * r) * y1(k * INNER) - yvp(1, k * r) * j1(k * INNER))


def polar_lattice(spacing):
    """Return points (N, 2) [m] on circles that fill the ring, and their areas (N,)."""
    points, areas = [], []
    edges = np.linspace(INNER, OUTER, round((OUTER - INNER) / spacing) + 1)
    for turn, (low, high) in enumerate(pairwise(edges)):
        r = 0.5 * (low + high)
        n = round(2.0 * pi * r / spacing)
        theta = (np.arange(n) + 0.5 * (turn % 2)) * 2.0 * pi / n
        points.append(r * np.stack([np.cos(theta), np.sin(theta)], axis=1))
        areas.append(np.full(n, pi * (high**2 - low**2) / n))
    return np.concatenate(points), np.concatenate(areas)


def ring_frequency(scheme, cells, conditions):
    """Return measured omega / exact omega - 1 of a ring between two cylinders; cells per metre."""
    transfer, degree, per = scheme
    dx, k = 1.0 / cells, brentq(bracket, 5.0, 7.5, args=(OUTER,))
    omega, center = k * sqrt(RING.mu), CENTER * dx
    X, V0 = polar_lattice(dx / per)
    q = particles_at(center + X, np.zeros_like(X), V0, V0, transfer)
    ring = Body("ring", q, RING, NoFlow(), np.arange(len(X)))
    held = (Collider(sphere(center, INNER), "sticky"),
            Collider(sphere(center, OUTER), "sticky", inside=True))
    stepper = Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), conditions(held))
    return vibrate(ring, stepper, ring_mode(X, k, omega), (omega, sqrt(stiffness(RING))))


def ring_mode(X, k, omega):
    """Return the velocity (N, 2) and the velocity gradient (N, 2, 2) of the ring's mode."""
    r = np.hypot(*X.T)
    radial = X / r[:, None]
    around = np.stack([-radial[:, 1], radial[:, 0]], axis=1)
    size = AMPLITUDE * omega / np.abs(bracket(k, np.linspace(INNER, OUTER, 101))).max()
    v, slope = size * bracket(k, r), size * bracket_slope(k, r)
    growth = np.einsum("p,pi,pj->pij", slope, around, radial)
    growth -= np.einsum("p,pi,pj->pij", v / r, radial, around)
    return v[:, None] * around, growth


# a square that moves between walls as a manufactured solution says

class Shifted(mms.AxisAligned):
    """The motion of a square whose corner is at a point `corner` (2,) [m]."""

    def __init__(self, X, corner):
        super().__init__(X, mms.LAW, mms.RHO0, mms.A, mms.C)
        self.corner = corner

    def position(self, t):
        """Return x (N, 2) [m]."""
        return self.corner + super().position(t)


def mms_error(scheme, cells, conditions):
    """Return the error of `verification.mms` between four slip walls that lie between nodes.

    Along a wall the solution moves tangentially and is not sheared, as a slip wall has it.
    """
    transfer, degree, per = scheme
    dx = 1.0 / cells
    X, corner = lattice([0.0, 0.0], [1.0, 1.0], dx / per), CORNER * dx
    square = body(X, dx / per, mms.RHO0, mms.LAW, transfer)
    sides = [(corner, n) for n in np.eye(2)] + [(corner + 1.0, -n) for n in np.eye(2)]
    walls = tuple(Collider(half_space(point, normal), "slip") for point, normal in sides)
    stepper = Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), conditions(walls))
    dt = mms.CFL * dx / mms.SOUND
    return follow(square, Shifted(X, corner), stepper, 2.0 / mms.C, dt) / mms.A


# the experiment

@experiment("verification.surface", title="Walls at their surface: bar, ring, cantilever, incline",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 400})
def surface(run):
    """Record orders and depths of walls with conditions at nodes and at surfaces."""
    schemes = run.choose(quick=(("mls", 2, 2),),
                         standard=(("mls", 2, 2), ("apic", 2, 2), ("mls", 3, 2), ("flip", 2, 2)))
    record_bars(run, schemes)
    record_rings(run, schemes)
    record_cantilever(run, schemes[:2])
    record_mms(run)
    record_incline(run)


def record_bars(run, schemes):
    """Record the largest depth of a wall, on and between nodes and at angles to the grid."""
    cells, rows = run.choose(quick=(16, 32), standard=(16, 32, 64)), []
    for scheme in run.progress(schemes, "bars"):
        for kind, conditions in BOUNDARIES.items():
            for label, places in (("along", ALONG), ("inclined", INCLINED)):
                depths = [[-n * bar_frequency(scheme, n, place, conditions) for n in cells]
                          for place in places]
                rows += [(*scheme, kind, str(place), n, depth) for place, row in
                         zip(places, depths, strict=True)
                         for n, depth in zip(cells, row, strict=True)]
                record_depth(run, f"bar.{label}.{kind}.{name(scheme)}", depths,
                             f"{cells} cells over the length")
    run.table("bars", ("transfer", "degree", "per_direction", "boundary", "angle-offset", "cells",
                       "depth"), rows)


def record_depth(run, name, depths, scale):
    """Record the largest depth on the finest grid, with a bound where the surface is meant."""
    rule = {"paper": 0.0, "comparator": "<=", "bound": 0.05} if ".surface." in name else {
        "comparator": "info"}
    run.record(f"verification.surface.{name}.depth", max(abs(row[-1]) for row in depths), unit="dx",
               scale=scale, **rule,
               note="how far behind its surface the wall acts, the largest over the placements of "
                    "the table; bound: a twentieth of a cell")


def record_rings(run, schemes):
    """Record the order of the frequency between curved walls."""
    cells, rows = run.choose(quick=(16, 32), standard=(16, 32, 64)), []
    for scheme in run.progress(schemes, "rings"):
        for kind, conditions in BOUNDARIES.items():
            errors = [ring_frequency(scheme, n, conditions) for n in cells]
            rows += [(*scheme, kind, n, e) for n, e in zip(cells, errors, strict=True)]
            rule = ORDER if kind == "surface" else {"comparator": "info"}
            run.record(f"verification.surface.ring.{kind}.{name(scheme)}.order",
                       order([1.0 / n for n in cells], [abs(e) for e in errors]), **rule,
                       scale=f"{cells} cells per metre; the ring is half a metre wide")
    run.table("rings", ("transfer", "degree", "per_direction", "boundary", "cells", "error"), rows)


def record_cantilever(run, schemes):
    """Record the order of the deflection of a beam clamped at the surface of a wall."""
    cells, rows = run.choose(quick=(4, 8), standard=(4, 8, 16)), []
    wall = Collider(half_space((0.0, 0.0), (1.0, 0.0)), "sticky")
    clamped = Support(0, SurfaceConditions((wall,)))
    for scheme in run.progress(schemes, "cantilevers"):
        errors = [small_error(scheme, n, clamped) for n in cells]
        rows += [(*scheme, n, e) for n, e in zip(cells, errors, strict=True)]
        run.record(f"verification.surface.cantilever.{name(scheme)}.order",
                   order([1.0 / n for n in cells], [abs(e) for e in errors]), **ORDER,
                   scale=f"{cells} cells over the height, small load")
    run.table("cantilever", ("transfer", "degree", "per_direction", "cells", "error"), rows)


def record_mms(run):
    """Record the order of the manufactured solution between walls."""
    cells, rows = run.choose(quick=(16, 64), standard=mms.CELLS), []
    for scheme in run.progress(run.choose(quick=mms.SECOND_ORDER[1:], standard=mms.SECOND_ORDER),
                               "manufactured solutions"):
        for kind, conditions in BOUNDARIES.items():
            errors = [mms_error(scheme, n, conditions) for n in cells]
            rows += [(*scheme, kind, n, e) for n, e in zip(cells, errors, strict=True)]
            rule = ORDER if kind == "surface" else {"comparator": "info"}
            run.record(f"verification.surface.mms.{kind}.{name(scheme)}.order",
                       order([1.0 / n for n in cells], errors), **rule,
                       scale=f"{cells} cells per side, walls {CORNER} cells from nodes")
    run.table("mms", ("transfer", "degree", "per_direction", "boundary", "cells", "error"), rows)


def record_incline(run):
    """Record the way of a block down a plane along the grid and an inclined one."""
    dx, factor = run.choose(quick=0.05, standard=0.025), run.choose(quick=1.0, standard=32.0)
    for kind in run.choose(quick=("surface",), standard=tuple(BOUNDARIES)):
        errors = []
        for tilted in (False, True):
            slope = Slope(THETA, SLIDING, tilted, kind)
            s = slide(slope, factor * STIFFNESS, dx)
            errors.append(s.x[-1] / distance_travelled(0.0, slope.acceleration, s.t, s.dt)[-1]
                          - 1.0)
        scale = f"{s.particles} particles, dx = {dx} m, E = {factor * STIFFNESS:g} Pa"
        chosen = kind == "surface"
        run.record(f"verification.surface.incline.{kind}.tilt", abs(errors[1] - errors[0]),
                   comparator="<=" if chosen else "info", **({"bound": 1e-3} if chosen else {}),
                   scale=scale,
                   note="difference of the ways down both planes after 1 s from rest, relative")
        if run.profile == "standard":
            run.record(f"verification.surface.incline.{kind}.way", max(errors, key=abs), paper=0.0,
                       comparator="band" if chosen else "info",
                       **({"bound": (-2e-3, 2e-3)} if chosen else {}), scale=scale,
                       note="relative to a rigid block, without extrapolation in E; the larger "
                            "error of both planes")
