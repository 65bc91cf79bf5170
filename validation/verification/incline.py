"""A block on an incline with Coulomb friction: sliding, sticking, and sliding without friction.

A rigid block slides by x = g t^2 (sin theta - tan phi cos theta)/2 or sticks, if tan phi >= tan
theta. An elastic one obeys, at any time and however it shakes, the sum of its momentum equations
along and away from the plane: while all of its foot slides,

    v + tan phi w = v0 + g (sin theta - tan phi cos theta) t.

From rest its foot sticks until the shear stress has built up, in a time of the order of height /
wave speed; the way gained thereby falls with the square root of its stiffness.
"""

import numpy as np

from ..common.registry import experiment
from .block import HEIGHT, LENGTH, Slope, slide
from .symplectic import travelled

THETA, SLIDING, STICKING = 24.0, 15.0, 30.0     # degrees; the first two from a public code's test
V0 = 0.5                    # [m/s] at which the foot slides from the start
STIFFNESS = 1e6             # [Pa]
AGREED = 1e-3               # relative error that a public code's test of this problem allows
ROUND_OFF = 1e-11           # of v: rounding of some 1e3 steps, amplified by the block's shaking
PLANES = {"flat": False, "tilted": True}


@experiment("verification.incline", title="Block on an incline: friction, sticking, free slide",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 60})
def incline(run):
    """Gravity turned on a flat wall, and a truly tilted plane."""
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

    def slide(self, phi, E=STIFFNESS, **how):
        """The slope of friction angle phi and the slide on it."""
        slope = Slope(THETA, phi, self.tilted)
        return slope, slide(slope, E, self.dx, **how)

    def record(self, what, value, s, **rule):
        """Record a number of a slide."""
        scale = (f"{s.particles} particles, {round(s.t[-1] / s.dt)} steps, block {LENGTH} m x "
                 f"{HEIGHT} m, dx = {self.dx} m")
        self.run.record(f"verification.incline.{self.name}.{what}", float(value), scale=scale,
                        **rule)

    def rows(self, case, s, exact):
        """Rows for the table."""
        return [(self.name, case, t, x, e) for t, x, e in zip(s.t, s.x, exact, strict=True)]


def sliding(plane):
    """From rest, with two stiffnesses; the way extrapolated to a rigid block."""
    (slope, soft), (_, stiff) = plane.slide(SLIDING), plane.slide(SLIDING, 4.0 * STIFFNESS)
    ways = [travelled(0.0, slope.acceleration, s.t, s.dt) for s in (soft, stiff)]
    ahead = [s.x[-1] - way[-1] for s, way in zip((soft, stiff), ways, strict=True)]
    plane.record("way", (2.0 * ahead[1] - ahead[0]) / ways[1][-1], stiff, paper=0.0,
                 comparator="band", bound=(-AGREED, AGREED),
                 note="relative error of x after 1 s from rest, extrapolated to E = infinity from "
                 f"E and 4 E = {4.0 * STIFFNESS:g} Pa, with errors in 1/sqrt(E)")
    for s, way, error, E in zip((soft, stiff), ways, ahead, (1, 4), strict=True):
        plane.record(f"way_{E}E", error / way[-1], s, paper=0.0, comparator="info",
                     note="the same as it is, with the start during which the foot sticks")
    return plane.rows("sliding", stiff, ways[1])


def momentum_law(plane):
    """From a speed at which the foot slides at once: the momentum law above."""
    slope, s = plane.slide(SLIDING, v0=V0)
    exact = V0 + slope.acceleration * s.t
    error = np.abs(s.v + slope.friction * s.w - exact).max() / exact[-1]
    plane.record("momentum_law", error, s, paper=0.0, comparator="<=", bound=ROUND_OFF,
                 note="v + tan phi w against v0 + a t, largest error over 1 s, relative")
    return plane.rows("thrown", s, travelled(V0, slope.acceleration, s.t, s.dt))


def sticking(plane):
    """tan phi > tan theta: the block stays, from rest under all of gravity."""
    slope, s = plane.slide(STICKING, sudden=False)
    free = travelled(0.0, slope.pull, s.t[-1], s.dt)
    plane.record("sticking", abs(s.x[-1]) / free, s, paper=0.0, comparator="<=", bound=AGREED,
                 note="way after 1 s over that without friction")
    _, shaken = plane.slide(STICKING)
    plane.record("sticking_shaken", abs(shaken.x[-1]) / free, shaken, paper=0.0, comparator="info",
                 note="the same if the pull comes suddenly: the shear stress of the elastic block "
                 "then overshoots what friction holds, and nothing but friction damps its shaking")
    return plane.rows("sticking", s, np.zeros_like(s.t))


def frictionless(plane):
    """No friction: the exact sum of symplectic Euler's steps."""
    slope, s = plane.slide(0.0)
    exact = travelled(0.0, slope.pull, s.t, s.dt)
    plane.record("frictionless", abs(s.x[-1] / exact[-1] - 1.0), s, paper=0.0, comparator="<=",
                 bound=ROUND_OFF, note="against g sin(theta) t (t + dt)/2, the sum of the steps")
    return plane.rows("frictionless", s, exact)
