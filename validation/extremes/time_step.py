"""The stable time step: a ladder of multiples of the bound, and a particle by itself."""

from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import alone, block, bounds, problem, shaken, steps
from .outcome import FINISHED, REFUSED, STOPS, outcome

DX = 0.125
TRANSFERS = ("mls", "apic", "pic", "flip")
UP_TO, PAST, FAR = (0.5, 0.9, 1.0), (1.02, 1.1, 1.2, 1.5, 2.0), (3.0, 10.0, 100.0)
WITHIN = 100        # steps in which a run far past its bound must have stopped


class Rung(NamedTuple):
    """One run of the ladder."""

    transfer: str
    degree: int
    sampling: str       # "lattice" or "jittered"
    factor: float       # of the bound
    allowed: bool       # whether the problem allows a dt past the bound


def climb(rung, count, rng):
    """`Outcome` of an 8 x 8 block after `count` steps at most."""
    scheme = Scheme(rung.degree, rung.transfer)
    X = lattice([0.0, 0.0], [1.0, 1.0], 0.5 * DX)
    if rung.sampling == "jittered":
        X = X + rng.uniform(-0.25, 0.25, X.shape) * DX
    made = shaken(block(X, 0.5 * DX, transfer=rung.transfer))
    dt = rung.factor * bounds(made, DX, scheme).dt
    return outcome(problem(made, DX, steps(count, dt), scheme, allow_unstable=rung.allowed))


@experiment("extremes.explicit.cfl_ladder", title="Multiples of the stable time step",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 240})
def cfl_ladder(run):
    """Finite up to the bound, refused past it, and stopped in time where it is allowed."""
    count = run.choose(quick=500, standard=3000)
    kinds = run.choose(quick=[(t, 2, "lattice") for t in TRANSFERS],
                       standard=[(t, d, s) for t in TRANSFERS for d in (2, 3)
                                 for s in ("lattice", "jittered")])
    ends = {}
    for kind in run.progress(kinds, "transfers"):
        for factor in (*UP_TO, *PAST, *FAR):
            for allowed in (False, True):
                rung = Rung(*kind, factor, allowed)
                ends[rung] = climb(rung, count, run.rng)
    run.table("runs", (*Rung._fields, "end", "step", "said"),
              [(*rung, end.kind, end.step, end.said) for rung, end in ends.items()])
    record_ladder(run, ends, f"8 x 8 cells, 4 particles each, {count} steps")


def record_ladder(run, ends, scale):
    """What every transfer's rungs say together."""
    for transfer in TRANSFERS:
        mine = {r: e for r, e in ends.items() if r.transfer == transfer}
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.stable_to", stable_to(mine),
                   comparator=">=", bound=1.0, scale=scale,
                   note="largest tried multiple of the bound up to which all runs end; 1 by "
                        "docs/explanation/timestep.md; the rung after it broke")
        past = [e for r, e in mine.items() if r.factor > 1.0 and not r.allowed]
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.refused",
                   sum(e.kind == REFUSED and e.step == 0 for e in past) / len(past), paper=1.0,
                   comparator="=", scale=scale, note="share of the runs past the bound, not "
                   "allowed, that were refused before their first step")
        far = [e for r, e in mine.items() if r.factor in FAR and r.allowed]
        run.record(f"extremes.explicit.cfl_ladder.{transfer}.stop",
                   max(e.step if e.kind in STOPS else np.inf for e in far), unit="steps",
                   comparator="<=", bound=WITHIN, scale=scale,
                   note="last stop of the allowed runs at 3, 10 and 100 times the bound, each with "
                        "a sentence that names the limit; 3 to 20 when this was calibrated")


def stable_to(ends):
    """Largest factor up to which every run ended well that was made."""
    made = {r: e for r, e in ends.items() if r.allowed}
    broken = [r.factor for r, e in made.items() if e.kind != FINISHED]
    return max(r.factor for r in made if r.factor < min(broken, default=np.inf))


BEST, WORST = 0.0, 0.5 - 1e-3      # of a cell from a node: S dx^2 is 4 and nearly 6


@experiment("extremes.explicit.single_particle", title="Time step limit of a particle by itself",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 60})
def single_particle(run):
    """Bounded at 0.9 of the limit, flagged at 1.1, for all transfers in the best and worst place
    [BaiSchroeder2022].
    """
    count, rows = run.choose(quick=1000, standard=20000), []
    for transfer in TRANSFERS:
        for name, place in (("best", BEST), ("worst", WORST)):
            below, peak = breathe(transfer, place, 0.9, count)
            above, _ = breathe(transfer, place, 1.1, count)
            rows += [(transfer, name, 0.9, below.kind, below.step, peak, below.said),
                     (transfer, name, 1.1, above.kind, above.step, np.nan, above.said)]
            record_limit(run, f"{transfer}.{name}", below, peak, above)
    run.table("runs", ("transfer", "place", "factor", "end", "step", "peak", "said"), rows)


def breathe(transfer, place, factor, count):
    """`Outcome` of a particle stretched by 1e-3, and its largest |J - 1| over the first one."""
    scheme, x = Scheme(2, transfer), [(3.0 + place) * DX] * 2
    made = alone(x, DX, transfer=transfer)
    made.particles.F[:] *= 1.0 + 1e-3
    first, peak = float(np.linalg.det(made.particles.F[0])) - 1.0, [0.0]

    def watch(state, dt):
        peak[0] = max(peak[0], abs(float(np.linalg.det(state.bodies[0].particles.F[0])) - 1.0))

    dt = factor * bounds(made, DX, scheme).single_particle
    rules = {"allow_unstable": factor > 1.0}
    end = outcome(problem(made, DX, steps(count, dt), scheme, **rules), watch)
    return end, peak[0] / first


def record_limit(run, name, below, peak, above):
    """Both sides of the limit."""
    scale = "one particle, quadratic splines, stretched by 1e-3"
    run.record(f"extremes.explicit.single_particle.{name}.below",
               peak if below.kind == FINISHED else np.inf, comparator="<=", bound=5.0, scale=scale,
               note="largest strain over the first one at 0.9 of the limit. Calibrated: 0.6 (PIC, "
                    "FLIP) to 2.3 (MLS; 1/sqrt(1 - 0.9^2) = 2.29 in theory); a growing mode "
                    "exceeds any bound")
    run.record(f"extremes.explicit.single_particle.{name}.above",
               above.step if above.kind in STOPS else np.inf, unit="steps", comparator="<=",
               bound=WITHIN, scale=scale, note="step at which the run at 1.1 of the limit stopped "
               f"and said: {above.kind}")
