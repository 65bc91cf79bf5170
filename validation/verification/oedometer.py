"""Oedometer: matter that cannot widen is compressed along x; each law against its closed form.

With F = diag(s, 1) a law gives, along and across,

    fixed corotated    P = (lam + 2 mu)(s - 1),             tau_yy = lam s (s - 1)
    Hencky             P = (lam + 2 mu) log(s)/s,           tau_yy = lam log s
    neo-Hookean, log   P = mu (s - 1/s) + lam log(s)/s,     tau_yy = lam log s

*Load*: a column from -H to H is pressed together by the force P(s = 3/4) on either end, spread over
the outer quarter of each half. In its middle the stretch must be 3/4, and the stress across tau_yy.
No wall takes part.

*Platen*: a column from a sticky floor at x = 0 to a collider that moves from x = H to s H. The
force on it, from the impulses that the grid's conditions report, is compared with P(s).
"""

from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.solids import half_space
from mpm_ref.materials import FixedCorotated, Hencky, LogNeoHookean, lame, stiffness

from ..common.registry import experiment
from .convergence import order
from .lattice import strip, strip_stepper
from .mms import name
from .settle import Pace, settle

H, RHO0, STRETCH, SCHEME = 1.0, 1000.0, 0.75, ("mls", 2, 2)
MODULI = lame(1e6, 0.3)
LAWS = {"log-neo-hookean": LogNeoHookean(*MODULI), "fixed-corotated": FixedCorotated(*MODULI),
        "hencky": Hencky(*MODULI)}
CFL = 0.3           # of sound at rest: compressed matter is up to twice as stiff


def closed_form(law, s):
    """Return P and tau_yy [Pa] at the stretch s."""
    mu, lam = law
    if isinstance(law, FixedCorotated):
        return (lam + 2.0 * mu) * (s - 1.0), lam * s * (s - 1.0)
    if isinstance(law, Hencky):
        return (lam + 2.0 * mu) * log(s) / s, lam * log(s)
    return mu * (s - 1.0 / s) + lam * log(s) / s, lam * log(s)


class Pressed(NamedTuple):
    """The middle of a column under load, relative to the closed form."""

    stretch: float      # s / (3/4) - 1
    lateral: float      # tau_yy / exact - 1


def press(law, cells):
    """Return the result under load with a number of cells over H: means over the middle half."""
    dx, sound = H / cells, sqrt(stiffness(law) / RHO0)
    column, X = strip(-H, H, dx, RHO0, law, SCHEME)
    P, tau_yy = closed_form(law, STRETCH)
    load = np.zeros((len(X), 2))
    load[:, 0] = np.where(np.abs(X) > 0.75 * H, np.sign(X) * P / (0.25 * H * RHO0), 0.0)
    settle(column, strip_stepper(dx, SCHEME), load, Pace(0.5 * pi * sound / H, CFL * dx / sound))
    q, middle = column.particles, np.abs(X) < 0.5 * H
    return Pressed(float(q.F[middle, 0, 0].mean()) / STRETCH - 1.0,
                   float(q.tau[middle, 1, 1].mean()) / tau_yy - 1.0)


class Metered:
    """Conditions that measure the forces on the matter in the last step [N/m of width]."""

    moves = True

    def __init__(self, conditions, width):
        self.conditions, self.width, self.forces = conditions, width, None

    def apply(self, grid, t, dt):
        """Apply the conditions. Each row of nodes along the strip is a copy of the others."""
        impulses = self.conditions.apply(grid, t, dt)
        self.forces = impulses / (dt * grid.m.shape[1] * self.width)


def platen_force(law, cells):
    """Return the force on the platen relative to P, less 1."""
    dx, sound = H / cells, sqrt(stiffness(law) / RHO0)
    lowest = pi * sound / H
    time = 20.0 / lowest
    column, X = strip(0.0, H, dx, RHO0, law, SCHEME)
    down = Motion(translation=Steady(((STRETCH - 1.0) * H / time, 0.0), 0.0, time))
    floor = Collider(half_space((0.0, 0.0), (1.0, 0.0)))
    platen = Collider(half_space((H, 0.0), (-1.0, 0.0)), motion=down)
    metered = Metered(Conditions(colliders=(floor, platen)), dx)
    settle(column, strip_stepper(dx, SCHEME, metered), np.zeros((len(X), 2)),
           Pace(lowest, CFL * dx / sound, waits=40.0))
    return float(metered.forces[1, 0]) / closed_form(law, STRETCH)[0] - 1.0


@experiment("verification.oedometer", title="Compression without widening, against closed forms",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 15})
def oedometer(run):
    """Record the laws under load, and the error of a platen."""
    cells = run.choose(quick=16, standard=64)
    laws = run.choose(quick=[*LAWS][:2], standard=[*LAWS])
    for key in run.progress(laws, "laws"):
        result = press(LAWS[key], cells)
        for quantity in ("stretch", "lateral"):
            run.record(f"verification.oedometer.load.{key}.{quantity}", getattr(result, quantity),
                       paper=0.0, comparator="band", bound=(-2e-3, 2e-3),
                       scale=f"{cells} cells over H, {name(SCHEME)}, s = {STRETCH}",
                       note="relative error; bound 1 / (2 cells of quick)^2: second order")
    record_platen(run)


def record_platen(run):
    """Record the error of the force on a platen."""
    cells, law = run.choose(quick=(8, 16, 32), standard=(16, 32, 64, 128)), LAWS["log-neo-hookean"]
    errors = [platen_force(law, n) for n in run.progress(cells, "platen")]
    run.table("platen", ("cells", "force_error"), list(zip(cells, errors, strict=True)))
    scale = f"{cells[-1]} cells over H, {name(SCHEME)}, s = {STRETCH}"
    run.record("verification.oedometer.platen.force", abs(errors[-1]), paper=0.0, comparator="<=",
               bound=0.05, scale=scale,
               note="bound: what an engineer would accept. A wall acts a fixed part of a cell too "
                    "deep (see verification.bar), and one that moves overtakes the layer of "
                    "particles next to it: both errors are of first order in dx")
    run.record("verification.oedometer.platen.order",
               order([1.0 / n for n in cells], np.abs(errors)), comparator="info",
               scale=f"{cells} cells over H", note="tends to 1 from below")
