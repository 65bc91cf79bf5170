"""The origin of the speed-up of reduced runs, and the error of each part of it: metal frame and
cake at the printed resolution, whole runs, both on the same threads.

Fewer samples, samples with weights in place of drawn ones, and longer steps. Fields are those of
all training runs; `speed` records the share of singular values and return map in a full step.
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
from .errors import MODES, error_rows, mean
from .reduced_runs import FASTER, fit_study
from .studies import cake, metal

REPEATS = DRAWS = 3
DRAWN, WEIGHTED, CELLS = "drawn", "weighed", "cells"    # kinds of samples
KINDS = {DRAWN: "samples drawn", WEIGHTED: "samples with weights at most",
         CELLS: "cells of samples with weights at most"}
COLUMNS = ("samples", "kind", "faster", "kept", "points", "error", "largest", "displacement",
           "stress", "full", "reduced", "speedup")


class RunPlan(NamedTuple):
    """Samples and steps of reduced runs."""

    samples: int            # at most; of CELLS as many cells
    kind: str               # of KINDS
    dt_factor: float        # length of a step over that of the scene

    @property
    def label(self):
        """The plan as a part of an id."""
        return f"{self.kind}.{self.samples}.x{self.dt_factor:g}"

    def apply(self, one):
        """Return a `FittedStudy` with samples of this kind; samples with weights are drawn
        anywhere.
        """
        study = one.study
        if self.kind != DRAWN:
            study = study._replace(column=None, later=None, by_cell=self.kind == CELLS)
        return one._replace(study=study)


PLANS = {
    ("quick", "metal"): (RunPlan(30, DRAWN, 1.0), RunPlan(10, WEIGHTED, 3.0)),
    ("quick", "cake"): (RunPlan(10, CELLS, 1.0),),
    ("standard", "metal"): (
        RunPlan(50, DRAWN, 1.0), RunPlan(30, DRAWN, 1.0), RunPlan(30, DRAWN, FASTER),
        RunPlan(20, WEIGHTED, 1.0), RunPlan(10, WEIGHTED, 1.0), RunPlan(10, WEIGHTED, FASTER),
        RunPlan(10, WEIGHTED, 2.0), RunPlan(10, WEIGHTED, 3.0), RunPlan(10, WEIGHTED, 4.0),
        RunPlan(5, CELLS, 1.0), RunPlan(5, CELLS, 2.0)),
    ("standard", "cake"): (
        RunPlan(700, DRAWN, 1.0), RunPlan(700, DRAWN, FASTER), RunPlan(20, WEIGHTED, 1.0),
        RunPlan(20, CELLS, 1.0), RunPlan(20, CELLS, 2.0), RunPlan(8, CELLS, 1.0),
        RunPlan(8, CELLS, FASTER), RunPlan(8, CELLS, 2.0), RunPlan(8, CELLS, 3.0),
        RunPlan(8, CELLS, 4.0))}
PRINTED = {"metal": RunPlan(30, DRAWN, FASTER),        # of NSF's times
           "cake": RunPlan(700, DRAWN, FASTER)}


@experiment("nsf.factors", title="NSF: where a speed-up comes from",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 2000})
def factors(run):
    """Errors over two tests and several draws; times of the first, medians of runs in turn."""
    rows = [(name, *row) for name, study in studies(run).items()
            for row in record_scene(run, name, study._replace(
                test=study.test[1:run.choose(quick=2, standard=3)]))]
    run.table("ways", ("scene", *COLUMNS), rows)


def studies(run):
    """{name: `NsfStudy`}: metal frame and cake, the latter with more and smoother modes than
    `studies` has for the coarse grid.
    """
    frame, full_cake = run.choose(quick=lambda: (metal(4, train=4), cake(4, train=3)),
                                  standard=lambda: (metal(), cake()))()
    sizes = full_cake.sizes._replace(modes=run.choose(quick=20, standard=80), smoothing=1.0)
    return {"metal": frame, "cake": full_cake._replace(sizes=sizes)}


def record_scene(run, name, study):
    """Record the errors and times of a scene's plans; return their rows."""
    one, plans, rows = fit_study(study), PLANS[run.profile, name], []
    draws = range(run.choose(quick=1, standard=DRAWS))
    full, reduced = median_seconds(one, plans, run.choose(quick=1, standard=REPEATS))
    for plan, seconds in run.progress(list(zip(plans, reduced, strict=True)), f"{name}, errors"):
        runs = error_rows(plan.apply(one), plan.label, plan.samples, draws, plan.dt_factor,
                          plan.kind != DRAWN)
        rows.append((*plan, *mean_row(runs), full, seconds, full / seconds))
        record(run, f"nsf.factors.{name}.{plan.label}", one, rows[-1])
        if plan == PRINTED[name]:
            record_seconds(run, name, one, rows[-1])
    return rows


