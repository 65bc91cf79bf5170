"""Inverted and degenerate deformation of one particle."""

import numpy as np

from mpm_ref.energy import energy
from mpm_ref.materials import make_law

from ..common.registry import experiment
from .blocks import STILL, bounds, problem, square, steps
from .outcome import FINISHED, UNFIT, outcome

DX, CELLS = 0.125, 4
# F of one particle in the middle of a block at rest: what a run must recover from, or refuse.
BROKEN = {
    "inverted": np.diag([1.0, -1.0]), "rank 1": np.diag([1.0, 0.0]), "zero": np.zeros((2, 2)),
    "tiny": 1e-150 * np.eye(2), "huge": 1e150 * np.eye(2), "NaN": np.full((2, 2), np.nan),
}
DEFINED = ("inverted", "rank 1", "zero", "tiny")       # where fixed corotated has an energy


@experiment("extremes.explicit.degenerate", title="One particle with an impossible deformation",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def degenerate(run):
    """Fixed corotated goes on and gains no energy, neo-Hookean refuses and names the particle."""
    rows, scale = [], f"2D, block of {CELLS} x {CELLS} cells, one particle broken"
    for law in ("fixed_corotated", "neo_hookean"):
        for name, F in BROKEN.items():
            end, E, J = bear(make_law(law, E=1e6, nu=0.3), F, 2000)
            rows.append((law, name, end.kind, end.step, E, J, end.said))
            if law == "fixed_corotated" and name in DEFINED:
                record_bearing(run, name, (end, E, J), scale)
            else:
                record_refusal(run, law, name, end, scale)
    run.table("runs", ("law", "F", "end", "step", "energy", "J", "said"), rows)


def record_bearing(run, name, result, scale):
    """Energy of a run that law and scheme can bear."""
    end, E, J = result
    run.record(f"extremes.explicit.degenerate.fixed_corotated.{_id(name)}",
               E if end.kind == FINISHED else np.inf, comparator="<=", bound=1.0 + 1e-9,
               scale=f"{scale}, {end.step} steps",
               note=f"energy at the end over that at first. The particle's J ends at {J:.3g}: "
                    "the law would turn it back, but F <- (I + dt L) F cannot change J's sign, "
                    "nor bring back a J of zero, while det(I + dt L) > 0: what is inverted in an "
                    "explicit run stays so, under stress, as a dead particle")


def record_refusal(run, law, name, end, scale):
    """Whether the run stopped before its first step and named the particle."""
    named = f"particle {PARTICLE}" in end.said
    right = end.kind in ("J", UNFIT) and end.step == 0 and named
    run.record(f"extremes.explicit.degenerate.{law}.{_id(name)}", int(right), paper=1,
               comparator="=", scale=scale, note=f"it must stop at once and name particle "
               f"{PARTICLE}; it said: {end.said or end.kind}")


def _id(name):
    return name.replace(" ", "_").lower()


PARTICLE = 27


def bear(law, F, count):
    """`Outcome` of a run in which one particle has this F, and at its end the energy over that at
    first, and the particle's J.
    """
    made = square(CELLS, DX, law)
    dt = 0.2 * bounds(made, DX).dt
    made.particles.F[PARTICLE] = F
    with np.errstate(all="ignore"):
        run_ = problem(made, DX, steps(count, dt), allow_unstable=True)
        first = energy((made,), STILL).sum
        end = outcome(run_)
        at = int(np.flatnonzero(made.id == PARTICLE)[0])
        J = float(np.linalg.det(made.particles.F[at]))
        return end, energy((made,), STILL, run_.inertia).sum / first, J
