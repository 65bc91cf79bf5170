"""Error against cost of explicit MPM, on the axis-aligned manufactured solution and on the swing of
a cantilever; and the interaction of pairs of knobs.
"""

from itertools import combinations
from math import ceil, pi, sqrt

import numpy as np

from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.levelset import box
from mpm_ref.core.state import NONE
from mpm_ref.materials import make_law, stiffness
from mpm_ref.problem import Clock, Problem

from ..common.registry import experiment
from ..verification.axis_aligned import AxisAligned
from ..verification.convergence import order, rms
from ..verification.lattice import Periodic, body
from ..verification.manufactured import CHECKS, put_on
from ..verification.mms import LAW, RHO0, A, C
from .front import EMULATED, record_points, richardson
from .measure import DEFAULT, QUICK, STANDARD, SettingRun, measure, sample_points, settings

MMS_SOUND = float(np.sqrt(stiffness(LAW) / RHO0))   # [m/s]
MMS_END = 2.0 / C                                   # one oscillation [s]


def prepare_manufactured(setting, seed=0):
    """Return the `SettingRun` of the manufactured solution, with the largest RMS error of 20 times
    over A.
    """
    X = sample_points(setting, [0.0, 0.0], [1.0, 1.0], seed)
    dx = 1.0 / setting.cells
    square = body(X, dx / setting.per, RHO0, LAW, setting.transfer)
    motion, q, worst = AxisAligned(X, LAW, RHO0, A, C), square.particles, [0.0]
    count = ceil(MMS_END * MMS_SOUND / (setting.cfl * dx))
    put_on(q, motion, MMS_END / count)
    q.b[:] = motion.body_force(0.0)

    def watch(state, dt):
        if state.step * CHECKS // count > (state.step - 1) * CHECKS // count:
            worst[0] = max(worst[0], rms(q.x - motion.position(state.t)[square.id]) / A)
        q.b[:] = motion.body_force(state.t)[square.id]

    problem = Problem((square,), dx, Clock(dt=MMS_END / count, steps=count), np.zeros(2),
                      setting.scheme, Periodic([setting.cells] * 2), allow_unstable=True)
    return SettingRun(problem, watch, lambda: worst[0])


@experiment("trade.explicit.mms", title="Explicit MPM: manufactured solution, error against cost",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 300})
def mms(run):
    """Vary one knob at a time from the default."""
    levels = run.choose(quick=QUICK, standard=STANDARD)
    repeats = run.choose(quick=2, standard=3)
    points = [measure(knob, setting, lambda s: prepare_manufactured(s, run.seed), repeats)
              for knob, setting in run.progress(settings(levels), "settings")]
    scale = f"2D, one oscillation, {len(points)} settings; CPU time: smallest of {repeats}"
    record_points(run, points, scale)
    lattice = [p for p in points if p.knob in ("default", "dx") and p.good]
    run.record("trade.explicit.mms.order", order([1.0 / p.setting.cells for p in lattice],
                                                 [p.error for p in lattice]),
               comparator="info", scale=scale, note="slope of the error over dx at the default; "
               "verification.mms has the theoretical orders")
    run.note(EMULATED)
    run.note("CPU time is that of the step loop alone, without the body force, on a machine that "
             "may be busy: it is informative only.")


E, NU, RHO = 1e6, 0.3, 1000.0               # [Pa], 1, [kg/m^3]
LENGTH, HEIGHT, CLAMP = 1.0, 0.25, 0.25     # [m]; the clamp is two cells of the coarsest grid
GRAVITY = np.array([0.0, -2.0])             # [m/s^2]: the tip goes down by a tenth of the length
BEAM_LAW = make_law("fixed_corotated", E=E, nu=NU)
BEAM_SOUND = sqrt(stiffness(BEAM_LAW) / RHO)
PERIOD = 2.0 * pi * LENGTH**2 / (3.516 * sqrt(E / (1.0 - NU**2) / RHO) * HEIGHT / sqrt(12.0))
HALF_PERIOD = 0.5 * PERIOD                  # near the lowest position [s]
TIP = 0.875                                 # from here on: the last cell of the coarsest grid


