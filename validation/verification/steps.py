"""Errors against the number of steps, with the filter of the transfer acting per step or per time.

The same motions are run with dt from 0.8 to 0.02 of dx/c: the manufactured solution of `mms` and
the free bar of `bar`, which is compared with the same bar that symplectic Euler steps with the same
dt but exact derivatives in space, so that its error is that of grid and transfer alone. Relaxation
(see `explicit.Scheme`) was chosen on the bar and on the `impact` of a bar on a wall; the
manufactured solution, the column of `sand_column` and the bodies of `rotation` judge it.
"""

from math import asin, ceil, cos, pi, sin
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme, Stepper

from ..common.registry import experiment
from ..common.scenes import threads_for
from .bar import BETA, LAW, OMEGA, PERIODS, RHO, SOUND, L, V, put_in_motion
from .convergence import rms
from .lattice import ON_WALL, Periodic, fitted, strip
from .mms import MmsRun, error
from .mode_decay import CELLS, expected_rate, measured_rate
from .rotation import ROUND_OFF, cube, disk, loss_per_step, spin_history
from .sand_column import STEADY, SandColumn, collapse

CFL = (0.8, 0.4, 0.1, 0.02)         # of the speed of sound at rest
CROSSINGS = 1.0                     # relaxation in times dx/c
AIM = 1.2                           # largest error over smallest, over these steps
FACTOR = 2.0                        # of which the transfers without relaxation exceed it at least
RATE = 1e-4                         # of the decay: round-off, and what is left of the stress
BEHIND = 4                          # cells behind the front in which its width does not count


class TransferChoice(NamedTuple):
    """A transfer of quadratic or cubic splines, with or without relaxation."""

    transfer: str
    crossings: float = 0.0          # relaxation in times dx/c
    degree: int = 2

    @property
    def name(self):
        """Return the name of the choice in records, such as mls-relaxed."""
        return self.transfer + "-relaxed" * (self.crossings > 0.0) + "-cubic" * (self.degree == 3)

    def scheme(self, crossing):
        """Return the `explicit.Scheme`, for a time dx/c [s]."""
        return Scheme(self.degree, self.transfer, relaxation=self.crossings * crossing)


MLS, APIC = TransferChoice("mls"), TransferChoice("apic")
RELAXED = tuple(one._replace(crossings=CROSSINGS) for one in (MLS, APIC))
CUBIC = tuple(one._replace(degree=3) for one in (MLS, RELAXED[0], APIC, RELAXED[1]))
OTHERS = (TransferChoice("flip"), TransferChoice("pic"))
ALL = (MLS, RELAXED[0], APIC, RELAXED[1], *OTHERS, *CUBIC)


@experiment("verification.steps", title="Errors against the number of steps",
            profiles=("quick", "standard"), budget={"quick": 60, "standard": 600})
def steps(run):
    """Record how errors grow with the number of steps, why, and that relaxation stops it."""
    choices = run.choose(quick=(MLS, RELAXED[0]), standard=ALL)
    record_filter(run, choices)
    record_impacts(run)
    rows, cells = [], run.choose(quick=16, standard=32)
    for choice in run.progress(choices, "transfers"):
        rows += record_errors(run, choice, "mms", mms_errors(choice, cells))
        rows += record_errors(run, choice, "bar", bar_errors(choice, 16))
    run.table("errors", ("problem", "transfer", "cfl", "error"), rows)
    record_columns(run, choices, run.choose(quick=4, standard=8))
    record_spins(run, run.choose(quick=((disk, RELAXED[0]),), standard=tuple(
        (make, choice) for make in (disk, cube) for choice in RELAXED)))


def record_filter(run, choices):
    """Record the decay of a Fourier mode per step against the amplification of the transfer."""
    rows = []
    for choice in choices:
        scheme, worst = choice.scheme(1.0), 0.0
        for waves in (1, 2):
            theta = 2.0 * pi * waves / CELLS
            ours, formula = measured_rate(scheme, 2, waves, 10), expected_rate(scheme, 2, theta)
            worst = max(worst, abs(ours - formula) / max(formula, RATE))
            rows.append((choice.name, theta, ours, formula))
        run.record(f"verification.steps.filter.{choice.name}", worst, comparator="<=", bound=RATE,
                   scale=f"1 and 2 waves in {CELLS} cells, 2 x 2 particles per cell, 10 steps",
                   note="decay rate per step without stress, relative to that of `mode_decay`")
    run.table("filter", ("transfer", "theta", "rate", "formula"), rows)


def mms_errors(choice, cells):
    """Return the errors of the manufactured solution for the steps of `CFL`, relative to A; 3 x 3
    particles per cell with quadratic splines, 2 x 2 with cubic ones.
    """
    per = 3 if choice.degree == 2 else 2
    return [error(MmsRun(choice.transfer, choice.degree, per, cells, cfl=cfl,
                         crossings=choice.crossings)) for cfl in CFL]


def bar_errors(choice, cells):
    """Return the errors of the free bar for the steps of `CFL`, relative to its amplitude."""
    return [bar_error(choice, cells, cfl) for cfl in CFL]


def bar_error(choice, cells, cfl):
    """Return the largest RMS error of the displacement over `PERIODS` periods, relative to V/OMEGA,
    against the motion of symplectic Euler steps of the same length, exact in space.
    """
    dx = L / cells
    count = ceil(PERIODS * 2.0 * pi / OMEGA * SOUND / dx / cfl)
    dt = PERIODS * 2.0 * pi / OMEGA / count
    body, X, stepper = bar_between(-L, cells, choice)
    put_in_motion(body.particles, X, dt)
    shape, x0 = np.sin(BETA * X), body.particles.x[:, 0].copy()
    omega, size = euler_vibration(dt)
    worst = 0.0
    with threads_for([body]):
        for k in range(count):
            stepper.step([body], k * dt, dt)
            u = size * sin(omega * (k + 1) * dt) * shape
            worst = max(worst, rms((body.particles.x[:, 0] - x0 - u)[:, None]))
    return worst * OMEGA / V


