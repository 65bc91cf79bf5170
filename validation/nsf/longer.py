"""Full-order runs with longer steps, as far as they go: what longer steps of reduced runs are to be
seen beside, as a full-order run with them is faster too.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.monitor import Unstable
from mpm_ref.reduced.errors import Errors
from mpm_ref.reduced.inferring import Plan
from mpm_ref.reduced.nsf.evaluate import course, level_of, share
from mpm_ref.reduced.whole import at_once, history, whole
from mpm_ref.rom.placed import NoBody
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

from ..registry import experiment
from ..verification.scenes import with_
from .factors import REPEATS, seconds
from .studies import cake, metal

FACTORS = (1.0, 1.25, 1.5, 2.0, 3.0)        # of the scene's step
COLUMNS = ("scene", "faster", "error", "largest", "displacement", "stress", "seconds", "speedup")


class Found(NamedTuple):
    """Errors of a full-order run; infinite where it ended before its time."""

    errors: Errors
    stress: float
    said: str               # how it ended then


class Itself(NamedTuple):
    """A full-order run in place of fields: what `course` asks of its bodies."""

    X: np.ndarray           # (n, d) points at the start [m]

    def place(self, points, bodies):
        """Positions (n, d) of points."""
        return at_once(bodies, "x")[points]

    def stress(self, points, bodies):
        """Their Kirchhoff stress (n, d, d)."""
        return at_once(bodies, "tau")[points]


@experiment("nsf.longer", title="NSF: full-order runs with longer steps",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def longer(run):
    """Metal frame and cake: errors over two tests beside the runs with the scene's own steps; times
    of the first, medians of runs in turn.
    """
    studies = run.choose(quick=lambda: (metal(4), cake(4)), standard=lambda: (metal(), cake()))()
    rows = []
    for name, study in zip(("metal", "cake"), studies, strict=True):
        values = study.test[1:run.choose(quick=2, standard=3)]
        spent = taken(study.run(values[0]), run.choose(quick=1, standard=REPEATS))
        found = run.progress([ends_of(study, value) for value in values], f"{name}, errors")
        for factor, time, *own in zip(FACTORS, spent, *found, strict=True):
            rows.append((name, *row_of(factor, own), time, spent[0] / time))
            record(run, study, rows[-1], own)
    run.table("steps", COLUMNS, rows)


def stretched(scene, factor):
    """The scene with steps so many times as long, each of which is a frame."""
    return with_(scene, dt=factor * scene.dt, steps=Plan((), factor).steps(scene), every=1,
                 interval=None)


def taken(scene, repeats):
    """Wall seconds of runs with steps of FACTORS: medians of runs in turn; infinite where they end
    before their time.
    """
    still = [with_(own, every=own.steps) for own in (stretched(scene, one) for one in FACTORS)]
    with one_thread():
        found = [[of_run(one) for one in still] for _ in range(repeats)]
    return np.median(found, axis=0).tolist()


def of_run(scene):
    """Wall seconds of a run; infinite where it ends before its time."""
    try:
        return seconds(lambda: simulate(whole(scene).problem))
    except (Unstable, TooLarge):
        return inf


def ends_of(study, value):
    """`Found` of runs with steps of FACTORS of the test with a value, in their order."""
    scene = study.run(value)
    test = history(scene, [value], np.float32, study.spacing)
    return [found(test, stretched(scene, factor)) for factor in FACTORS]


def found(test, scene):
    """`Found` of the run of a scene beside the states of a `Histories`."""
    own, stress = course(Itself(test.X), test.x[0], test.tau[0], states(test, scene))
    return Found(own.errors, share(stress), own.said)


def states(test, scene):
    """Yield (level or None, bodies) of a full-order run. Raises `NoBody` where it ends before its
    time.
    """
    try:
        for frame in simulate(whole(scene).problem):
            yield level_of(frame.t / test.dt), frame.state.bodies
    except (Unstable, TooLarge) as fault:
        raise NoBody(getattr(fault, "reason", fault)) from fault


def row_of(factor, own):
    """Length of the steps and errors: the mean, the largest, of the displacement, of the stress."""
    origins = [one.errors.origin for one in own]
    return (factor, float(np.mean(origins)), max(origins),
            float(np.mean([one.errors.displacement for one in own])),
            float(np.mean([one.stress for one in own])))


def record(run, study, row, own):
    """Record error and time of the runs with steps of one length, of which `own` are `Found`."""
    known = dict(zip(COLUMNS, row, strict=True))
    start = f"nsf.longer.{known['scene']}.{known['faster']:g}"
    said = "; ".join(sorted({one.said for one in own if one.said}))
    how = f"ends in {said}" if said else (
        f"of the displacement {100.0 * known['displacement']:.3g} %, of the stress "
        f"{100.0 * known['stress']:.3g} %")
    scale = f"{len(own)} tests" + (f", dx and dt {study.coarser} times as long"
                                   if study.coarser > 1 else "")
    run.record(f"{start}.error", 100.0 * known["error"], unit="%", comparator="info", scale=scale,
               note=f"full-order run, steps {known['faster']:g} times as long; {how}")
    run.record(f"{start}.speedup", known["speedup"], unit="x", comparator="info", scale=scale,
               note=f"of wall time: {known['seconds']:.3g} s")
