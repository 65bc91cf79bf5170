"""What the sizes of NSF's fields of modes give, and the memory they take beside that of the
full-order run's particles.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.study.full_model import nsf_full_model

from ..common.registry import experiment
from ..extremes.nsf_runs import scenes
from ..nsf.errors import COLUMNS, error_rows, mean, record_mean
from ..nsf.reduced_runs import refit

LEVELS = {          # one at a time, from the study's own
    "quick": {"r": (3,), "tau": (10,), "C": (10,), "smoothing": (1.0,)},
    "standard": {"r": (2, 3, 4, 6, 8), "modes": (8, 12, 40), "tau": (5, 10, 20, 80),
                 "C": (5, 10, 20, 80), "smoothing": (1e-8, 1e-6, 1e-4, 1e-2, 1.0, 100.0)}}
OWN = ("scene", "knob", "r", "modes", "tau", "C", "smoothing", *COLUMNS[1:], "bytes", "bytes_full")


class Change(NamedTuple):
    """Fields that differ from the study's in one way."""

    knob: str
    value: str
    made: Callable      # () -> `FittedStudy`


@experiment("trade.nsf.sizes", title="NSF: error and memory by latent coordinates and modes",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def of_sizes(run):
    """Latent coordinates, modes of each field, smoothing, and modes in single precision."""
    rows = []
    for name, one in scenes(run):
        full = particle_bytes(one.study)
        for change in run.progress(changes(one, LEVELS[run.profile]), name):
            rows += of_change(run, name, change, full)
    run.table("sizes", OWN, rows)


def changes(one, levels):
    """[`Change`] of all changes, the study's own sizes first and modes in single precision last."""
    def with_size(knob, value):
        return lambda: refit(one, one.study.sizes._replace(**{knob: value}), one.study.follows)

    found = [Change(knob, f"{value:g}", with_size(knob, value)) for knob, values in levels.items()
             for value in values if value != getattr(one.study.sizes, knob)]
    return [Change("own", "sizes", lambda: one), *found,
            Change("precision", "single", lambda: one._replace(fields=one.fields.single()))]


def of_change(run, name, change, full):
    """Record errors and bytes of a scene's fields with a `Change`; rows of its runs."""
    one, knob = change.made(), change.knob
    size, sizes = nbytes(one.fields), one.study.sizes
    rows = error_rows(one, knob, one.study.samples, range(run.choose(quick=1, standard=3)))
    record_mean(run, f"trade.nsf.sizes.{name}.{knob}.{change.value}", rows, one.scale,
                f"of the stress {100.0 * mean(rows, 'stress'):.3g} %; {size / 1e6:.3g} MB of "
                f"fields, the particles of the full-order run {full / 1e6:.3g} MB",
                comparator="info")
    return [(name, knob, sizes.r, sizes.modes, sizes.tau, sizes.C, sizes.smoothing, *row[1:], size,
             full) for row in rows]


def nbytes(record):
    """Bytes of all arrays of nested records, each counted once."""
    return sum(a.nbytes for a in {id(a): a for a in arrays_of(record)}.values())


def arrays_of(record):
    """Yield the arrays of nested records."""
    for a in record:
        if isinstance(a, np.ndarray):
            yield a
        elif isinstance(a, tuple):
            yield from arrays_of(a)


def particle_bytes(study):
    """Bytes of the particles' arrays of a full-order run."""
    problem = nsf_full_model(study.run(study.test[0])).problem
    return sum(nbytes(body.particles) for body in problem.bodies)
