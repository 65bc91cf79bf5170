"""Fields of a study and reduced runs on them, beside the full-order runs that were held out."""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.reduced.errors import Errors, Squares
from mpm_ref.reduced.inferring import Plan, infer
from mpm_ref.reduced.whole import history, whole
from mpm_ref.rom.deformed import deformed
from mpm_ref.rom.histories import joined
from mpm_ref.rom.inferred import nearest
from mpm_ref.rom.placed import NoBody
from mpm_ref.rom.spanned import spanned
from mpm_ref.rom.symmetric import values

BLOCK = 3.0             # size of blocks of points [dx]
SOME = 4000             # points that tell the nearest state
FASTER = 1.5            # longer steps at deployment
NOWHERE = Errors(np.inf, np.inf, np.inf)


class Found(NamedTuple):
    """Errors of one reduced run."""

    errors: Errors          # NSF-eq11: of all points at all times but the first
    stress: float           # of the Kirchhoff stress, over its norm, likewise
    points: float           # integration points, mean over the steps


class Tested(NamedTuple):
    """Fields of a study's training runs, and its tests."""

    study: object
    fields: object          # `Spanned`
    xhat: np.ndarray        # (s, k + 1, r) of the training runs
    runs: object            # `Histories` of training
    tests: dict             # {value: `Histories` of a run}
    map_alone: bool = False     # whether stress is that of the map's gradient, without affine field

    @property
    def scale(self):
        """In words."""
        runs, sizes, times = self.runs, self.study.sizes, self.study.coarser
        coarse = "" if times == 1 else f", dx and dt {times} times as long"
        return (f"{len(runs.X)} particles, {runs.x.shape[1] - 1} steps, {len(runs.mu)} runs and "
                f"{len(self.tests)} tests{coarse}; r = {sizes.r}, modes {sizes.modes}, {sizes.tau} "
                f"of stress, {sizes.C} of C")

    def of(self, value):
        """The fields in a run with this value."""
        fields = self.fields.of([value] if self.study.follows else [])
        if self.map_alone:
            return deformed(fields, whole(self.study.run(value)).problem.bodies)
        return fields

    def errors(self, value, count, draw=0, faster=1.0, weighed=False):
        """`Found` of a reduced run with so many samples, drawn or weighed by cubature; infinite
        where it breaks down.
        """
        fields, test, one = self.of(value), self.tests[value], whole(self.study.run(value))
        by = self.fields if weighed else None
        plan = Plan(self.study.chosen(one, count, draw, by), faster)
        squares, stress, points = Squares(one.X), np.zeros(2), []
        everything = np.arange(len(one.X))
        try:
            for t, at, report in infer(one, fields, plan, self.xhat[:, 0].mean(axis=0)):
                k = t / test.dt
                if report is None or abs(k - round(k)) > 1e-6:
                    continue
                k = round(k)
                squares.add(fields.place(everything, at.xhat), test.x[0, k])
                tau = values(fields.stress(everything, at.xhat))
                stress += np.sum((tau - test.tau[0, k]) ** 2), np.sum(test.tau[0, k] ** 2)
                points.append(report.points)
        except (NoBody, OutOfRange, np.linalg.LinAlgError):
            return Found(NOWHERE, np.inf, np.nan)
        return Found(squares.errors, float(np.sqrt(stress[0] / stress[1])), float(np.mean(points)))

    def nearest(self, value):
        """`Errors` of the nearest states that the fields know: no run on them is expected to beat
        them.
        """
        test, y = self.tests[value], self.xhat[:, 0].mean(axis=0)
        some = np.arange(0, len(test.X), -(-len(test.X) // SOME))
        squares, everything = Squares(test.X), np.arange(len(test.X))
        for x in test.x[0, 1:]:
            y = nearest(self.fields, some, x[some], y)
            squares.add(self.fields.place(everything, y), x)
        return squares.errors

    def next_run(self, value):
        """`Errors` of the training run with the nearest value, taken for the test as it is."""
        k = int(np.argmin(np.abs(self.runs.mu[:, 0] - value)))
        squares = Squares(self.runs.X)
        for x, reference in zip(self.runs.x[k, 1:], self.tests[value].x[0, 1:], strict=True):
            squares.add(x, reference)
        return squares.errors


def tested(study):
    """`Tested` of a study: makes its runs, and fields of them."""
    def made(value):
        return history(study.run(value), [value], np.float32, study.spacing)

    runs, tests = joined(map(made, study.train)), {value: made(value) for value in study.test}
    return refitted(Tested(study, None, None, runs, tests), study.sizes, study.follows)


def refitted(one, sizes, follows):
    """The same runs with other fields."""
    block = BLOCK * whole(one.study.run(one.study.train[0])).problem.dx
    fields, xhat = spanned(one.runs, sizes, block, follows)
    return one._replace(study=one.study._replace(sizes=sizes, follows=follows), fields=fields,
                        xhat=xhat)
