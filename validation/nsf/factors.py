"""Where a speed-up of reduced runs comes from, and what each part of it costs in error: metal frame
and cake at the printed resolution, whole runs, both on the same threads.

Fewer samples, samples with weights in place of drawn ones, and longer steps. Fields are those of
all training runs; what singular values and return map take of a full step is told by `speed`.
"""

from collections import deque
from time import perf_counter
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import with_
from .errors import mean, rows_of
from .reduced_runs import FASTER, tested
from .studies import cake, metal

REPEATS = DRAWS = 3
DRAWN, WEIGHED, CELLS = "drawn", "weighed", "cells"     # kinds of samples
KINDS = {DRAWN: "samples drawn", WEIGHED: "samples with weights at most",
         CELLS: "cells of samples with weights at most"}
COLUMNS = ("samples", "kind", "faster", "kept", "points", "error", "largest", "displacement",
           "stress", "full", "reduced", "speedup")


class Way(NamedTuple):
    """How reduced runs are made."""

    samples: int            # at most; of CELLS as many cells
    kind: str               # of KINDS
    faster: float           # length of a step over that of the scene

    @property
    def words(self):
        """As a part of an id."""
        return f"{self.kind}.{self.samples}.x{self.faster:g}"

    def of(self, one):
        """`Tested` with samples of this kind, whose weights are of samples anywhere."""
        study = one.study
        if self.kind != DRAWN:
            study = study._replace(column=None, later=None, by_cell=self.kind == CELLS)
        return one._replace(study=study)


WAYS = {("quick", "metal"): (Way(30, DRAWN, 1.0), Way(10, WEIGHED, 3.0)),
        ("quick", "cake"): (Way(10, CELLS, 1.0),),
        ("standard", "metal"): (
            Way(50, DRAWN, 1.0), Way(30, DRAWN, 1.0), Way(30, DRAWN, FASTER), Way(20, WEIGHED, 1.0),
            Way(10, WEIGHED, 1.0), Way(10, WEIGHED, FASTER), Way(10, WEIGHED, 2.0),
            Way(10, WEIGHED, 3.0), Way(10, WEIGHED, 4.0), Way(5, CELLS, 1.0), Way(5, CELLS, 2.0)),
        ("standard", "cake"): (
            Way(700, DRAWN, 1.0), Way(700, DRAWN, FASTER), Way(20, WEIGHED, 1.0),
            Way(20, CELLS, 1.0), Way(20, CELLS, 2.0), Way(8, CELLS, 1.0), Way(8, CELLS, FASTER),
            Way(8, CELLS, 2.0), Way(8, CELLS, 3.0), Way(8, CELLS, 4.0))}


PRINTED = {"metal": Way(30, DRAWN, FASTER), "cake": Way(700, DRAWN, FASTER)}   # of NSF's times


@experiment("nsf.factors", title="NSF: where a speed-up comes from",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 2000})
def factors(run):
    """Errors over two tests and several draws; times of the first, medians of runs in turn."""
    rows = [(name, *row) for name, study in studies(run).items()
            for row in of_scene(run, name, study._replace(
                test=study.test[1:run.choose(quick=2, standard=3)]))]
    run.table("ways", ("scene", *COLUMNS), rows)


def studies(run):
    """{name: `Study`}: metal frame and cake, the latter with more and smoother modes than `studies`
    has for the coarse grid.
    """
    frame, whole_cake = run.choose(quick=lambda: (metal(4, train=4), cake(4, train=3)),
                                   standard=lambda: (metal(), cake()))()
    sizes = whole_cake.sizes._replace(modes=run.choose(quick=20, standard=80), smoothing=1.0)
    return {"metal": frame, "cake": whole_cake._replace(sizes=sizes)}


def of_scene(run, name, study):
    """Record all ways of a scene; their rows."""
    one, ways, rows = tested(study), WAYS[run.profile, name], []
    draws = range(run.choose(quick=1, standard=DRAWS))
    full, reduced = taken(one, ways, run.choose(quick=1, standard=REPEATS))
    for way, seconds in run.progress(list(zip(ways, reduced, strict=True)), f"{name}, errors"):
        found = rows_of(way.of(one), way.words, way.samples, draws, way.faster, way.kind != DRAWN)
        rows.append((*way, *row_of(found), full, seconds, full / seconds))
        record(run, f"nsf.factors.{name}.{way.words}", one, rows[-1])
        if way == PRINTED[name]:
            record_seconds(run, name, one, rows[-1])
    return rows


def taken(one, ways, repeats):
    """Seconds of the full-order run of the first test, and of reduced runs by `Way`s: medians of
    runs in turn. The samples are chosen before.
    """
    scene = one.study.run(one.study.test[0])
    still = with_(scene, every=scene.steps, interval=None)
    plans = [plan_of(one, way) for way in ways]
    with one_thread():
        found = [[seconds(lambda: simulate(nsf_full_model(still).problem)),
                  *(seconds(lambda plan=plan: reduced_run(one, plan)) for plan in plans)]
                 for _ in range(repeats)]
    full, *reduced = np.median(found, axis=0).tolist()
    return full, reduced


def plan_of(one, way):
    """`FieldRunOptions` of a `Way`."""
    scene = nsf_full_model(one.study.run(one.study.test[0]))
    by = None if way.kind == DRAWN else one.fields
    sets = way.of(one).study.chosen(scene, way.samples, 0, by)
    return FieldRunOptions(sets, way.faster)


def reduced_run(one, plan):
    """The states of a reduced run of the first test."""
    value = one.study.test[0]
    full = nsf_full_model(one.study.run(value))
    return nsf_run(full, one.of(value), plan, one.rest).states()


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


def record(run, id, one, row):
    """Record error and speed-up of a `Way`, with what belongs to them."""
    known = dict(zip(COLUMNS, row, strict=True))
    note = (f"{known['samples']} {KINDS[known['kind']]}, {known['kept']:g} samples on average, "
            f"steps {known['faster']:g} times as long, {known['points']:.0f} integration points")
    run.record(f"{id}.error", 100.0 * known["error"], unit="%", comparator="info", scale=one.scale,
               note=f"{note}; the largest {100.0 * known['largest']:.3g} %, of the displacement "
                    f"{100.0 * known['displacement']:.3g} %, of the stress "
                    f"{100.0 * known['stress']:.3g} %")
    run.record(f"{id}.speedup", known["speedup"], unit="x", comparator="info", scale=one.scale,
               note=f"{note}; {known['reduced']:.3g} s beside {known['full']:.3g} s of the "
                    "full-order run")


def record_seconds(run, name, one, row):
    """Record the seconds of whole runs of the first test beside the printed ones."""
    known = dict(zip(COLUMNS, row, strict=True))
    for word, key, note in (
            ("time_full", "full", ""),
            ("time_reduced", "reduced", f"{known['samples']} {KINDS[known['kind']]}, steps "
                                        f"{known['faster']:g} times as long; ")):
        run.record(f"nsf.{name}.{word}", known[key], unit="s", comparator="info", scale=one.scale,
                   note=f"{note}the first test; printed: a graphics processor")
