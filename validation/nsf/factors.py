"""Where a speed-up of reduced runs comes from, and what each part of it costs in error: the metal
frame at the printed resolution, whole runs, both on the same threads.

Fewer samples, samples with weights in place of drawn ones, and longer steps. Fields are those of
all training runs; what singular values and return map take of a full step is told by `speed`.
"""

from collections import deque
from time import perf_counter
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.reduced.inferring import Plan, infer
from mpm_ref.reduced.whole import whole
from mpm_ref.simulate import simulate

from ..registry import experiment
from ..verification.scenes import with_
from .errors import mean, rows_of
from .studies import metal
from .tested import FASTER, tested

REPEATS = 3
COLUMNS = ("samples", "weighed", "faster", "kept", "points", "error", "largest", "displacement",
           "stress", "full", "reduced", "speedup")


class Way(NamedTuple):
    """How reduced runs are made."""

    samples: int            # at most
    weighed: bool           # whether they have weights by cubature
    faster: float           # length of a step over that of the scene

    @property
    def words(self):
        """As a part of an id."""
        return f"{'weighed' if self.weighed else 'drawn'}.{self.samples}.{self.faster:g}"


WAYS = {"quick": (Way(30, False, 1.0), Way(10, True, 3.0)),
        "standard": (Way(50, False, 1.0), Way(30, False, 1.0), Way(30, False, FASTER),
                     Way(20, True, 1.0), Way(10, True, 1.0), Way(10, True, FASTER),
                     Way(10, True, 2.0), Way(10, True, 3.0), Way(10, True, 4.0))}


@experiment("nsf.factors", title="NSF: where a speed-up comes from",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def factors(run):
    """Errors over two tests, one draw; times of the first, medians of runs in turn."""
    study = run.choose(quick=lambda: metal(4, train=4), standard=metal)()
    one = tested(study._replace(test=study.test[1:run.choose(quick=2, standard=3)]))
    ways = WAYS[run.profile]
    full, reduced = taken(one, ways, run.choose(quick=1, standard=REPEATS))
    rows = []
    for way, seconds in run.progress(list(zip(ways, reduced, strict=True)), "errors"):
        found = rows_of(one, way.words, way.samples, (0,), way.faster, way.weighed)
        rows.append((*way, *row_of(found), full, seconds, full / seconds))
        record(run, one, way, rows[-1])
    run.table("ways", COLUMNS, rows)


def taken(one, ways, repeats):
    """Seconds of the full-order run of the first test, and of reduced runs by `Way`s: medians of
    runs in turn. The samples are chosen before.
    """
    scene = one.study.run(one.study.test[0])
    still = with_(scene, every=scene.steps, interval=None)
    plans = [plan_of(one, way) for way in ways]
    with one_thread():
        found = [[seconds(lambda: simulate(whole(still).problem)),
                  *(seconds(lambda plan=plan: reduced_run(one, plan)) for plan in plans)]
                 for _ in range(repeats)]
    full, *reduced = np.median(found, axis=0).tolist()
    return full, reduced


def plan_of(one, way):
    """`Plan` of a `Way`."""
    scene = whole(one.study.run(one.study.test[0]))
    sets = one.study.chosen(scene, way.samples, 0, one.fields if way.weighed else None)
    return Plan(sets, way.faster)


def reduced_run(one, plan):
    """The states of a reduced run of the first test."""
    value = one.study.test[0]
    return infer(whole(one.study.run(value)), one.of(value), plan, one.rest)


def seconds(made):
    """Wall seconds of all states that made() yields; what makes them is not counted."""
    states = made()
    start = perf_counter()
    deque(states, maxlen=0)
    return perf_counter() - start


def row_of(found):
    """Samples kept, integration points, and errors: the mean, the largest, of the displacement, of
    the stress; means over rows of `errors.COLUMNS`.
    """
    origins = [mean([row], "origin") for row in found]
    return (mean(found, "kept"), mean(found, "points"), float(np.mean(origins)), max(origins),
            mean(found, "displacement"), mean(found, "stress"))


def record(run, one, way, row):
    """Record error and speed-up of a `Way`, with what belongs to them."""
    known = dict(zip(COLUMNS, row, strict=True))
    id, kind = f"nsf.factors.{way.words}", "with weights" if way.weighed else "drawn"
    note = (f"{known['kept']:g} samples {kind}, steps {way.faster:g} times as long, "
            f"{known['points']:.0f} integration points")
    run.record(f"{id}.error", 100.0 * known["error"], unit="%", comparator="info", scale=one.scale,
               note=f"{note}; the largest {100.0 * known['largest']:.3g} %, of the displacement "
                    f"{100.0 * known['displacement']:.3g} %, of the stress "
                    f"{100.0 * known['stress']:.3g} %")
    run.record(f"{id}.speedup", known["speedup"], unit="x", comparator="info", scale=one.scale,
               note=f"{note}; {known['reduced']:.3g} s beside {known['full']:.3g} s of the "
                    "full-order run")
