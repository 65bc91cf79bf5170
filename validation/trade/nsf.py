"""Error and cost of reduced runs with network stress, by their samples and by their time step."""

from collections import deque
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import with_
from ..extremes.nsf_runs import scenes
from ..extremes.outcome import outcome
from ..ldm.timing import timed
from ..nsf.errors import COLUMNS, error_rows, mean, record_mean, weights_note
from ..nsf.reduced_runs import FASTER
from .front import front

COUNTS = {"quick": (10, 50), "standard": (5, 10, 20, 30, 50, 100, 200, 400)}
CELLS = "cells"         # the points of so many
DRAWS = {"quick": 1, "standard": 5}
WEIGHTED = {"random": False, "cubature": True, CELLS: True}     # kinds of samples
DESCRIPTIONS = {"random": "samples, random", "cubature": "samples, cubature",
        CELLS: "cells, cubature of their points"}
ENOUGH = 1.5            # times the error with all particles as samples
FACTORS = (1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)    # of the scene's step
WORDS = "the full-order run {:.3g} CPU s, the reduced one {:.3g}"


class Sampling(NamedTuple):
    """Samples of a scene's runs."""

    scene: str
    kind: str           # of WEIGHTED
    count: int          # at most


@experiment("trade.nsf.samples", title="NSF: error and cost by number and kind of samples",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 1700})
def samples_experiment(run):
    """Compare several draws of random samples with samples weighted by cubature, point by point or
    cell by cell.
    """
    rows = []
    for name, one in scenes(run):
        full, found = full_cpu(one), []
        settings = [Sampling(name, kind, count) for count in COUNTS[run.profile]
                    for kind in WEIGHTED]
        every = Sampling(name, "random", len(one.fields.X))
        for sampling in run.progress([*settings, every], name):
            found.append(record_samples(run, one, sampling, full))
        record_sampling(run, one, dict(zip([*settings, every], (own for own, _ in found),
                                           strict=True)))
        best = front([cpu for _, cpu in found], [mean(own, "origin") for own, _ in found])
        rows += [(name, *row, cpu, full, int(on))
                 for (own, cpu), on in zip(found, best, strict=True) for row in own]
    run.table("samples", ("scene", *COLUMNS, "cpu", "cpu_full", "pareto"), rows)


def record_samples(run, one, sampling, full):
    """Record the errors with a `Sampling`. Returns rows of all runs, and CPU seconds of one."""
    scene, kind, count = sampling
    one = one._replace(study=one.study._replace(by_cell=kind == CELLS))
    draws = range(DRAWS[run.profile] if count < len(one.fields.X) else 1)
    rows = error_rows(one, kind, count, draws, weighted=WEIGHTED[kind])
    cpu = reduced_cpu(one, count, WEIGHTED[kind], run.choose(quick=1, standard=3))
    what = DESCRIPTIONS[kind] + (f", {weights_note(rows)}" if WEIGHTED[kind] else "")
    record_mean(run, f"trade.nsf.samples.{scene}.{kind}.{count}", rows, one.scale,
                f"{count} {what}; of the stress {100.0 * mean(rows, 'stress'):.3g} %; "
                f"{mean(rows, 'points'):.0f} integration points; {WORDS.format(full, cpu)}",
                comparator="info")
    return rows, cpu


def record_sampling(run, one, rows):
    """Judge the study's number of samples, and weights, by the rows of {`Sampling`: rows}."""
    error = {(sampling.kind, sampling.count): mean(own, "origin") for sampling, own in rows.items()}
    scene, counts, every = next(iter(rows)).scene, COUNTS[run.profile], len(one.fields.X)
    few = min((count for count in counts if count >= one.study.samples), default=max(counts))
    record_ratio(run, f"trade.nsf.samples.{scene}.enough", (error["random", few],
                                                            error["random", every]), ENOUGH,
                 one.scale, f"error with {few} random samples, the study's number or the next "
                 "that is tried, over that with all")
    gains = [error["cubature", count] / error["random", count] for count in counts
             if count >= few or count == max(counts)]
    run.record(f"trade.nsf.samples.{scene}.weights", float(np.median(gains)), unit="1",
               comparator="<=", bound=1.0, scale=one.scale,
               note=f"error with weights over that of as many random samples, median over {few} "
               "samples and more")


def record_ratio(run, target, errors, bound, scale, note):
    """Judge the ratio of two errors, which is not to exceed a bound."""
    over, under = errors
    run.record(target, over / under, unit="1", comparator="<=", bound=bound, scale=scale, note=note)


def full_cpu(one):
    """Return the CPU seconds of the steps of the full-order run of the first test."""
    scene = one.study.run(one.study.test[0])
    problem = nsf_full_model(with_(scene, every=scene.steps, interval=None)).problem
    return timed(lambda: deque(simulate(problem), maxlen=0))[1].cpu


def reduced_cpu(one, count, weighted, repeats):
    """Return the median CPU seconds of reduced runs of the first test, without the choice of
    samples; infinite where they break down.
    """
    value = one.study.test[0]
    scene, fields = nsf_full_model(one.study.run(value)), one.fields_of_run(value)
    plan = FieldRunOptions(one.study.chosen(scene, count, 0, one.fields if weighted else None))
    try:
        with one_thread():
            seconds = [timed(lambda: deque(nsf_run(scene, fields, plan, one.rest).states(),
                                             maxlen=0))[1].cpu for _ in range(repeats)]
    except BREAKDOWNS:
        return np.inf
    return float(np.median(seconds))


@experiment("trade.nsf.dt", title="NSF: error by the length of the step",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 120})
def steps_experiment(run):
    """Lengthen the step until a run breaks down, and compare with the end of the full-order run."""
    rows = []
    for name, one in scenes(run):
        draws, errors = range(run.choose(quick=1, standard=3)), {}
        for factor in run.progress(FACTORS, name):
            found = error_rows(one, "modal", one.study.samples, draws, factor)
            full_kind = full_order_end(one.study.run(one.study.test[0]), factor)
            record_mean(run, f"trade.nsf.dt.{name}.x{factor:g}", found, one.scale,
                        f"steps {factor:g} times as long, {one.study.samples} samples; "
                        f"the full-order run: {full_kind}", comparator="info")
            rows += [(name, *row, full_kind) for row in found]
            errors[factor] = mean(found, "origin")
            if not all(np.isfinite(row[COLUMNS.index("origin")]) for row in found):
                break
        record_ratio(run, f"trade.nsf.dt.{name}.printed", (errors.get(FASTER, np.inf), errors[1.0]),
                     FASTER, one.scale, f"error in steps {FASTER:g} times as long, as the paper's, "
                     "over that in the scene's own; of first order in the step it would be as much")
    run.table("steps", ("scene", *COLUMNS, "full"), rows)


def full_order_end(scene, factor):
    """Return the kind of end of a full-order run with a step `factor` times as long."""
    steps = round(scene.steps / factor)
    longer = with_(scene, dt=factor * scene.dt, steps=steps, every=steps, interval=None)
    return outcome(nsf_full_model(longer).problem).kind
