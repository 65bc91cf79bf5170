"""The stable time step: a ladder of multiples of the bound, a single particle, and a map over the
time step, stiffness and Poisson's ratio.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme
from mpm_ref.materials import make_law

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import DX, block, fixed_clock, one_particle, problem, shake, square, step_limits
from .outcome import FINISHED, OUT_OF_RANGE, REFUSED, STOPS, outcome

TRANSFERS = ("mls", "apic", "pic", "flip")
UP_TO, PAST, FAR = (0.5, 0.9, 1.0), (1.02, 1.1, 1.2, 1.5, 2.0), (3.0, 10.0, 100.0)
STOP_WITHIN = 100   # steps in which a run far past its bound must have stopped


class Rung(NamedTuple):
    """One run of the ladder."""

    transfer: str
    degree: int
    sampling: str       # "lattice" or "jittered"
    factor: float       # of the bound
    allowed: bool       # whether the problem allows a dt past the bound


def run_rung(rung, count, rng):
    """Return the `ExplicitOutcome` of an 8 x 8 block after `count` steps at most."""
    scheme = Scheme(rung.degree, rung.transfer)
    X = lattice([0.0, 0.0], [1.0, 1.0], 0.5 * DX)
    if rung.sampling == "jittered":
        X = X + rng.uniform(-0.25, 0.25, X.shape) * DX
    body = shake(block(X, 0.5 * DX, transfer=rung.transfer))
    dt = rung.factor * step_limits(body, DX, scheme).dt
    return outcome(problem(body, DX, fixed_clock(count, dt), scheme,
                           allow_unstable=rung.allowed))


@experiment("extremes.explicit.cfl_ladder", title="Multiples of the stable time step",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 240})
def cfl_ladder(run):
    """Check that runs are finite up to the bound, refused past it, and stopped where allowed."""
    count = run.choose(quick=500, standard=3000)
    kinds = run.choose(quick=[(t, 2, "lattice") for t in TRANSFERS],
                       standard=[(t, d, s) for t in TRANSFERS for d in (2, 3)
                                 for s in ("lattice", "jittered")])
    ends = {}
    for kind in run.progress(kinds, "transfers"):
        for factor in (*UP_TO, *PAST, *FAR):
            for allowed in (False, True):
                rung = Rung(*kind, factor, allowed)
                ends[rung] = run_rung(rung, count, run.rng)
    run.table("runs", (*Rung._fields, "end", "step", "message"),
              [(*rung, end.kind, end.step, end.message) for rung, end in ends.items()])
    record_ladder(run, ends, f"8 x 8 cells, 4 particles each, {count} steps")


def record_ladder(run, ends, scale):
    """Record each transfer's largest stable factor, its refusals and its stops."""
    for transfer in TRANSFERS:
        rungs = {r: e for r, e in ends.items() if r.transfer == transfer}
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.stable_to", stable_to(rungs),
                   comparator=">=", bound=1.0, scale=scale,
                   note="largest multiple of the bound on the ladder up to which all runs finish; "
                        "1 by docs/explanation/timestep.md; the next rung broke")
        past = [e for r, e in rungs.items() if r.factor > 1.0 and not r.allowed]
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.refused",
                   sum(e.kind == REFUSED and e.step == 0 for e in past) / len(past), paper=1.0,
                   comparator="=", scale=scale, note="share of the runs past the bound, not "
                   "allowed, that were refused before their first step")
        far = [e for r, e in rungs.items() if r.factor in FAR and r.allowed]
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.stop",
                   max(e.step if e.kind in STOPS else np.inf for e in far), unit="steps",
                   comparator="<=", bound=STOP_WITHIN, scale=scale,
                   note="last stop of the allowed runs at 3, 10 and 100 times the bound, each with "
                        "a sentence that names the limit; 3 to 20 when this was calibrated")


def stable_to(ends):
    """Return the largest factor up to which every allowed run finished."""
    allowed = {r: e for r, e in ends.items() if r.allowed}
    broken = [r.factor for r, e in allowed.items() if e.kind != FINISHED]
    return max(r.factor for r in allowed if r.factor < min(broken, default=np.inf))


BEST, WORST = 0.0, 0.5 - 1e-3      # of a cell from a node: S dx^2 is 4 and nearly 6


