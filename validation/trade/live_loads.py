"""Reduced models under loads that are known only while the run goes on: error of the displacement
against CPU time, on the bundled study `sway`, whose training runs are responses to steps. Inferred
operators alone are trained on runs under random loads, of the same distribution as those that are
judged.

Errors are those of agreement with the full-order run on the same grid, by the transfer of the
training runs. CPU times are of the steps and of the positions at the levels, on one thread.
"""

from typing import NamedTuple

import numba
import numpy as np

from mpm_ref.core.jit import set_threads
from mpm_ref.rom.evolution import EVOLVED

from ..common.registry import experiment
from .arm_models import FEW
from .live_models import corrected_method, ldm_method, operators_method, superposition_method
from .live_runs import (
    coarse_method,
    drawn_loads,
    full_method,
    load_training,
    played,
    points_of,
    sized,
    step_training,
    sway,
    training_gravity,
)
from .reduced import COLUMNS, ArmCost, errors

COARSER = (1.5, 2.0, 4.0)       # times as coarse
CORRECTED = (2.0, 4.0)          # ... of the runs that are corrected
MORE = 30                       # modes of LDM with evolved F
MOST = 10                       # modes, of which inferred operators choose,
LEARNED, LEARNED_SEED = 64, 8   # their training runs, and the seed of these loads
REPEATED = 1000                 # runs after which their cost is judged,
GAIN, WITHIN = 5.0, 0.01        # what they have to gain then, and with which error
SEED = 1                        # of the loads; settings were chosen on those of seed 0


class LiveBody(NamedTuple):
    """The study's body at a size; transfer None: that of the study."""

    dx: float                   # [m]
    modes: int                  # of LDM with the map's F: the study's, or the best of 4, 6 and 30
    transfer: str | None = None


QUICK = {"400": LiveBody(0.04, 6)}
BODIES = QUICK | {"400-apic": LiveBody(0.04, 6, "apic"), "13k": LiveBody(0.0125, 4)}


@experiment("trade.reduced-live", title="Reduced models under loads known while the run goes on",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 1000})
def reduced_live(run):
    """Measure every method at each size; record whether LDM pays."""
    threads = numba.get_num_threads()
    set_threads(1)
    try:
        compare_bodies(run)
    finally:
        set_threads(threads)


def compare_bodies(run):
    """Record all methods of all bodies."""
    study, rows = sway(), []
    gravity = training_gravity(study)
    loads = drawn_loads(gravity, run.choose(quick=1, standard=3), SEED)
    for size, body in run.progress(run.choose(quick=QUICK, standard=BODIES).items(), "bodies"):
        first = study.scene(study.mu[0])
        scenes = {times: sized(first, times * body.dx, body.transfer) for times in (1.0, *COARSER)}
        modes = body.modes, study.tables.reduced_model.r
        costs = measured((size, points_of(scenes[1.0])), [*methods(scenes, gravity, modes)], loads)
        record_body(run, f"trade.reduced-live.{size}", costs,
                    f"{costs[0].particles} particles, {len(gravity)} training runs, "
                    f"{len(loads)} loads")
        rows += costs
    run.table("methods", COLUMNS, rows)


def methods(scenes, gravity, modes):
    """Yield the `LiveMethod`s of scenes {times as coarse: scene}, that of the reference first, with
    training runs under gravity (runs, 3) [m/s^2]; modes: LDM's number of them, and the study's.
    """
    scene, (r, r_study) = scenes[1.0], modes
    training = step_training(scene, gravity)
    yield full_method(scene)
    yield full_method(by_mls(scene))
    for times in COARSER:
        for one in (scenes[times], by_mls(scenes[times])):
            yield coarse_method(one, times, training.X)
    for times in CORRECTED:
        yield corrected_method(training, step_training(scenes[times], gravity), times)
    yield ldm_method("ldm", training, r)
    yield ldm_method("ldm.few", training, r, points=FEW)
    if r != r_study:
        yield ldm_method("ldm.study", training, r_study)
    for name, count, points in (("ldm.evolved", r_study, None), ("ldm.evolved.few", r_study, FEW),
                                ("ldm.evolved.modes", MORE, None)):
        yield ldm_method(name, training, count, points=points, deformation_gradient=EVOLVED)
    yield superposition_method(training)
    loads = drawn_loads(gravity, LEARNED, LEARNED_SEED)
    yield operators_method(load_training(scene, loads), MOST)


