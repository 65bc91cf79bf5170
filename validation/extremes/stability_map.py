"""A map of where explicit runs break: time step, stiffness, Poisson's ratio."""

from itertools import product

import numpy as np

from mpm_ref.materials import make_law

from ..common.registry import experiment
from .blocks import bounds, problem, shaken, square, steps
from .outcome import FINISHED, OUT_OF_RANGE, outcome

DX, CELLS = 0.125, 4


@experiment("extremes.explicit.map", title="Where runs break: dt, stiffness, Poisson's ratio",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 300})
def breaking(run):
    """No run that the bound accepts breaks, and whatever breaks is told by name."""
    count = run.choose(quick=200, standard=2000)
    dts = np.logspace(-5, -1, run.choose(quick=9, standard=17))
    moduli = np.logspace(4, 9, run.choose(quick=3, standard=6))
    ratios = run.choose(quick=(0.3, 0.49), standard=(0.0, 0.3, 0.45, 0.49, 0.499, 0.4999))
    rows = []
    for nu, E, dt in run.progress(list(product(ratios, moduli, dts)), "runs"):
        bound, end = attempt(float(dt), make_law("fixed_corotated", E=E, nu=nu), count)
        rows.append((nu, E, dt, dt / bound, end.kind, end.step, end.said))
    run.table("runs", ("nu", "E", "dt", "of_bound", "end", "step", "said"), rows)
    record_map(run, rows, f"2D, shaken block of {CELLS} x {CELLS} cells, MLS, {len(rows)} runs of "
                          f"{count} steps, all allowed past the bound")


def record_map(run, rows, scale):
    """Counts over the map."""
    name = "extremes.explicit.map"
    run.record(f"{name}.accepted_and_broke",
               sum(r[3] <= 1.0 and r[4] != FINISHED for r in rows), unit="runs", comparator="<=",
               bound=0, scale=scale, note="runs within the stable time step that did not end")
    run.record(f"{name}.unnamed", sum(r[4] == OUT_OF_RANGE for r in rows), unit="runs",
               comparator="<=", bound=0, scale=scale,
               note="runs that broke otherwise than by a limit of the monitor")
    broken = [r[3] for r in rows if r[4] != FINISHED]
    whole = [r[3] for r in rows if r[4] == FINISHED]
    run.record(f"{name}.least_broken", min(broken), comparator="info", scale=scale,
               note="smallest multiple of the bound that broke; the largest that did not is "
                    f"{max(whole):.3g}")


def attempt(dt, law, count):
    """Stable time step of the block [s], and the `Outcome` of a run with dt all the same."""
    made = shaken(square(CELLS, DX, law), strain=0.05)
    bound = bounds(made, DX).dt
    return bound, outcome(problem(made, DX, steps(count, dt), allow_unstable=True))
