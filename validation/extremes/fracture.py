"""Numerical fracture: matter comes apart where neighbours share no node any more."""

import numpy as np

from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.levelset import box
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from ..verification.lattice import lattice
from .blocks import block, bounds, problem, steps
from .outcome import outcome

DX, LENGTH = 0.125, 1.0
GRIP = 2.0 * DX             # length of the clamped ends
RATE = 1.0                  # speed of the moving grip [m/s]; waves run 37 m/s


class Parted(Exception):
    """The bar came apart."""


@experiment("extremes.explicit.fracture", title="A bar stretched until its particles lose contact",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 60})
def fracture(run):
    """The stretch at which the first particles come apart."""
    cases = run.choose(quick=[("mls", 2, 2)], standard=[("mls", d, n) for d in (2, 3)
                                                        for n in (1, 2, 3)])
    table = []
    for transfer, degree, per in run.progress(cases, "bars"):
        rows, said = pull(transfer, degree, per)
        table += [(transfer, degree, per, *row) for row in rows]
        mean, local, gap, _ = rows[-1]
        name = f"extremes.explicit.fracture.{transfer}.{degree}.{per}"
        scale = f"2D bar of 8 x 2 cells, degree {degree}, {per} particles per cell and direction"
        run.record(f"{name}.local", local if gap > degree else np.nan, comparator="band",
                   bound=(degree * per, (degree + 1) * per), scale=scale,
                   note="distance over that at rest of the first two neighbours along the bar that "
                        "share no node: they are degree to degree + 1 cells apart, 1/per of a cell "
                        f"at first. {said}")
        run.record(f"{name}.mean", mean, comparator="info", scale=scale,
                   note="length of the free part of the bar over that at rest, when they part: the "
                        "law itself does not break, in one piece it could be stretched without end")
    run.table("pull", ("transfer", "degree", "per", "mean", "local", "gap", "tau_xx"), table)


def pull(transfer, degree, per):
    """Rows (mean stretch, stretch between the neighbours that are farthest apart, cells between
    their base nodes, mean tau_xx) until the bar comes apart, and what the run said.
    """
    spacing, scheme = DX / per, Scheme(degree, transfer)
    made = block(lattice([-GRIP, 0.0], [LENGTH + GRIP, 2 * DX], spacing), spacing,
                 transfer=transfer)
    fixed = Prescribed(box([-1e3, -1e3], [0.0, 1e3]))
    moving = Prescribed(box([LENGTH, -1e3], [1e3, 1e3]), Motion(Steady((RATE, 0.0))))
    dt = 0.25 * bounds(made, DX, scheme).dt
    count, rows = int((degree + 1) * per * LENGTH / RATE / dt), []
    bar = problem(made, DX, steps(count, dt), scheme,
                  conditions=Conditions(prescribed=(fixed, moving)))

    def watch(state, dt):
        local, gap = opened(state.bodies[0], spacing, degree)
        if state.step % 20 == 0 or gap > degree:
            tau = float(state.bodies[0].particles.tau[:, 0, 0].mean())
            rows.append((1.0 + RATE * state.t / LENGTH, local, gap, tau))
        if gap > degree:
            raise Parted

    try:
        end = outcome(bar, watch)
    except Parted:
        return rows, "No limit of the monitor was broken before."
    return rows, f"The run ended: {end.said or end.kind}"


def opened(bar, spacing, degree):
    """Of the lowest row of particles, the two neighbours with the most cells between their base
    nodes: their distance over that at rest, and these cells.
    """
    order = np.argsort(bar.id)
    x = bar.particles.x[order].reshape(-1, round(2 * DX / spacing), 2)[:, 0, 0]
    gaps = np.diff(np.floor(x / DX - 0.5 * (degree - 1)))
    k = int(np.argmax(gaps))
    return float(x[k + 1] - x[k]) / spacing, int(gaps[k])
