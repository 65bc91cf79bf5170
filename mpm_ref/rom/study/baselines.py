"""The training run whose parameters are nearest to those of a run that was held out, taken for it
unchanged. A reduced run with a larger error gains nothing in position over looking it up; where
many training runs cover one parameter, that may say more of the test than of the model.
"""

from typing import NamedTuple

import numpy as np

from ...store.results import BadResults, Results
from .dataset import frame_field
from .errors import PositionErrors, Squares
from .evaluate import levels_of
from .generate import file_of, is_finished

EVEN = 1e-9         # of a squared distance: training runs within it are equally near


class NearestRun(NamedTuple):
    """The training run nearest to a run that was held out."""

    number: int             # of the one that was held out
    training_run: int       # number of the training run
    squares: Squares | None     # of its errors; None where it has no data that can be read


def nearest_training_runs(study, folder, data):
    """Yield a `NearestRun` of each run of `Snapshots` or `Histories`, those of `study.test`: over
    the time levels that `evaluate` compares. Of several training runs that are equally near it is
    the one with the least error.
    """
    for number, x in zip(study.test, data.x, strict=True):
        runs = [NearestRun(number, k, _squares(study, folder, k, data.X, x))
                for k in nearest_parameters(study, number)]
        yield min((run for run in runs if run.squares), key=lambda run: run.squares.errors.origin,
                  default=runs[0])


def nearest_parameters(study, number):
    """Return the numbers of the training runs with the parameters nearest to those of a run, each
    measured in its range over the training.
    """
    mu = study.mu[list(study.train)]
    span = np.ptp(mu, axis=0)
    difference = (mu - study.mu[number]) / np.where(span > 0.0, span, 1.0)
    squared = np.sum(difference**2, axis=1)
    return [study.train[k] for k in np.flatnonzero(squared <= squared.min() + EVEN)]


def _squares(study, folder, number, X, x):
    """Return the `Squares` of a training run compared with positions x (k + 1, n, d) of points X,
    or None.
    """
    path, squares = file_of(folder, number), Squares(X)
    first = study.method.first_level
    levels = sorted(level for level in levels_of(study) if first <= level < len(x))
    try:
        if not is_finished(path, study.scene(study.mu[number])):
            return None
        with Results(path) as results:
            for level in levels:
                squares.add(frame_field(results, "x", level), x[level].astype(float))
    except BadResults:
        return None
    return squares


def total_errors(runs):
    """Return the `PositionErrors` of all `NearestRun`s together; None unless all have data."""
    if not all(run.squares for run in runs):
        return None
    total = Squares(runs[0].squares.X)
    total.sums = sum(run.squares.sums for run in runs)
    return total.errors


def facts(runs):
    """Return `NearestRun`s as plain values, errors as shares."""
    total = total_errors(runs)
    return {"all": total and total._asdict(), "runs": [
        {"number": run.number, "training_run": run.training_run,
         **(run.squares.errors._asdict() if run.squares else {})} for run in runs]}


def lines(runs):
    """Return `NearestRun`s as a table in per cent."""
    rows = [("run", "training run", "origin", "centroid", "displaced")]
    for run in runs:
        shares = _in_per_cent(run.squares.errors) if run.squares else ["no data"]
        rows.append((run.number, run.training_run, *shares))
    total = total_errors(runs)
    rows += [("all", "", *_in_per_cent(total))] if total else []
    return ["position errors [%] of the training run with the nearest parameters, taken as it is",
            *("".join(f"{cell:>14}" for cell in row) for row in rows)]


def _in_per_cent(errors: PositionErrors):
    return [f"{100.0 * error:.3g}" for error in errors]
