"""The data of a study: its runs, read from the folder where `generate` put them."""

import numpy as np

from ...store.results import BadResults, Results
from ..snapshots import Snapshots
from .generate import file_of, finished
from .nsf_dataset import histories
from .tables import NSF


class Missing(ValueError):
    """Runs of a study that are not there, or not finished."""


def load(study, folder, numbers):
    """`Snapshots` of the runs of these numbers, or for NSF's model `Histories`. Raises `Missing`,
    `BadResults` for files that are damaged, no results, or of another scene, and OSError as
    `mapped.empty` does.
    """
    again = f"mpm-ref rom generate {study.path} --out {folder}"
    try:
        lacking = [k for k in numbers
                   if not finished(file_of(folder, k), study.scene(study.mu[k]))]
        if lacking:
            raise Missing(f"{folder} lacks {len(lacking)} of {len(numbers)} runs, the first is "
                          f"{file_of(folder, lacking[0]).name}: {again}")
        return _load(study, folder, numbers)
    except BadResults as fault:
        raise BadResults(f"{fault}; remove the file, and make it again: {again}") from fault


def _load(study, folder, numbers):
    """The same of runs that are there."""
    if study.tables.model == NSF:
        return histories(study, folder, numbers)
    body = study.base.body[0].name
    found = [_read(file_of(folder, k), body) for k in numbers]
    with Results(file_of(folder, numbers[0])) as results:
        m, V0 = (results.field(body, name) for name in ("m", "V0"))
    x, F, v = (np.stack(field) for field in zip(*found, strict=True))
    return Snapshots(x[0, 0].copy(), m, V0, study.mu[list(numbers)], x, F, v, study.base.dt)


def _read(path, body):
    """x, F and v of all frames of a file."""
    with Results(path) as results:
        return tuple(results.field(body, name) for name in ("x", "F", "v"))
