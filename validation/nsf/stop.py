"""The end of Gauss-Newton (NSF-eq10, section 5.3): with a tolerance on the change of the latent
coordinates beside none, with which only round-off is left to gain.

The bounds were set when trials of the same cases were known: with 1e-6 the errors of positions and
stress change by at most 1e-3 of themselves, and a run's median step takes at most the 3 iterations
that the paper prints.
"""

from itertools import islice
from time import process_time
from typing import NamedTuple

import numba
import numpy as np

from mpm_ref.core.jit import set_threads
from mpm_ref.rom.study.evaluate import history_reference, level_of, path_errors, stress_share
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run

from ..common.registry import experiment
from .reduced_runs import fit_study
from .studies import jelly, metal

NONE, JUDGED = "none", "1e-6"
TOLERANCES = {NONE: None, JUDGED: 1e-6, "1e-4": 1e-4}
MOST_CHANGE = 1e-3
MOST_ITERATIONS = 3
TESTS = 2               # of a scene, at most
STEPS = 60              # timed, from the start
COLUMNS = ("scene", "value", "draw", "tolerance", "origin", "stress", "mean", "median", "most")


class StoppedRun(NamedTuple):
    """Errors and iterations of a reduced run."""

    origin: float       # of positions, of the distance from the origin (NSF-eq11)
    stress: float       # of the Kirchhoff stress, over its norm
    mean: float         # iterations of a step
    median: float
    most: float


@experiment("nsf.stop", title="NSF: where Gauss-Newton ends",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 300})
def stop(run):
    """Jelly cube and metal frame, the usual samples drawn at random, with the scene's own steps, on
    one thread.
    """
    studies = run.choose(quick=lambda: (jelly(4), metal(4, train=4)),
                         standard=lambda: (jelly(), metal(2)))()
    threads, rows = numba.get_num_threads(), []
    set_threads(1)
    try:
        for name, study in zip(("jelly", "metal"), run.progress(studies, "scenes"), strict=True):
            rows += record_scene(run, name, fit_study(study))
    finally:
        set_threads(threads)
    run.table("runs", COLUMNS, rows)


def record_scene(run, name, one):
    """Record the numbers of a `FittedStudy`; return rows of COLUMNS."""
    draws, repeats = run.choose(quick=(1, 1), standard=(3, 7))
    cases = [(value, draw) for value in one.study.test[:TESTS] for draw in range(draws)]
    runs = {(*case, word): stopped_run(one, case, tolerance)
            for case in run.progress(cases, "runs") for word, tolerance in TOLERANCES.items()}
    times = step_times(one, cases[0], repeats)
    for word in TOLERANCES:
        own = {case: runs[*case, word] for case in cases}
        before = {case: runs[*case, NONE] for case in cases}
        id = f"nsf.stop.{name}.{word}"
        record_iterations(run, id, list(own.values()), one.scale)
        if word != NONE:
            record_change(run, id, largest_change(own, before), one.scale)
            run.record(f"{id}.cost", times[word] / times[NONE], unit="x", comparator="info",
                       scale=one.scale, note="CPU time of a step over that without a tolerance, "
                       f"median of {repeats} in turn, one thread, {STEPS} steps at most")
    return [(name, *key, *found) for key, found in runs.items()]


def options_of(one, case, tolerance):
    """Return the `FullModel` of a case, (value, draw), and its `FieldRunOptions`."""
    value, draw = case
    full = nsf_full_model(one.study.run(value))
    return full, FieldRunOptions(one.study.chosen(full, one.study.samples, draw),
                                 inversion_tolerance=tolerance)


def stopped_run(one, case, tolerance):
    """Return the `StoppedRun` of a `FittedStudy` and a case, (value, draw)."""
    full, options = options_of(one, case, tolerance)
    fields, test, iterations = one.fields_of_run(case[0]), one.tests[case[0]], []

    def states():
        for t, latent, report, _ in nsf_run(full, fields, options, one.rest).states():
            iterations.extend(() if report is None else (report.iterations,))
            yield level_of(t / test.dt), latent.xhat

    path = path_errors(fields, history_reference(test), states())
    return StoppedRun(path.errors.origin, stress_share(path.stress), float(np.mean(iterations)),
                      float(np.median(iterations)), float(np.max(iterations)))


def step_times(one, case, repeats):
    """Return {word of TOLERANCES: CPU seconds of a step} of a case: medians of runs in turn."""
    found = [[step_seconds(one, case, tolerance) for tolerance in TOLERANCES.values()]
             for _ in range(repeats)]
    return dict(zip(TOLERANCES, np.median(found, axis=0).tolist(), strict=True))


def step_seconds(one, case, tolerance):
    """Return the CPU seconds of a step of a case, of the first steps."""
    full, options = options_of(one, case, tolerance)
    states = nsf_run(full, one.fields_of_run(case[0]), options, one.rest).states()
    next(states)
    start = process_time()
    count = sum(1 for _ in islice(states, STEPS))
    return (process_time() - start) / count


def largest_change(runs, before):
    """Return the largest change of an error of {case: `StoppedRun`}, over that error before."""
    return max(abs(getattr(own, name) / getattr(before[case], name) - 1.0)
               for case, own in runs.items() for name in ("origin", "stress"))


def record_change(run, target, change, scale):
    """Record the largest change of errors; of the tolerance JUDGED with a bound."""
    rule = ({"comparator": "<=", "bound": MOST_CHANGE} if target.endswith(f".{JUDGED}")
            else {"comparator": "info"})
    run.record(f"{target}.change", change, scale=scale, scatter=1.0, **rule,
               note="largest change of the error of positions or stress in a run, over that "
                    "without a tolerance")


def record_iterations(run, target, runs, scale):
    """Record the largest median of iterations of `StoppedRun`s; of JUDGED with a bound."""
    rule = ({"comparator": "<=", "bound": MOST_ITERATIONS} if target.endswith(f".{JUDGED}")
            else {"comparator": "info"})
    run.record(f"{target}.iterations", max(one.median for one in runs), scale=scale, **rule,
               note="largest median over a run's steps; in the mean "
                    f"{np.mean([one.mean for one in runs]):.3g}, the most in any step "
                    f"{max(one.most for one in runs):g}; error of positions in the mean "
                    f"{100.0 * np.mean([one.origin for one in runs]):.5g} %")
