"""Error against cost of a scene: how far the tip of a cantilever swings under its weight."""

from math import pi, sqrt

import numpy as np

from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.levelset import box
from mpm_ref.core.state import NONE
from mpm_ref.materials import make_law, stiffness
from mpm_ref.problem import Clock, Problem

from ..common.registry import experiment
from ..verification.lattice import body
from .front import EMULATED, record_points
from .knobs import DEFAULT, QUICK, STANDARD, settings
from .measure import Trial, measure, sampled

E, NU, RHO = 1e6, 0.3, 1000.0               # [Pa], 1, [kg/m^2]
LENGTH, HEIGHT, CLAMP = 1.0, 0.25, 0.25     # [m]; the clamp is two cells of the coarsest grid
GRAVITY = np.array([0.0, -2.0])             # [m/s^2]: the tip goes down by a tenth of the length
LAW = make_law("fixed_corotated", E=E, nu=NU)
SOUND = sqrt(stiffness(LAW) / RHO)
PERIOD = 2.0 * pi * LENGTH**2 / (3.516 * sqrt(E / (1.0 - NU**2) / RHO) * HEIGHT / sqrt(12.0))
END = 0.5 * PERIOD                          # near the lowest position [s]
TIP = 0.875                                 # from here on: the last cell of the coarsest grid


def prepare(setting, reference=None, seed=0):
    """`Trial` of the cantilever; its error is the sinking itself [m] without a reference."""
    dx = 1.0 / setting.cells
    X = sampled(setting, [-CLAMP, 0.0], [LENGTH, HEIGHT], seed)
    beam = body(X, dx / setting.per, RHO, LAW, setting.transfer)
    beam = beam._replace(particles=beam.particles._replace(b=NONE))
    count = int(np.ceil(END * SOUND / (setting.cfl * dx)))
    clamp = Conditions(prescribed=(Prescribed(box([-1e3, -1e3], [0.0, 1e3])),))
    problem = Problem((beam,), dx, Clock(dt=END / count, steps=count), GRAVITY, setting.scheme,
                      clamp, allow_unstable=True)

    def error():
        sunk = (X[beam.id] - beam.particles.x)[X[beam.id, 0] > TIP, 1].mean()
        return float(sunk if reference is None else abs(sunk - reference) / reference)

    return Trial(problem, lambda state, dt: None, error)


def sinking(setting):
    """Sinking of the tip [m]."""
    return measure("reference", setting, prepare, 1).error


@experiment("trade.explicit.cantilever", title="Explicit MPM: swing of a cantilever against cost",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 900})
def cantilever(run):
    """One knob at a time from the default, against a finer grid of the default."""
    levels, fine, per = run.choose(quick=(QUICK, 48, 2), standard=(STANDARD, 192, 3))
    repeats = run.choose(quick=2, standard=3)
    best = sinking(DEFAULT._replace(cells=fine, per=per, cfl=0.4))
    half = sinking(DEFAULT._replace(cells=fine // 2, per=per, cfl=0.4))
    run.record("trade.explicit.cantilever.reference", best, unit="m", comparator="info",
               scale=f"{fine} cells over the length, {per} x {per} particles per cell",
               note=f"mean sinking of the tip after half a period; with half the cells {half:.6g} "
                    f"m: errors below {abs(half / best - 1.0):.1g} mean nothing")
    points = [measure(knob, setting, lambda s: prepare(s, best, run.seed), repeats)
              for knob, setting in run.progress(settings(levels), "settings")]
    record_points(run, points, f"2D, half a period, {len(points)} settings; CPU time: smallest of "
                               f"{repeats}")
    run.note(EMULATED)
