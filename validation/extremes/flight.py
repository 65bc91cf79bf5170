"""Free flight over many cells, and far from the origin: what rounding does."""

import numpy as np

from mpm_ref.energy import momentum
from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from ..verification.convergence import rms
from .blocks import alone, bounds, problem, shaken, square, steps
from .outcome import FINISHED, OUT_OF_RANGE, STOPS, outcome

DX = 0.125                          # a power of two: shifting by whole cells rounds nothing
WAY = 100                           # cells
VELOCITY = np.array([1.0, 0.37])    # [m/s]


@experiment("extremes.explicit.free_flight", title="Free flight over 100 cells",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def free_flight(run):
    """Momentum and position after 1e4 steps without force."""
    count = 10000
    cases = run.choose(quick=[("mls", "block"), ("apic", "one")],
                       standard=[(t, w) for t in ("mls", "apic", "flip", "pic")
                                 for w in ("one", "block")])
    for transfer, what in run.progress(cases, "flights"):
        drift, away, end = fly(transfer, what, count)
        name = f"extremes.explicit.free_flight.{transfer}.{what}"
        scale = f"{count} steps, {WAY} cells"
        run.record(f"{name}.momentum", drift if end.kind == FINISHED else np.inf, comparator="<=",
                   bound=1e-13, scale=scale, note="largest change of momentum over the momentum. "
                   "Calibrated: 1e-15 to 2e-14; 1e4 roundings that add up would be 1e-12")
        run.record(f"{name}.position", away, comparator="<=", bound=1e-12, scale=scale,
                   note="RMS distance to where the particles should be, over the way. Calibrated: "
                        "1.6e-13")


def fly(transfer, what, count):
    """(change of momentum, error of position over the way, `Outcome`) of a flight."""
    made = alone([0.3, 0.7], DX, transfer=transfer) if what == "one" else square(
        4, DX, transfer=transfer)
    q = made.particles
    q.v[:] = VELOCITY
    start, p0 = q.x.copy(), momentum((made,))
    dt = WAY * DX / VELOCITY[0] / count
    end = outcome(problem(made, DX, steps(count, dt), Scheme(2, transfer), allow_unstable=True))
    order = np.argsort(made.id)
    error = rms(q.x[order] - start - count * dt * VELOCITY)
    drift = np.max(np.abs(momentum((made,)) - p0)) / np.linalg.norm(p0)
    return float(drift), error / (WAY * DX), end


FAR = (0, 1, 4, 8, 12)              # powers of ten, in cells from the origin
BEYOND = 17                         # where a cell is smaller than the distance of two numbers


@experiment("extremes.explicit.far_from_origin", title="The same run far from the origin",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def far_from_origin(run):
    """A shaken block shifted by 10^k cells, against the one at the origin."""
    count = run.choose(quick=200, standard=2000)
    near, rows = shifted(0.0, count), []
    for k in FAR[1:]:
        far = shifted(10.0**k, count)
        error = rms(far - near) / rms(near)
        rows.append((10.0**k, error, float(np.finfo(float).eps * 10.0**k)))
        run.record(f"extremes.explicit.far_from_origin.1e{k}", error, comparator="<=",
                   bound=far_bound(k), scale=f"4 x 4 cells, {count} steps",
                   note="RMS change of the velocities over their RMS. A position keeps eps 10^k "
                        "cells; calibrated: 2.5 to 200 times that")
    run.table("error", ("cells", "error", "rounding"), rows)
    made = at(10.0**BEYOND)
    end = outcome(problem(made, DX, steps(10, 1e-3)))
    run.record("extremes.explicit.far_from_origin.beyond", int(end.kind in (*STOPS, OUT_OF_RANGE)),
               paper=1, comparator="=", scale=f"10^{BEYOND} cells from the origin",
               note=f"whether it is refused, with the sentence: {end.said}")


def far_bound(k):
    """Hundred times the rounding of a position at 10^k cells, in cells."""
    return 100.0 * np.finfo(float).eps * 10.0**k


def at(cells):
    """A shaken block that far from the origin, along both axes."""
    made = shaken(square(4, DX))
    made.particles.x[:] += cells * DX
    return made


def shifted(cells, count):
    """Velocities (N, d) of the block after some steps, in the order of sampling."""
    made = at(cells)
    dt = 0.5 * bounds(at(0.0), DX).dt
    end = outcome(problem(made, DX, steps(count, dt)))
    if end.kind != FINISHED:
        return np.full_like(made.particles.v, np.nan)
    return made.particles.v[np.argsort(made.id)]
