"""Training runs in place of a reduced model: the run whose parameters are nearest to those of a
run that was held out, taken unchanged, and the linear interpolation between training runs in the
parameters.

A reduced run with a larger error gains nothing in position over looking them up; where many
training runs cover one parameter, that may say more of the test than of the model.
"""

from contextlib import ExitStack
from typing import NamedTuple

import numpy as np
from scipy.spatial import Delaunay

from ...store.results import BadResults, Results
from .dataset import frame_field
from .errors import PositionErrors, Squares
from .evaluate import levels_of
from .generate import file_of, is_finished

EVEN = 1e-9         # of a squared distance: training runs within it are equally near
LEAST = 1e-12       # weight of a training run that an interpolation uses
NEAREST, INTERPOLATED = "the training run with the nearest parameters, taken as it is", (
    "the linear interpolation between training runs")


class TrainingBaseline(NamedTuple):
    """Training runs in place of a run that was held out."""

    number: int             # of the one that was held out
    weights: dict           # {number of a training run: its weight}; empty where the parameters lie
                            # outside those of training
    squares: Squares | None     # of its errors; None where it has no data that can be read


def nearest_training_runs(study, folder, data):
    """Yield the `TrainingBaseline` of the nearest training run for each run of `Snapshots` or
    `Histories`, those of `study.test`: over the time levels that `evaluate` compares. Of several
    training runs that are equally near it is the one with the least error.
    """
    for number, x in zip(study.test, data.x, strict=True):
        runs = [baseline(study, folder, number, {k: 1.0}, (data.X, x))
                for k in nearest_parameters(study, number)]
        yield min((run for run in runs if run.squares), key=lambda run: run.squares.errors.origin,
                  default=runs[0])


def interpolated_training_runs(study, folder, data):
    """Yield the `TrainingBaseline` of the linear interpolation for each run, as
    `nearest_training_runs` does.
    """
    train = np.array(study.train)
    for number, x in zip(study.test, data.x, strict=True):
        weights = interpolation_weights(study.mu[train], study.mu[number])
        yield baseline(study, folder, number, {int(train[k]): w for k, w in weights.items()},
                       (data.X, x))


def nearest_parameters(study, number):
    """Return the numbers of the training runs with the parameters nearest to those of a run, each
    measured in its range over the training.
    """
    mu = study.mu[list(study.train)]
    span = np.ptp(mu, axis=0)
    difference = (mu - study.mu[number]) / np.where(span > 0.0, span, 1.0)
    squared = np.sum(difference**2, axis=1)
    return [study.train[k] for k in np.flatnonzero(squared <= squared.min() + EVEN)]


def interpolation_weights(mu, target):
    """Return {row: weight} of the linear interpolation in parameters mu (runs, parameters) at a
    target (parameters,); empty where it lies outside their convex hull, as it does where the runs
    are fewer than a simplex has corners.

    One parameter is interpolated between its two neighbours, several within the simplex of a
    Delaunay triangulation, each parameter measured in its range.
    """
    span = np.ptp(mu, axis=0)
    varies = span > 0.0
    if not np.allclose(target[~varies], mu[0, ~varies]):
        return {}
    points, point = mu[:, varies] / span[varies], target[varies] / span[varies]
    rows, weights = _barycentric(points, point) if points.shape[1] > 1 else _between(
        points[:, 0], float(point[0]))
    return {int(k): float(w) for k, w in zip(rows, weights, strict=True) if w > LEAST}


def _between(points, point):
    """Return the neighbours of a point on a line, and their weights."""
    order = np.argsort(points, kind="stable")
    ordered = points[order]
    if not ordered[0] <= point <= ordered[-1]:
        return (), ()
    right = max(int(np.searchsorted(ordered, point)), 1)
    low, high = ordered[right - 1], ordered[right]
    share = (point - low) / (high - low)
    return order[right - 1:right + 1], (1.0 - share, share)


def _barycentric(points, point):
    """Return the corners of the simplex around a point, and its barycentric coordinates; none where
    the points span no simplex.
    """
    if np.linalg.matrix_rank(points - points[0]) < points.shape[1]:
        return (), ()
    mesh = Delaunay(points)
    simplex = int(mesh.find_simplex(point))
    if simplex < 0:
        return (), ()
    affine = mesh.transform[simplex]
    first = affine[:-1] @ (point - affine[-1])
    return mesh.simplices[simplex], (*first, 1.0 - first.sum())


def baseline(study, folder, number, weights, reference):
    """Return the `TrainingBaseline` of weighted training runs, compared with reference = (points X
    (n, d), positions x (k + 1, n, d)).
    """
    return TrainingBaseline(number, weights, _squares(study, folder, weights, *reference))


def _squares(study, folder, weights, X, x):
    """Return the `Squares` of weighted training runs compared with positions x (k + 1, n, d) of
    points X, or None.
    """
    first, squares = study.method.first_level, Squares(X)
    paths = {k: file_of(folder, k) for k in weights}
    try:
        if not weights or not all(is_finished(path, study.scene(study.mu[k]))
                                  for k, path in paths.items()):
            return None
        with ExitStack() as files:
            runs = {k: files.enter_context(Results(path)) for k, path in paths.items()}
            for level in sorted(level for level in levels_of(study) if first <= level < len(x)):
                mean = sum(weight * frame_field(runs[k], "x", level)
                           for k, weight in weights.items())
                squares.add(mean, x[level].astype(float))
    except BadResults:
        return None
    return squares


def total_errors(runs):
    """Return the `PositionErrors` of all `TrainingBaseline`s together; None unless all have
    data.
    """
    if not all(run.squares for run in runs):
        return None
    total = Squares(runs[0].squares.X)
    total.sums = sum(run.squares.sums for run in runs)
    return total.errors


def facts(runs):
    """Return `TrainingBaseline`s as plain values, errors as shares."""
    total = total_errors(runs)
    return {"all": total and total._asdict(), "runs": [
        {"number": run.number, "weights": {str(k): w for k, w in run.weights.items()},
         **(run.squares.errors._asdict() if run.squares else {})} for run in runs]}


def lines(runs, kind):
    """Return `TrainingBaseline`s as a table in per cent; kind: NEAREST or INTERPOLATED."""
    rows = [("run", "training runs", "origin", "centroid", "displaced")]
    for run in runs:
        shares = _in_per_cent(run.squares.errors) if run.squares else [
            "no data" if run.weights else "outside"]
        rows.append((run.number, " + ".join(map(_term, run.weights.items())), *shares))
    total = total_errors(runs)
    rows += [("all", "", *_in_per_cent(total))] if total else []
    return [f"position errors [%] of {kind}",
            *("".join(f"{cell:>14}" for cell in row) for row in rows)]


def _term(weighted):
    """Return a training run with its weight as text: `3`, or `0.25*3`."""
    number, weight = weighted
    return str(number) if weight == 1.0 else f"{weight:.2f}*{number}"


def _in_per_cent(errors: PositionErrors):
    return [f"{100.0 * error:.3g}" for error in errors]
