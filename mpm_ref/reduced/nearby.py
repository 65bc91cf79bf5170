"""The training run whose parameters are nearest to those of a run that was held out, taken for it
as it is: what no reduced run should be farther off than.
"""

from typing import NamedTuple

import numpy as np

from ..store.results import Results
from .errors import Errors, Squares
from .generate import file_of, finished
from .nsf.dataset import at_once
from .tables import NSF


class Nearby(NamedTuple):
    """A training run beside a run that was held out."""

    number: int             # of the one that was held out
    taken: int              # of the training run
    errors: Errors | None   # None where its data are not there


def nearby(study, folder, snapshots):
    """Yield a `Nearby` of each run of `Snapshots` or `Histories`, those of `study.test`: over the
    time levels that `evaluate` compares. Raises `BadResults` for a damaged file.
    """
    for number, x in zip(study.test, snapshots.x, strict=True):
        taken = nearest_run(study, number)
        path = file_of(folder, taken)
        there = finished(path, study.scene(study.mu[taken]))
        yield Nearby(number, taken, _errors(study, path, snapshots.X, x) if there else None)


def nearest_run(study, number):
    """Number of the training run with the parameters nearest to those of a run, each measured in
    its range over the training.
    """
    mu = study.mu[list(study.train)]
    span = np.ptp(mu, axis=0)
    away = (mu - study.mu[number]) / np.where(span > 0.0, span, 1.0)
    return study.train[int(np.argmin(np.sum(away**2, axis=1)))]


def _errors(study, path, X, x):
    """`Errors` of a results file beside positions x (k + 1, n, d) of points X."""
    squares = Squares(X)
    with Results(path) as results:
        for level in range(study.tables.model == NSF, len(x)):
            squares.add(at_once(results, "x", level), x[level].astype(float))
    return squares.errors


def facts(found):
    """The same as plain values, as shares."""
    return [{"number": one.number, "training_run": one.taken,
             **(one.errors._asdict() if one.errors else {})} for one in found]


def lines(found):
    """The same as a table in per cent."""
    rows = [("run", "of", *Errors._fields)]
    for one in found:
        shares = one.errors or len(Errors._fields) * (None,)
        rows.append((one.number, one.taken,
                     *("no data" if own is None else f"{100.0 * own:.3g}" for own in shares)))
    return ["position errors [%] of the training run with the nearest parameters, taken as it is",
            *("".join(f"{cell:>13}" for cell in row) for row in rows)]