def median_seconds(one, plans, repeats):
    """Return the seconds of the full-order run of the first test, and of reduced runs by
    `RunPlan`s: medians of runs in turn. The samples are chosen before.
    """
    scene = one.study.run(one.study.test[0])
    still = with_(scene, every=scene.steps, interval=None)
    options = [run_options(one, plan) for plan in plans]
    with one_thread():
        times = [[seconds(lambda: simulate(nsf_full_model(still).problem)),
                  *(seconds(lambda own=own: reduced_run(one, own)) for own in options)]
                 for _ in range(repeats)]
    full, *reduced = np.median(times, axis=0).tolist()
    return full, reduced


def run_options(one, plan):
    """Return the `FieldRunOptions` of a `RunPlan`."""
    scene = nsf_full_model(one.study.run(one.study.test[0]))
    fields = None if plan.kind == DRAWN else one.fields
    sets = plan.apply(one).study.chosen(scene, plan.samples, 0, fields)
    return FieldRunOptions(sets, plan.dt_factor)


def reduced_run(one, options):
    """Return the states of a reduced run of the first test."""
    value = one.study.test[0]
    full = nsf_full_model(one.study.run(value))
    return nsf_run(full, one.fields_of_run(value), options, one.rest).states()


def seconds(make_run):
    """Return the wall seconds of all states that make_run() yields, without those of the call."""
    states = make_run()
    start = perf_counter()
    deque(states, maxlen=0)
    return perf_counter() - start


def mean_row(rows):
    """Return the samples kept, integration points, and errors: the mean, the largest, of the
    displacement, of the stress; means over rows of `errors.COLUMNS`.
    """
    origins = [mean([row], "origin") for row in rows]
    return (mean(rows, "kept"), mean(rows, "points"), float(np.mean(origins)), max(origins),
            mean(rows, "displacement"), mean(rows, "stress"))


def record(run, target, one, row):
    """Record the error and the speed-up of a `RunPlan`."""
    entry = dict(zip(COLUMNS, row, strict=True))
    note = (f"{entry['samples']} {KINDS[entry['kind']]}, {entry['kept']:g} samples on average, "
            f"steps {entry['faster']:g} times as long, {entry['points']:.0f} integration points")
    run.record(f"{target}.error", 100.0 * entry["error"], unit="%", comparator="info",
               scale=one.scale,
               note=f"{note}; the largest {100.0 * entry['largest']:.3g} %, of the displacement "
               f"{100.0 * entry['displacement']:.3g} %, of the stress "
               f"{100.0 * entry['stress']:.3g} %")
    run.record(f"{target}.speedup", entry["speedup"], unit="x", comparator="info", scale=one.scale,
               note=f"{note}; {entry['reduced']:.3g} s beside {entry['full']:.3g} s of the "
                    "full-order run")


def record_seconds(run, name, one, row):
    """Record the seconds of whole runs of the first test beside the printed ones."""
    entry = dict(zip(COLUMNS, row, strict=True))
    for word, key, note in (
            ("time_full", "full", ""),
            (f"time_reduced.{MODES}", "reduced",
             f"{entry['samples']} {KINDS[entry['kind']]}, steps {entry['faster']:g} times as long; "
             )):
        run.record(f"nsf.{name}.{word}", entry[key], unit="s", scale=one.scale,
                   note=f"{note}the first test; printed: a graphics processor")
