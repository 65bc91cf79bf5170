"""Full-order runs with longer steps, as far as they go: what longer steps of reduced runs are to be
seen beside, as a full-order run with them is faster too.

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
from mpm_ref.rom.study.run import step_count
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import with_
from .factors import REPEATS, seconds
from .studies import cake, metal

FACTORS = (1.0, 1.25, 1.5, 2.0, 3.0)        # of the scene's step
COLUMNS = ("scene", "value", "faster", "states", "origin", "displacement", "stress", "seconds",
           "speedup")                       # times are those of the first test


class Ended(NamedTuple):
    """How a full-order run ended."""

    states: int             # that were compared
    errors: PositionErrors          # infinite where it ended before its time
    stress: float           # of the Kirchhoff stress, over its norm; likewise
    said: str               # why it ended then


class Itself(NamedTuple):
    """A full-order run in place of fields: what `path_errors` asks of its bodies."""

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
        spent = taken(study.run(values[0]), run.choose(quick=1, standard=REPEATS))
        ended = run.progress([ends_of(study, value) for value in values], f"{name}, errors")
        for factor, time, *own in zip(FACTORS, spent, *ended, strict=True):
            record(run, f"nsf.longer.{name}.x{factor:g}", own, (time, spent[0]), scale_of(study))
            rows += [(name, value, factor, one.states, one.errors.origin, one.errors.displacement,
                      one.stress, time, spent[0] / time)
                     for value, one in zip(values, own, strict=True)]
    run.table("steps", COLUMNS, rows)


def stretched(scene, factor):
    """The scene with steps so many times as long, each of which is a frame."""
    return with_(scene, dt=factor * scene.dt, steps=step_count(scene, factor), every=1,
                 interval=None, unstable="allow")


def taken(scene, repeats):
    """Wall seconds of runs with steps of FACTORS: medians of runs in turn; infinite where they end
    before their time.
    """
    still = [with_(own, every=own.steps) for own in (stretched(scene, one) for one in FACTORS)]
    with one_thread():
        spent = [[of_run(one) for one in still] for _ in range(repeats)]
    return np.median(spent, axis=0).tolist()


def of_run(scene):
    """Wall seconds of a run; infinite where it ends before its time."""
    try:
        return seconds(lambda: simulate(nsf_full_model(scene).problem))
    except Unstable:
        return inf


def ends_of(study, value):
    """`Ended` of runs with steps of FACTORS of the test with a value, in their order."""
    scene = study.run(value)
    test = simulate_history(scene, [value], np.float32, study.spacing)
    return [end_of(test, stretched(scene, factor)) for factor in FACTORS]


def end_of(test, scene):
    """`Ended` of the run of a scene beside the states of a `Histories`."""
    own = path_errors(Itself(test.X), history_reference(test), states(test, scene))
    return Ended(int(np.isfinite(own.levels[1:]).sum()), own.errors, stress_share(own.stress),
                 own.breakdown)


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
    """What is run, in words."""
    one = nsf_full_model(study.run(study.test[1]))
    coarse = f", dx and dt {study.coarser} times as long" if study.coarser > 1 else ""
    return f"{len(one.X)} particles, {one.problem.clock.steps} steps{coarse}"


def record(run, start, own, times, scale):
    """Record the mean error of runs with steps of one length that ended as they should, and how
    many times faster the first is; own: their `Ended`, times: wall seconds with these steps, and
    with the scene's.
    """
    good, said = [one for one in own if not one.said], {one.said for one in own if one.said}
    ended = f"; {len(own) - len(good)} end in {' and '.join(sorted(said))}" if said else ""
    note = f"full-order run, {len(good)} of {len(own)} tests{ended}"
    if good:
        origin, displacement, stress = np.mean(
            [(one.errors.origin, one.errors.displacement, one.stress) for one in good], axis=0)
        run.record(f"{start}.error", 100.0 * origin, unit="%", comparator="info", scale=scale,
                   note=f"{note}; {good[0].states} states; of the displacement "
                        f"{100.0 * displacement:.3g} %, of the stress {100.0 * stress:.3g} %")
    else:
        run.record(f"{start}.ended", len(own), comparator="info", scale=scale, note=note)
    if np.isfinite(times[0]):
        run.record(f"{start}.speedup", times[1] / times[0], unit="x", comparator="info",
                   scale=scale, note=f"of wall time of the first test: {times[0]:.3g} s")
