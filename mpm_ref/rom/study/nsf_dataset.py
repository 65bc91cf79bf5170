"""The full-order runs of a study as what its fields are made of, a frame at a time."""

import numpy as np

from ...store.memmap import empty
from ...store.results import Results
from ..snapshots import Histories
from ..symmetric import values
from .generate import file_of
from .nsf_case import whole


def histories(study, folder, numbers, kind=np.float32):
    """`Histories` of the finished runs of these numbers, stored as numbers of a kind; dt is from
    one of the states kept to the next. Raises ValueError as `whole` does, OSError as
    `mapped.empty` does, and `BadResults`.
    """
    runs = [whole(study.scene(study.mu[k])) for k in numbers]
    base, (n, d) = study.base, runs[0].X.shape
    levels = base.steps // base.every + 1
    x, C = (empty((len(runs), levels, n, k), kind) for k in (d, d * d))
    tau = empty((len(runs), levels, n, d * (d + 1) // 2), kind)
    for run, k in enumerate(numbers):
        with Results(file_of(folder, k)) as results:
            for level in range(levels):
                x[run, level] = at_once(results, "x", level)
                tau[run, level] = values(at_once(results, "tau", level))
                C[run, level] = at_once(results, "C", level).reshape(n, -1)
    matter = runs[0].matter
    return Histories(runs[0].X, matter.m, matter.V0, np.stack([one.matter.v for one in runs]),
                     study.mu[list(numbers)], x, tau, C, base.every * base.dt)


def at_once(results, name, frame):
    """A field of all bodies of a results file in a frame, one after the other."""
    return np.concatenate([results.field(body, name, frame) for body in results.bodies])