def by_mls(scene):
    """Return a scene with MLS-MPM as its transfer, the fastest."""
    return sized(scene, scene.dx, "mls")


def measured(body, methods, loads):
    """Return the `ArmCost` of each `LiveMethod` of a body (size, points at rest), compared with the
    first; what is compiled or read with a method's first tick is not counted.
    """
    (size, X), runs = body, []
    for method in methods:
        played(method, loads[0][:1])
        runs.append([played(method, load) for load in loads])
    return [ArmCost(size, len(X), method.name, *errors(X, own, runs[0]),
                    float(np.mean([one.cpu for one in own])), method.fit, method.data,
                    method.pairs, method.settings)
            for method, own in zip(methods, runs, strict=True)]


def record_body(run, name, rows, scale):
    """Record the error of each method that comes to its end, and what LDM and inferred operators
    gain over others.
    """
    full = rows[0]
    for row in (row for row in rows[1:] if np.isfinite(row.error)):
        run.record(f"{name}.{row.method}", 100.0 * row.error, unit="%", comparator="info",
                   scale=scale, note=f"of the displacement, worst load {100.0 * row.worst:.3g} %; "
                   f"a run takes {row.cpu_run:.3g} CPU s, {full.method} {full.cpu_run:.3g}; before "
                   f"the first run {row.first:.3g}{'; ' + row.settings if row.settings else ''}")
    one = {row.method: row for row in rows}
    record_operators(run, name, rows, f"{scale}; operators: {LEARNED} runs under random loads")
    for method in ("ldm", "ldm.evolved"):
        record_gain(run, name, (rows, method), scale)
        run.record(f"{name}.{method}.beats-superposition",
                   one["superposition"].error / one[method].error, unit="x", comparator=">=",
                   bound=1.0, scale=scale, note="error of superposed responses over that of LDM")


def record_operators(run, name, rows, scale):
    """Record the error of inferred operators by the bound WITHIN; how many times as much CPU time
    as they the cheapest other method with at most their error takes for REPEATED runs, with all
    that it needs before the first one; and after how many runs they are the cheapest.
    """
    own = next(row for row in rows if row.method == "operators")
    rule = {"unit": "x", "comparator": ">=", "bound": GAIN, "scale": scale}
    run.record(f"{name}.operators.within", 100.0 * own.error, unit="%", comparator="<=",
               bound=100.0 * WITHIN, scale=scale, note="of the displacement")
    if not np.isfinite(own.error):
        run.record(f"{name}.operators.gain", 0.0, note="the run broke down", **rule)
        return
    others = [row for row in rows if row is not own and row.error <= own.error]
    best = min(others, key=lambda row: row.first + REPEATED * row.cpu_run)
    total = [row.first + REPEATED * row.cpu_run for row in (best, own)]
    run.record(f"{name}.operators.gain", total[0] / total[1], **rule,
               note=f"CPU time of {REPEATED} runs with training, of {best.method}, the cheapest "
               f"with at most their error, {100.0 * own.error:.3g} %, over that of operators")
    if all(row.cpu_run > own.cpu_run for row in others):
        pays = max((own.first - row.first) / (row.cpu_run - own.cpu_run) for row in others)
        run.record(f"{name}.operators.pays", pays, unit="runs", comparator="info", scale=scale,
                   note="from which operators are the cheapest method of at most their error, "
                   "training included")


def record_gain(run, name, compared, scale):
    """Record how many times LDM's CPU time the cheapest other method takes with at most its error;
    one that broke down gains nothing. compared = (rows, method of LDM).
    """
    rows, method = compared
    ldm = next(row for row in rows if row.method == method)
    others = [row for row in rows if not row.method.startswith("ldm") and row.error <= ldm.error]
    cheapest = min(others, key=lambda row: row.cpu_run)
    gain = cheapest.cpu_run / ldm.cpu_run if np.isfinite(ldm.error) else 0.0
    run.record(f"{name}.{method}.gain", gain, unit="x", comparator=">=", bound=1.0,
               scale=scale, note=f"CPU time of a run of {cheapest.method}, the cheapest with at "
               "most LDM's error, over LDM's")
