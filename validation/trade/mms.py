"""Error against cost on the axis-aligned manufactured solution."""

from math import ceil

import numpy as np

from mpm_ref.materials import stiffness
from mpm_ref.problem import Clock, Problem

from ..common.registry import experiment
from ..verification.axis_aligned import AxisAligned
from ..verification.convergence import order, rms
from ..verification.lattice import Periodic, body
from ..verification.manufactured import CHECKS, put_on
from ..verification.mms import LAW, RHO0, A, C
from .front import EMULATED, record_points
from .knobs import QUICK, STANDARD, settings
from .measure import Trial, measure, sampled

SOUND = float(np.sqrt(stiffness(LAW) / RHO0))       # [m/s]
END = 2.0 / C                                       # one oscillation [s]


def prepare(setting, seed=0):
    """`Trial` of the manufactured solution: largest RMS error of 20 times, relative to A."""
    X = sampled(setting, [0.0, 0.0], [1.0, 1.0], seed)
    dx = 1.0 / setting.cells
    square = body(X, dx / setting.per, RHO0, LAW, setting.transfer)
    motion, q, worst = AxisAligned(X, LAW, RHO0, A, C), square.particles, [0.0]
    count = ceil(END * SOUND / (setting.cfl * dx))
    put_on(q, motion, END / count)
    q.b[:] = motion.body_force(0.0)

    def watch(state, dt):
        if state.step * CHECKS // count > (state.step - 1) * CHECKS // count:
            worst[0] = max(worst[0], rms(q.x - motion.position(state.t)[square.id]) / A)
        q.b[:] = motion.body_force(state.t)[square.id]

    problem = Problem((square,), dx, Clock(dt=END / count, steps=count), np.zeros(2),
                      setting.scheme, Periodic([setting.cells] * 2), allow_unstable=True)
    return Trial(problem, watch, lambda: worst[0])


@experiment("trade.explicit.mms", title="Explicit MPM: manufactured solution, error against cost",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 300})
def mms(run):
    """One knob at a time from the default."""
    levels = run.choose(quick=QUICK, standard=STANDARD)
    repeats = run.choose(quick=2, standard=3)
    points = [measure(knob, setting, lambda s: prepare(s, run.seed), repeats)
              for knob, setting in run.progress(settings(levels), "settings")]
    scale = f"2D, one oscillation, {len(points)} settings; CPU time: smallest of {repeats}"
    record_points(run, points, scale)
    lattice = [p for p in points if p.knob in ("default", "dx") and p.good]
    run.record("trade.explicit.mms.order", order([1.0 / p.setting.cells for p in lattice],
                                                 [p.error for p in lattice]),
               comparator="info", scale=scale, note="slope of the error over dx at the default; "
               "what theory promises, and at which settings: verification.mms")
    run.note(EMULATED)
    run.note("CPU time is that of the step loop alone, without the body force, on a machine that "
             "may be busy: it is information, not a judgement.")
