"""Deflection of a cantilever, small against Timoshenko's beam and large against the elastica.

The beam lies along x, gripped by sticky walls: its matter goes on for two cells behind x = 0, and
all nodes at x <= 0 rest (`GRIPPED`). It is h = 1 m high and loaded by the force P, down, spread
over the last half metre; the deflection is that of the middle of this part, at a = L - h/4. The
load does not turn. The beam comes to rest by damping (see `settle`).

With nu = 0 a clamped end restrains no contraction, and the fixed corotated law is linear in Biot's
strain, hence bends linearly, M = EI phi', up to any curvature: beam theory is all but exact.

*small*: L = 8 h; P would bend an ideal beam by L/500; shear factor 5/6 [Timoshenko1921].
*large*: L = 10 h; P a^2/EI = 2: the end sinks by half the length [Bisshopp1945].

The exact beam under a dead load is a boundary value problem in the arc length S. A section turns by
phi and carries the moment M. With the load (0, -P) at S = a, its parts N along and Q across a
section, and the stiffnesses EI, EA, GA (shear, with its factor),

    phi' = M/EI,   M' = P x',   x' = (1 + N/EA) cos phi - Q/GA sin phi,   N = -P sin phi
                                y' = (1 + N/EA) sin phi + Q/GA cos phi,   Q = -P cos phi

phi = x = y = 0 at S = 0 and M = 0 at S = a. With EA = GA = inf this is the elastica of
[Bisshopp1945]; for a small P its end sinks by P a^3/(3 EI) + P a/GA [Timoshenko1921].
"""

from math import hypot, inf, sqrt
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_bvp

from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, lame, stiffness

from ..common.registry import experiment
from .convergence import extrapolated
from .lattice import body, lattice
from .mms import name
from .settle import Pace, settle

E, RHO0 = 1e6, 1000.0
LAW = FixedCorotated(*lame(E, 0.0))
EI, EA, GA = E / 12.0, E, 5.0 / 6.0 * LAW.mu        # of a section 1 m x 1 m [N m^2], [N], [N]
SOUND = sqrt(stiffness(LAW) / RHO0)
CFL = 0.5
FIRST = 1.8751      # first root of cos b cosh b = -1: omega = b^2 sqrt(EI/(rho h))/L^2


class Support(NamedTuple):
    """The clamp of a beam at x = 0."""

    grip: int               # cells of the beam behind the wall
    conditions: object      # see `core.boundary`


GRIPPED = Support(2, Conditions(walls=BoxWalls((1, None), (None, None), "sticky")))


class Beam(NamedTuple):
    """A beam and its load."""

    length: float       # L [m]
    bend: float         # P a^2 / EI

    @property
    def arm(self):
        """Return the place a where the load acts [m]."""
        return self.length - 0.25

    @property
    def load(self):
        """Return the load P [N]."""
        return self.bend * EI / self.arm**2


SMALL, LARGE = Beam(length=8.0, bend=3.0 / 500.0), Beam(length=10.0, bend=2.0)


def deflected(load, length, EI, EA=inf, GA=inf):
    """Return the places (K, 2) [m] of sections from the clamped end to the loaded one.

    load [N], length a [m], EI [N m^2], EA and GA [N].

    Raises ArithmeticError if the solver does not converge.
    """

    def slopes(S, state):
        phi, M, _, _ = state
        c, s = np.cos(phi), np.sin(phi)
        along, across = 1.0 - load * s / EA, -load * c / GA
        dx, dy = along * c - across * s, along * s + across * c
        return np.stack([M / EI, load * dx, dx, dy])

    def ends(clamped, free):
        return np.array([clamped[0], clamped[2] / length, clamped[3] / length,
                         free[1] * length / EI])

    S = np.linspace(0.0, length, 41)
    straight = np.stack([0.0 * S, load * (S - length), S, 0.0 * S])
    solution = solve_bvp(slopes, ends, S, straight, tol=1e-8, max_nodes=20000)
    if not solution.success:
        raise ArithmeticError(f"the elastica under {load} N did not converge: {solution.message}")
    return solution.y[2:].T


def timoshenko(load, length, EI, GA):
    """Return the deflection of the loaded end under a small load [m]."""
    return load * length**3 / (3.0 * EI) + load * length / GA


