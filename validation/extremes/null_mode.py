"""Particle velocities that the grid does not see: alternating from particle to particle."""

import numpy as np

from mpm_ref.explicit import Scheme

from ..common.registry import experiment
from ..verification.lattice import Periodic
from .blocks import bounds, problem, square, steps
from .outcome import outcome

DX, CELLS = 0.125, 4


@experiment("extremes.explicit.null_mode", title="The checkerboard that maps to no grid velocity",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 5})
def null_mode(run):
    """PIC, APIC and MLS forget it in a step; FLIP keeps it for ever."""
    count = run.choose(quick=200, standard=5000)
    scale = f"2D, periodic, {CELLS} x {CELLS} cells, 4 particles each, quadratic"
    for transfer in ("pic", "apic", "mls"):
        run.record(f"extremes.explicit.null_mode.{transfer}", left(transfer, 1), comparator="<=",
                   bound=1e-14, scale=f"{scale}, 1 step",
                   note="largest speed left, over that at first; calibrated: 0 to 1e-16")
    run.record("extremes.explicit.null_mode.flip", left("flip", count), comparator="band",
               bound=(1.0 - 1e-12, 1.0 + 1e-12), scale=f"{scale}, {count} steps",
               note="negative control: what FLIP documents, it keeps velocities that no node sees")
    run.record("extremes.explicit.null_mode.flip95", left("flip", 200, 0.95), comparator="<=",
               bound=2.0 * 0.95**200, scale=f"{scale}, 200 steps, flip = 0.95",
               note="a share of 5 % PIC damps it by 0.95 in every step")


def left(transfer, count, flip=1.0):
    """Largest speed after so many steps, over that at the start."""
    made = square(CELLS, DX, transfer=transfer)
    k = np.rint(made.particles.x / (0.5 * DX) - 0.5).sum(axis=1)
    made.particles.v[:, 0] = 0.1 * (-1.0) ** k
    scheme = Scheme(2, transfer, flip=flip)
    dt = 0.5 * bounds(made, DX, scheme).dt
    end = outcome(problem(made, DX, steps(count, dt), scheme, conditions=Periodic([CELLS] * 2)))
    speed = float(np.max(np.abs(made.particles.v))) / 0.1
    return speed if end.step == count else np.nan
