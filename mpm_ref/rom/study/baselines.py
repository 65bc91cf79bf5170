"""The training run whose parameters are nearest to those of a run that was held out, taken for it
as it is. A reduced run that is farther off gains nothing in position over looking it up; where many
training runs cover one parameter, that may say more of the test than of the model.
"""

from typing import NamedTuple

import numpy as np

from ...store.results import BadResults, Results
from .errors import Errors, Squares
from .generate import file_of, finished
from .nsf_dataset import at_once
from .nsf_evaluate import levels_of
from .tables import NSF

EVEN = 1e-9         # of a squared distance: training runs within it are equally near


class Nearby(NamedTuple):
    """A training run beside a run that was held out."""

    number: int             # of the one that was held out
    taken: int              # of the training run
    squares: Squares | None     # of its errors; None where it has no data that can be read


def nearby(study, folder, snapshots):
    """Yield a `Nearby` of each run of `Snapshots` or `Histories`, those of `study.test`: over the
    time levels that `evaluate` compares. Of several training runs that are equally near it is the
    one with the least error.
    """
    for number, x in zip(study.test, snapshots.x, strict=True):
        runs = nearest_runs(study, number)
        found = [Nearby(number, k, _squares(study, folder, k, snapshots.X, x)) for k in runs]
        yield min((one for one in found if one.squares),
                  key=lambda one: one.squares.errors.origin, default=found[0])


def nearest_runs(study, number):
    """Numbers of the training runs with the parameters nearest to those of a run, each measured in
    its range over the training.
    """
    mu = study.mu[list(study.train)]
    span = np.ptp(mu, axis=0)
    away = (mu - study.mu[number]) / np.where(span > 0.0, span, 1.0)
    squared = np.sum(away**2, axis=1)
    return [study.train[k] for k in np.flatnonzero(squared <= squared.min() + EVEN)]


def _squares(study, folder, number, X, x):
    """`Squares` of a training run beside positions x (k + 1, n, d) of points X, or None."""
    path, squares = file_of(folder, number), Squares(X)
    try:
        if not finished(path, study.scene(study.mu[number])):
            return None
        with Results(path) as results:
            for level in compared(study, len(x)):
                squares.add(at_once(results, "x", level), x[level].astype(float))
    except BadResults:
        return None
    return squares


def compared(study, count):
    """Which of the states kept `evaluate` compares."""
    if study.tables.model != NSF:
        return range(count)
    return sorted(level for level in levels_of(study) if 0 < level < count)


def together(found):
    """`Errors` of all as one; None unless all have data."""
    if not all(one.squares for one in found):
        return None
    every = Squares(found[0].squares.X)
    every.sums = sum(one.squares.sums for one in found)
    return every.errors


def facts(found):
    """The same as plain values, as shares."""
    every = together(found)
    return {"all": every and every._asdict(), "runs": [
        {"number": one.number, "training_run": one.taken,
         **(one.squares.errors._asdict() if one.squares else {})} for one in found]}


def lines(found):
    """The same as a table in per cent."""
    rows = [("run", "training run", "origin", "centroid", "displaced")]
    for one in found:
        shares = _in_per_cent(one.squares.errors) if one.squares else ["no data"]
        rows.append((one.number, one.taken, *shares))
    every = together(found)
    rows += [("all", "", *_in_per_cent(every))] if every else []
    return ["position errors [%] of the training run with the nearest parameters, taken as it is",
            *("".join(f"{cell:>14}" for cell in row) for row in rows)]


def _in_per_cent(errors: Errors):
    return [f"{100.0 * error:.3g}" for error in errors]
