"""Full-order runs with longer steps, as far as they go. Longer steps of reduced runs are compared
with them, since a full-order run with longer steps is faster too.

Bounds of the time step, which are sufficient and not needed everywhere, do not end them.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.monitor import Unstable
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.evaluate import history_reference, level_of, path_errors, stress_share
from mpm_ref.rom.study.full_model import field_of, nsf_full_model
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.rivals import stretched
from ..common.scenes import with_
from .factors import REPEATS, seconds
from .studies import cake, metal

FACTORS = (1.0, 1.25, 1.5, 2.0, 3.0)        # of the scene's step
COLUMNS = ("scene", "value", "faster", "states", "origin", "displacement", "stress", "seconds",
           "speedup")                       # times are those of the first test


class EndedRun(NamedTuple):
    """Errors of a full-order run with longer steps, and how it ended."""

    states: int             # that were compared
    errors: PositionErrors          # infinite where it ended before its time
    stress: float           # of the Kirchhoff stress, over its norm; likewise
    reason: str             # why it ended early; empty if it did not


class FullOrderField(NamedTuple):
    """The bodies of a full-order run as the field that `path_errors` asks for."""

    X: np.ndarray           # (n, d) points at the start [m]

    def place(self, points, bodies):
        """Positions (n, d) of points."""
        return field_of(bodies, "x")[points]

    def stress(self, points, bodies):
        """Their Kirchhoff stress (n, d, d)."""
        return field_of(bodies, "tau")[points]


@experiment("nsf.longer", title="NSF: full-order runs with longer steps",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 500})
def longer(run):
    """Metal frame and cake: errors over two tests beside the runs with the scene's own steps; times
    of the first, medians of runs in turn.
    """
    studies = run.choose(quick=lambda: (metal(4), cake(4)), standard=lambda: (metal(), cake()))()
    rows = []
    for name, study in zip(("metal", "cake"), studies, strict=True):
        values = study.test[1:run.choose(quick=2, standard=3)]
        times = run_times(study.run(values[0]), run.choose(quick=1, standard=REPEATS))
        ended = run.progress([ended_runs(study, value) for value in values], f"{name}, errors")
        for factor, time, *runs in zip(FACTORS, times, *ended, strict=True):
            record(run, f"nsf.longer.{name}.x{factor:g}", runs, (time, times[0]), scale_of(study))
            rows += [(name, value, factor, one.states, one.errors.origin, one.errors.displacement,
                      one.stress, time, times[0] / time)
                     for value, one in zip(values, runs, strict=True)]
    run.table("steps", COLUMNS, rows)


def run_times(scene, repeats):
    """Return the wall seconds of runs with steps of FACTORS: medians of runs in turn; infinite
    where they end before their time.
    """
    still = [with_(own, every=own.steps) for own in (stretched(scene, one) for one in FACTORS)]
    with one_thread():
        times = [[run_seconds(one) for one in still] for _ in range(repeats)]
    return np.median(times, axis=0).tolist()


def run_seconds(scene):
    """Return the wall seconds of a run; infinite where it ends before its time."""
    try:
        return seconds(lambda: simulate(nsf_full_model(scene).problem))
    except Unstable:
        return inf


def ended_runs(study, value):
    """Return the `EndedRun`s of the test with a value, with steps of FACTORS, in their order."""
    scene = study.run(value)
    test = simulate_history(scene, [value], np.float32, study.spacing)
    return [ended_run(test, stretched(scene, factor)) for factor in FACTORS]


def ended_run(test, scene):
    """Return the `EndedRun` of a scene, compared with the states of a `Histories`."""
    path = path_errors(FullOrderField(test.X), history_reference(test), states(test, scene))
    return EndedRun(int(np.isfinite(path.levels[1:]).sum()), path.errors,
                    stress_share(path.stress), path.breakdown)


def states(test, scene):
    """Yield (level or None, bodies) of a full-order run. Raises `NoBody` where it ends before its
    time.
    """
    try:
        for frame in simulate(nsf_full_model(scene).problem):
            yield level_of(frame.t / test.dt), frame.state.bodies
    except Unstable as fault:
        raise NoBody(fault.reason) from fault


def scale_of(study):
    """Describe the size of the runs in words."""
    one = nsf_full_model(study.run(study.test[1]))
    coarse = f", dx and dt {study.coarser} times as long" if study.coarser > 1 else ""
    return f"{len(one.X)} particles, {one.problem.clock.steps} steps{coarse}"


def record(run, target, runs, times, scale):
    """Record the mean error of runs with steps of one length that ended as they should, and how
    many times faster the first is; runs: their `EndedRun`s, times: wall seconds with these steps,
    and with the scene's.
    """
    good = [one for one in runs if not one.reason]
    reasons = sorted({one.reason for one in runs if one.reason})
    ended = f"; {len(runs) - len(good)} end in {' and '.join(reasons)}" if reasons else ""
    note = f"full-order run, {len(good)} of {len(runs)} tests{ended}"
    if good:
        origin, displacement, stress = np.mean(
            [(one.errors.origin, one.errors.displacement, one.stress) for one in good], axis=0)
        run.record(f"{target}.error", 100.0 * origin, unit="%", comparator="info", scale=scale,
                   note=f"{note}; {good[0].states} states; of the displacement "
                        f"{100.0 * displacement:.3g} %, of the stress {100.0 * stress:.3g} %")
    else:
        run.record(f"{target}.ended", len(runs), comparator="info", scale=scale, note=note)
    if np.isfinite(times[0]):
        run.record(f"{target}.speedup", times[1] / times[0], unit="x", comparator="info",
                   scale=scale, note=f"of wall time of the first test: {times[0]:.3g} s")
