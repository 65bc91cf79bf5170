"""Error and memory of NSF's fields by their size: modes and latent coordinates, compared with the
particles of the full-order run, and the width of networks.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.study.full_model import nsf_full_model

from ..common.registry import experiment
from ..common.rivals import nbytes
from ..common.weights_needed import load_available
from ..extremes.nsf_runs import scenes
from ..nsf.errors import COLUMNS, error_rows, mean, record_mean
from ..nsf.networks import narrow, net_of, trained
from ..nsf.networks_runs import OUTPUTS, TRAINED, fit_to_networks, scale_of, weight_count
from ..nsf.reduced_runs import refit
from .nsf import full_cpu, record_ratio, reduced_cpu

LEVELS = {          # one at a time, from the study's own
    "quick": {"r": (3,), "tau": (10,), "C": (10,), "smoothing": (1.0,)},
    "standard": {"r": (2, 3, 4, 6, 8), "modes": (8, 12, 40), "tau": (5, 10, 20, 80),
                 "C": (5, 10, 20, 80), "smoothing": (1e-8, 1e-6, 1e-4, 1e-2, 1.0, 100.0)}}
NEAR = 2.0          # times the smallest error of all sizes tried
OWN = ("scene", "knob", "r", "modes", "tau", "C", "smoothing", *COLUMNS[1:], "bytes", "bytes_full")


class FieldChange(NamedTuple):
    """Fields that differ from the study's in one size."""

    knob: str
    value: str
    compute: Callable   # () -> `FittedStudy`


@experiment("trade.nsf.sizes", title="NSF: error and memory by latent coordinates and modes",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def sizes_experiment(run):
    """Vary latent coordinates, modes of each field, smoothing, and the precision of modes."""
    rows = []
    for name, one in scenes(run):
        full, errors = particle_bytes(one.study), []
        for change in run.progress(field_changes(one, LEVELS[run.profile]), name):
            found, error = record_change(run, name, change, full)
            rows += found
            errors.append(error)
        record_ratio(run, f"trade.nsf.sizes.{name}.best", (errors[0], min(errors)), NEAR, one.scale,
                     "error with the study's sizes over the smallest with one of them changed")
    run.table("sizes", OWN, rows)


def field_changes(one, levels):
    """Return all `FieldChange`s: the study's own sizes first, single precision last."""
    def with_size(knob, value):
        return lambda: refit(one, one.study.sizes._replace(**{knob: value}), one.study.follows)

    found = [FieldChange(knob, f"{value:g}", with_size(knob, value))
             for knob, values in levels.items() for value in values
             if value != getattr(one.study.sizes, knob)]
    return [FieldChange("own", "sizes", lambda: one), *found,
            FieldChange("precision", "single", lambda: one._replace(fields=one.fields.single()))]


def record_change(run, name, change, full):
    """Record errors and bytes of fields with a `FieldChange`. Returns rows of its runs, and their
    mean error.
    """
    one, knob = change.compute(), change.knob
    size, sizes = nbytes(one.fields), one.study.sizes
    rows = error_rows(one, knob, one.study.samples, range(run.choose(quick=1, standard=3)))
    record_mean(run, f"trade.nsf.sizes.{name}.{knob}.{change.value}", rows, one.scale,
                f"of the stress {100.0 * mean(rows, 'stress'):.3g} %; {size / 1e6:.3g} MB of "
                f"fields, the particles of the full-order run {full / 1e6:.3g} MB",
                comparator="info")
    return [(name, knob, sizes.r, sizes.modes, sizes.tau, sizes.C, sizes.smoothing, *row[1:], size,
             full) for row in rows], mean(rows, "origin")


def particle_bytes(study):
    """Return the bytes of the particles' arrays of a full-order run."""
    problem = nsf_full_model(study.run(study.test[0])).problem
    return sum(nbytes(body.particles) for body in problem.bodies)


DOUBLE = 8              # bytes of a weight
DRAWS, REPEATS = 3, 3   # of samples; of times
WIDTH_COLUMNS = ("width", "bytes", "cpu", "cpu_full", *COLUMNS[1:])


@experiment("trade.nsf.widths", title="NSF: error and cost by the width of networks",
            profiles=("standard",), budget={"standard": 300})
def widths_experiment(run):
    """Run the jelly cube with features, on the usual random samples and on all particles."""
    found = load_available(run, [*narrow(), "jelly-waves"], trained)
    rows = [row for name, model in run.progress(found.items(), "widths")
            for row in record_width(run, net_of(name), model)]
    if len(found) > 1:
        record_gain(run, rows)
    run.table("widths", WIDTH_COLUMNS, rows)


def record_gain(run, rows):
    """Judge whether wider networks err less, by rows of WIDTH_COLUMNS with the samples drawn."""
    width, samples, origin = map(WIDTH_COLUMNS.index, ("width", "samples", "origin"))
    few, widths = min(row[samples] for row in rows), sorted({row[width] for row in rows})
    by_width = {w: [row[origin] for row in rows if (row[width], row[samples]) == (w, few)]
                for w in widths}
    errors = [float(np.mean(own)) for own in by_width.values()]
    worst = max(zip(errors[1:], errors[:-1], strict=True), key=lambda pair: pair[0] / pair[1])
    record_ratio(run, "trade.nsf.widths.falls", worst, 1.0, f"widths {widths}",
                 "error of networks over that of the next narrower ones, the largest")


def record_width(run, net, model):
    """Record errors and cost of a `Net`. Returns its rows."""
    one, width = fit_to_networks(model, net.study), net.g.width
    scale, few = scale_of(net, one), net.study.samples
    size = DOUBLE * sum(weight_count(net.study, own, width, net.octaves if own != "g" else 0)
                        for own in OUTPUTS)
    cpu, full = reduced_cpu(one, few, False, REPEATS), full_cpu(one)
    drawn = error_rows(one, f"{width} wide", few, range(DRAWS))
    every = error_rows(one, f"{width} wide", len(one.fields.X), (0,))
    for word, rows, note in (("", drawn, f"{few} samples; {cpu:.3g} CPU s beside {full:.3g} of the "
                              f"full-order run, {size / 1e3:.3g} kB of weights"),
                             (".all", every, "all particles are samples")):
        record_mean(run, f"trade.nsf.widths.{width}{word}", rows, scale,
              f"{note}; of the stress {100.0 * mean(rows, 'stress'):.3g} %", **TRAINED)
    return [(width, size, cpu, full, *row[1:]) for row in drawn + every]