def prepare_cantilever(setting, reference=None, seed=0):
    """Return the `SettingRun` of the cantilever; without a reference, its error is the sinking."""
    dx = 1.0 / setting.cells
    X = sample_points(setting, [-CLAMP, 0.0], [LENGTH, HEIGHT], seed)
    beam = body(X, dx / setting.per, RHO, BEAM_LAW, setting.transfer)
    beam = beam._replace(particles=beam.particles._replace(b=NONE))
    count = int(np.ceil(HALF_PERIOD * BEAM_SOUND / (setting.cfl * dx)))
    clamp = Conditions(prescribed=(Prescribed(box([-1e3, -1e3], [0.0, 1e3])),))
    problem = Problem((beam,), dx, Clock(dt=HALF_PERIOD / count, steps=count), GRAVITY,
                      setting.scheme, clamp, allow_unstable=True)

    def error():
        sunk = (X[beam.id] - beam.particles.x)[X[beam.id, 0] > TIP, 1].mean()
        return float(sunk if reference is None else abs(sunk - reference) / reference)

    return SettingRun(problem, lambda state, dt: None, error)


def reference_sinking(setting):
    """Return the sinking of the tip [m]."""
    return measure("reference", setting, prepare_cantilever, 1).error


@experiment("trade.explicit.cantilever", title="Explicit MPM: swing of a cantilever against cost",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 900})
def cantilever(run):
    """Vary one knob at a time from the default, against a finer grid of the default."""
    levels, fine, per = run.choose(quick=(QUICK, 48, 2), standard=(STANDARD, 192, 3))
    repeats = run.choose(quick=2, standard=3)
    coarse, half, best = (reference_sinking(DEFAULT._replace(cells=fine // n, per=per, cfl=0.4))
                          for n in (4, 2, 1))
    order_of_grids, floor = richardson(coarse, half, best)
    run.record("trade.explicit.cantilever.reference", best, unit="m", comparator="info",
               scale=f"{fine} cells over the length, {per} x {per} particles per cell",
               note=f"mean sinking of the tip after half a period; with half the cells {half:.6g} "
                    f"m, with a quarter {coarse:.6g} m: observed order {order_of_grids:.2g}, so "
                    f"that errors below {floor:.2g} are not resolved")
    points = [measure(knob, setting, lambda s: prepare_cantilever(s, best, run.seed), repeats)
              for knob, setting in run.progress(settings(levels), "settings")]
    record_points(run, points, f"2D, half a period, {len(points)} settings; CPU time: smallest of "
                               f"{repeats}", floor)
    run.note(EMULATED)


# One stable change of each knob.
CHANGES = {
    "dt": {"cfl": 0.1}, "dx": {"cells": 32}, "particles": {"per": 3},
    "sampling": {"sampling": "jittered"}, "degree": {"degree": 3}, "transfer": {"transfer": "apic"},
    "storage": {"storage": "f32"},
}
PAIRS = 10


@experiment("trade.explicit.interactions", title="Explicit MPM: interactions of knobs",
            profiles=("standard",), budget={"standard": 300})
def interactions(run):
    """Compare the error factor of two changes with the product of their single factors."""
    pairs = list(combinations(CHANGES, 2))
    chosen = [pairs[k] for k in sorted(run.rng.permutation(len(pairs))[:PAIRS])]
    single = {knob: error_of_change(run, CHANGES[knob]) for knob in CHANGES}
    default, rows = error_of_change(run, {}), []
    for a, b in run.progress(chosen, "pairs"):
        both = error_of_change(run, {**CHANGES[a], **CHANGES[b]})
        expected = single[a] * single[b] / default
        rows.append((a, b, single[a] / default, single[b] / default, both / default,
                     both / expected))
    run.table("pairs", ("first", "second", "factor_first", "factor_second", "factor_both",
                        "interaction"), rows)
    strongest = max(rows, key=lambda row: abs(np.log(row[-1])))
    run.record("trade.explicit.interactions.strongest", strongest[-1], comparator="info",
               scale=f"{PAIRS} of {len(pairs)} pairs, drawn with the seed of the run",
               note=f"error of {strongest[0]} and {strongest[1]} together over the product of "
                    "their factors: where this is far from 1, single knobs do not predict pairs")


def error_of_change(run, change):
    """Return the error of the manufactured solution with some knobs changed."""
    setting = DEFAULT._replace(**change)
    return measure("pair", setting, lambda s: prepare_manufactured(s, run.seed), 1).error
