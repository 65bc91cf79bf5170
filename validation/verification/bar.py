"""Axial vibration of an elastic bar that is held at x = 0 and free at x = L.

    v(x, t) = V cos(omega t) sin(beta X),     beta = pi / (2 L),    omega = beta sqrt(E / rho)

L = 25 m, E = 100 Pa, rho = 1 kg/m^3, V = 0.1 m/s. With nu = 0 the fixed corotated law is linear in
this motion, P = E (F - 1), so the solution is exact at any amplitude.

The bar is held in two ways: by a sticky wall, and without any wall as one half of a bar from -L to
L that moves symmetrically. The second shows the order of the method, the first that of the wall.
"""

from math import ceil, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import FixedCorotated, lame

from ..common.registry import experiment
from ..common.scenes import threads_for
from .convergence import order, rms
from .lattice import ON_WALL, strip, strip_stepper
from .mms import name

L, E, RHO, V = 25.0, 100.0, 1.0, 0.1
LAW = FixedCorotated(*lame(E, 0.0))
SOUND, BETA = sqrt(E / RHO), pi / (2.0 * L)
OMEGA = BETA * SOUND
PERIODS, CFL = 4, 0.4


class Vibration(NamedTuple):
    """The errors and the amplitude of a run."""

    error: float        # largest RMS error of the displacement, relative to its amplitude V/omega
    frequency: float    # measured omega / exact omega - 1
    final: float        # largest velocity amplitude in the last period / V
    t: np.ndarray       # (S,)  [s]
    amplitude: np.ndarray       # (S,)  of the velocity, its projection on the mode / V


def put_in_motion(q, X, dt):
    """Set the velocities of time -dt/2 at the undeformed state; see `manufactured.put_on`."""
    speed = V * cos(0.5 * OMEGA * dt)
    q.v[:, 0] = speed * np.sin(BETA * X)
    if q.C.ndim == 3:
        q.C[:, 0, 0] = speed * BETA * np.cos(BETA * X)


def vibrate(scheme, cells, wall):
    """Return the `Vibration` of a bar with a number of cells over the length L."""
    dx = L / cells
    bar, X = strip(0.0 if wall else -L, L, dx, RHO, LAW, scheme)
    steps = ceil(PERIODS * 2.0 * pi / OMEGA * SOUND / dx / CFL)
    dt = PERIODS * 2.0 * pi / OMEGA / steps
    advance = strip_stepper(dx, scheme, ON_WALL if wall else None)
    advance.start([bar])
    put_in_motion(bar.particles, X, dt)
    shape, x0 = np.sin(BETA * X), bar.particles.x.copy()
    worst, amplitude = 0.0, np.empty(steps)
    with threads_for([bar]):
        for k in range(steps):
            advance.step([bar], k * dt, dt)
            amplitude[k] = bar.particles.v[:, 0] @ shape / (shape @ shape) / V
            u = V / OMEGA * sin(OMEGA * (k + 1) * dt) * shape
            worst = max(worst, rms((bar.particles.x - x0)[:, :1] - u[:, None]))
    last = np.abs(amplitude[-steps // PERIODS :]).max()
    t = (np.arange(steps) + 0.5) * dt
    return Vibration(worst * OMEGA / V, frequency(amplitude, dt) / OMEGA - 1.0, last, t, amplitude)


def frequency(amplitude, dt):
    """Return the frequency of a cosine sampled at dt/2, 3 dt/2, .., by its last zero.

    The zero is interpolated linearly.
    """
    k = np.flatnonzero(amplitude[:-1] * amplitude[1:] < 0.0)
    last = k[-1] + amplitude[k[-1]] / (amplitude[k[-1]] - amplitude[k[-1] + 1])
    return (len(k) - 0.5) * pi / ((last + 0.5) * dt)


@experiment("verification.bar", title="Axial vibration of a bar", profiles=("quick", "standard"),
            budget={"quick": 15, "standard": 60})
def bar(run):
    """Record orders of displacement and frequency with and without a wall; the loss of PIC."""
    cells = run.choose(quick=(8, 16, 32), standard=(8, 16, 32, 64, 128))
    schemes = run.choose(quick=(("mls", 2, 2),), standard=(
        ("mls", 2, 2), ("mls", 3, 2), ("apic", 2, 2), ("flip", 2, 2), ("pic", 2, 2)))
    rows = []
    for scheme in run.progress(schemes, "schemes"):
        for wall in (False, True):
            results = [vibrate(scheme, n, wall) for n in cells]
            rows += [(*scheme, wall, n, *r[:3]) for n, r in zip(cells, results, strict=True)]
            if scheme == schemes[0]:
                record_history(run, wall, results[0])
            record_orders(run, scheme, wall, cells, results)
    run.table("errors", ("transfer", "degree", "per_direction", "wall", "cells", "error",
                         "frequency_error", "amplitude_kept"), rows)


def record_history(run, wall, result):
    """Write the amplitude of the coarsest bar over time, beside cos(omega t)."""
    rows = zip(result.t, result.amplitude, np.cos(OMEGA * result.t), strict=True)
    run.table("history-wall" if wall else "history-symmetric", ("t", "ours", "exact"), list(rows))


def record_orders(run, scheme, wall, cells, results):
    """Record the orders of a scheme, or for PIC its loss."""
    support = "wall" if wall else "symmetric"
    id, sizes = f"verification.bar.{support}.{name(scheme)}", [L / n for n in cells]
    scale = f"{cells} cells over the length, {PERIODS} periods"
    if scheme[0] == "pic":
        run.record(f"{id}.kept", results[-1].final, comparator="<=", bound=0.95, scale=scale,
                   note="negative control: PIC damps; amplitude in the last period")
        return
    p = order(sizes, [r.error for r in results])
    if not wall:
        run.record(f"{id}.order", p, paper=2.0, comparator="band", bound=(1.8, 2.3), scale=scale)
        run.record(f"{id}.kept", results[-1].final, paper=1.0, comparator="band",
                   bound=(0.99, 1.01), scale=scale)
    else:
        run.record(f"{id}.order", p, paper=1.0, comparator="band", bound=(0.8, 1.3), scale=scale,
                   note="splines of free nodes do not vanish at the wall, so that matter there is "
                        "softer: the wall acts a fixed part of a cell too deep")
        run.record(f"{id}.depth", -results[-1].frequency * cells[-1], unit="dx",
                   comparator="info", scale=scale,
                   note="how far behind its zero contour the wall acts: by the frequency of a bar "
                        "that is longer by so much")
    run.record(f"{id}.frequency", results[-1].frequency, paper=0.0, comparator="info", scale=scale)