@experiment("extremes.explicit.single_particle", title="Time step limit of a single particle",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def single_particle(run):
    """Check that a particle is bounded at 0.9 of its limit and flagged at 1.1, for all transfers at
    its best and worst place in a cell [BaiSchroeder2022].
    """
    count, rows = run.choose(quick=1000, standard=20000), []
    for transfer in TRANSFERS:
        for name, place in (("best", BEST), ("worst", WORST)):
            below, peak = oscillate(transfer, place, 0.9, count)
            above, _ = oscillate(transfer, place, 1.1, count)
            rows += [(transfer, name, 0.9, below.kind, below.step, peak, below.message),
                     (transfer, name, 1.1, above.kind, above.step, np.nan, above.message)]
            record_limit(run, f"{transfer}.{name}", below, peak, above)
    run.table("runs", ("transfer", "place", "factor", "end", "step", "peak", "message"), rows)


def oscillate(transfer, place, factor, count):
    """Return the `ExplicitOutcome` of a particle stretched by 1e-3, and its largest |J - 1| over
    the initial one.
    """
    scheme, x = Scheme(2, transfer), [(3.0 + place) * DX] * 2
    body = one_particle(x, DX, transfer=transfer)
    body.particles.F[:] *= 1.0 + 1e-3
    first, peak = float(np.linalg.det(body.particles.F[0])) - 1.0, [0.0]

    def watch(state, dt):
        peak[0] = max(peak[0], abs(float(np.linalg.det(state.bodies[0].particles.F[0])) - 1.0))

    dt = factor * step_limits(body, DX, scheme).single_particle
    end = outcome(problem(body, DX, fixed_clock(count, dt), scheme, allow_unstable=factor > 1.0),
                  watch)
    return end, peak[0] / first


def record_limit(run, name, below, peak, above):
    """Record a run below the limit and one above it."""
    scale = "one particle, quadratic splines, stretched by 1e-3"
    run.record(f"extremes.explicit.single_particle.{name}.below",
               peak if below.kind == FINISHED else np.inf, comparator="<=", bound=5.0, scale=scale,
               note="largest strain over the initial one at 0.9 of the limit. Calibrated: 0.6 "
                    "(PIC, FLIP) to 2.3 (MLS; 1/sqrt(1 - 0.9^2) = 2.29 in theory); a growing mode "
                    "exceeds any bound")
    run.record(f"extremes.explicit.single_particle.{name}.above",
               above.step if above.kind in STOPS else np.inf, unit="steps", comparator="<=",
               bound=STOP_WITHIN, scale=scale, note="step at which the run at 1.1 of the limit "
               f"stopped; reason: {above.kind}")


CELLS = 4


@experiment("extremes.explicit.map", title="Stability map: dt, stiffness, Poisson's ratio",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 300})
def stability_map(run):
    """Check that no run within the bound breaks, and that the monitor names each that does."""
    count = run.choose(quick=200, standard=2000)
    dts = np.logspace(-5, -1, run.choose(quick=9, standard=17))
    moduli = np.logspace(4, 9, run.choose(quick=3, standard=6))
    ratios = run.choose(quick=(0.3, 0.49), standard=(0.0, 0.3, 0.45, 0.49, 0.499, 0.4999))
    rows = []
    for nu, E, dt in run.progress(list(product(ratios, moduli, dts)), "runs"):
        bound, end = run_past_bound(float(dt), make_law("fixed_corotated", E=E, nu=nu), count)
        rows.append((nu, E, dt, dt / bound, end.kind, end.step, end.message))
    run.table("runs", ("nu", "E", "dt", "of_bound", "end", "step", "message"), rows)
    record_stability_map(run, rows, f"2D, shaken block of {CELLS} x {CELLS} cells, MLS, "
                         f"{len(rows)} runs of {count} steps, all allowed past the bound")


def record_stability_map(run, rows, scale):
    """Record counts over the map."""
    name = "extremes.explicit.map"
    run.record(f"{name}.accepted_and_broke",
               sum(r[3] <= 1.0 and r[4] != FINISHED for r in rows), unit="runs", comparator="<=",
               bound=0, scale=scale, note="runs within the stable time step that did not finish")
    run.record(f"{name}.unnamed", sum(r[4] == OUT_OF_RANGE for r in rows), unit="runs",
               comparator="<=", bound=0, scale=scale,
               note="runs that broke without a limit of the monitor")
    broken = [r[3] for r in rows if r[4] != FINISHED]
    finished = [r[3] for r in rows if r[4] == FINISHED]
    run.record(f"{name}.least_broken", min(broken), comparator="info", scale=scale,
               note="smallest multiple of the bound that broke; the largest that did not is "
                    f"{max(finished):.3g}")


def run_past_bound(dt, law, count):
    """Return the stable time step of the block [s], and the `ExplicitOutcome` of a run with dt."""
    body = shake(square(CELLS, DX, law), strain=0.05)
    bound = step_limits(body, DX).dt
    return bound, outcome(problem(body, DX, fixed_clock(count, dt), allow_unstable=True))