def euler_vibration(dt):
    """Return the frequency [1/s] and the amplitude [m] of symplectic Euler steps of length dt [s]
    for u'' = -OMEGA^2 u with u = 0 at t = 0 and u' = V cos(OMEGA dt/2) at t = -dt/2.
    """
    omega = 2.0 / dt * asin(0.5 * OMEGA * dt)
    return omega, V / OMEGA * cos(0.5 * OMEGA * dt) / cos(0.5 * omega * dt)


def bar_between(start, cells, choice, conditions=None):
    """Return a started bar from x = start to L, the places X (N,) of its particles, and its
    stepper; 2 x 2 particles per cell.
    """
    dx = L / cells
    scheme = choice.scheme(dx / SOUND)
    body, X = strip(start, L, dx, RHO, LAW, (choice.transfer, choice.degree, 2))
    body = fitted(body, scheme)
    stepper = Stepper(scheme, dx, 2, np.zeros(2), Periodic((0, 1), conditions))
    stepper.start([body])
    return body, X, stepper


def record_errors(run, choice, problem, errors):
    """Record the largest error over the smallest; returns the rows of the table."""
    id, ratio = f"verification.steps.{problem}.{choice.name}.ratio", max(errors) / min(errors)
    scale = f"dt from {CFL[0]} to {CFL[-1]} dx/c; errors {', '.join(f'{e:.2e}' for e in errors)}"
    if choice.crossings:
        run.record(id, ratio, comparator="<=", bound=AIM, scale=scale,
                   note="the filter acts per time: errors do not depend on the number of steps")
    elif choice == MLS and problem == "mms":
        run.record(id, ratio, comparator=">=", bound=FACTOR, scale=scale,
                   note="negative control: without relaxation the filter acts in each step")
    else:
        run.record(id, ratio, comparator="info", scale=scale)
    return [(problem, choice.name, cfl, e) for cfl, e in zip(CFL, errors, strict=True)]


def record_impacts(run):
    """Record what a bar that hits a wall shows of noise, for the choice of the relaxation."""
    crossings = run.choose(quick=(0.0, 1.0), standard=(0.0, 0.5, 1.0, 2.0, 5.0, 20.0))
    choices = [*(TransferChoice("mls", number) for number in crossings), TransferChoice("flip")]
    rows = [(choice.transfer, choice.crossings, cfl, *impact(choice, 50, cfl))
            for choice in choices for cfl in (0.4, 0.05)]
    run.table("impact", ("transfer", "crossings", "cfl", "error", "noise", "overshoot"), rows)
    for transfer, number, cfl, _, noise, _ in rows:
        if cfl == 0.05 and number in (0.0, CROSSINGS):
            name = TransferChoice(transfer, number).name
            run.record(f"verification.steps.impact.{name}.noise", noise, comparator="info",
                       scale=f"a bar of 50 cells hits a wall, dt = {cfl} dx/c",
                       note="RMS velocity where the bar should rest, relative to its speed before")


def impact(choice, cells, cfl):
    """Return three numbers of a bar that hit a sticky wall with speed V, when half of it rests:
    mean error of the velocity, RMS velocity behind the front and largest velocity away from the
    wall, all relative to V.
    """
    body, X, stepper = bar_between(0.0, cells, choice, ON_WALL)
    body.particles.v[:, 0] = -V
    count = ceil(0.5 * cells / cfl)
    dt = 0.5 * L / SOUND / count
    for k in range(count):
        stepper.step([body], k * dt, dt)
    v, front = body.particles.v[:, 0] / V, 0.5 * L
    rests = X < front - BEHIND * L / cells
    exact = np.where(X < front, 0.0, -1.0)
    return np.abs(v - exact).mean(), rms(v[rests, None]), v.max()


def record_columns(run, choices, cells):
    """Record the change of a column's run-out from dt to dt/3, with the relaxed transfers."""
    rows = []
    for choice in run.progress([one for one in choices if one in RELAXED], "columns"):
        columns = [SandColumn(2, 1.0, cells, choice.transfer, cfl, crossings=choice.crossings)
                   for cfl in (0.9, 0.3)]
        long, short = (collapse(column) for column in columns)
        run.record(f"verification.steps.column.{choice.name}",
                   abs(short.runout / long.runout - 1.0), comparator="<=", bound=STEADY,
                   scale=f"plane, a = 1, L = {cells} dx; {long.steps} and {short.steps} steps",
                   note="change of the run-out; without relaxation: verification.column.dt")
        rows += [(choice.name, c.steps, c.runout) for c in (long, short)]
    run.table("column", ("transfer", "steps", "runout"), rows)


def record_spins(run, cases):
    """Record the loss of angular momentum of free bodies that spin once, with relaxation."""
    for make, choice in run.progress(cases, "spins"):
        h = spin_history(make(choice.transfer, 1), choice.crossings)
        run.record(f"verification.steps.rotation.{make.__name__}.{choice.name}",
                   loss_per_step(h.L), comparator="<=", bound=ROUND_OFF, paper=0.0,
                   scale=f"{len(h.t) - 1} steps, one revolution",
                   note="angular momentum lost per step; exact but for round-off")