def bent(beam, scheme, cells, pace, support=GRIPPED):
    """Return the particles (N, 2) and the displacement (u, v) of the loaded end [m] at rest.

    scheme is (transfer, degree, particles per cell and direction); cells: number of cells over h;
    pace: (waits, ramp) of `settle`.
    """
    transfer, degree, per = scheme
    dx = 1.0 / cells
    X = lattice([-support.grip * dx, -0.5], [beam.length, 0.5], dx / per)
    matter = body(X, dx / per, RHO0, LAW, transfer)
    load = np.zeros_like(X)
    load[X[:, 0] > beam.length - 0.5, 1] = -beam.load / (0.5 * RHO0)
    lowest = FIRST**2 * sqrt(EI / RHO0) / beam.length**2
    stepper = Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), support.conditions)
    settle(matter, stepper, load, Pace(lowest, CFL * dx / SOUND, *pace))
    at_load = np.abs(X[:, 0] - beam.arm) < 0.5 * dx
    return matter.particles.x, (matter.particles.x - X)[at_load].mean(axis=0)


def small_error(scheme, cells, support=GRIPPED):
    """Return the error of the deflection relative to Timoshenko's."""
    _, (_, v) = bent(SMALL, scheme, cells, (12.0, 0.0), support)
    return float(-v / timoshenko(SMALL.load, SMALL.arm, EI, GA) - 1.0)


def large_error(scheme, cells):
    """Return the particles, and the distance of the loaded end from the elastica's.

    The distance is relative to the deflection.
    """
    places, (u, v) = bent(LARGE, scheme, cells, (8.0, 2.0))
    x, y = elastica()[-1]
    return places, hypot(LARGE.arm + u - x, v - y) / abs(y)


def elastica():
    """Return the places (K, 2) of the large deflection's sections, from wall to load [m]."""
    return deflected(LARGE.load, LARGE.arm, EI, EA, GA)


@experiment("verification.cantilever", title="Cantilever: Timoshenko's beam and the elastica",
            profiles=("quick", "standard"), budget={"quick": 14, "standard": 150})
def cantilever(run):
    """Record the deflections under a small and a large load."""
    record_small(run)
    record_large(run)


def record_small(run):
    """Record the errors under a small load: they must vanish with dx."""
    scheme, cells = ("mls", 2, 2), run.choose(quick=(4, 8), standard=(4, 8, 16))
    errors = [small_error(scheme, n) for n in run.progress(cells, "small")]
    run.table("small", ("cells", "error"), list(zip(cells, errors, strict=True)))
    scale = f"{cells} cells over the height, {name(scheme)}"
    run.record("verification.cantilever.small.finest", errors[-1], paper=0.0, comparator="band",
               bound=(-0.2 / cells[-1], 0.2 / cells[-1]), scale=scale,
               note="relative; bound 0.2 dx/h: the wall acts up to 0.4 dx too deep (see "
                    "verification.bar), which lengthens the beam and counts three times")
    run.record("verification.cantilever.small.extrapolated",
               extrapolated([1.0 / n for n in cells], errors, 1), paper=0.0, comparator="band",
               bound=(-0.01, 0.01), scale=scale,
               note="to dx = 0, with the wall's first order; bound: half of what shear contributes")


QUICK = (("apic", 3, 2),)
STANDARD = (*QUICK, ("mls", 2, 2), ("apic", 2, 2), ("apic", 2, 3), ("mls", 2, 3), ("mls", 2, 4),
            ("mls", 3, 3))


def record_large(run):
    """Record the errors under a large load, schemes side by side."""
    cells, rows = run.choose(quick=(4,), standard=(4, 8)), []
    for scheme in run.progress(run.choose(quick=QUICK, standard=STANDARD), "large"):
        results = [large_error(scheme, n) for n in cells]
        rows += [(*scheme, n, error) for n, (_, error) in zip(cells, results, strict=True)]
        if scheme == QUICK[0]:
            run.table("places", ("x", "y"), results[0][0].tolist())
        run.record(f"verification.cantilever.large.{name(scheme)}", rows[-1][-1], paper=0.0,
                   comparator="<=", bound=0.2 / cells[-1],
                   scale=f"{cells[-1]} cells over the height",
                   note="bound 0.2 dx/h as for a small load. What MLS has more falls with the "
                        "number of particles per cell (see the table): it is error of their sums, "
                        "after they moved across cells")
    run.table("elastica", ("x", "y"), elastica().tolist())
    run.table("large", ("transfer", "degree", "per_direction", "cells", "error"), rows)
