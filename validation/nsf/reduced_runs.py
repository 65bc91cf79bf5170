"""Fields of a study and reduced runs on them, beside the full-order runs that were held out."""

from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.elastic import elastic_modes
from mpm_ref.rom.fields.pod_fields import fit_pod_fields
from mpm_ref.rom.projection import INVERSIONS
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.evaluate import (
    history_reference,
    level_of,
    nearest_states,
    path_errors,
    stress_share,
)
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.store.text import counted

FASTER = 1.5            # longer steps at deployment


class Found(NamedTuple):
    """Errors of one reduced run."""

    errors: PositionErrors          # NSF-eq11: of all points at all times but the first
    stress: float           # of the Kirchhoff stress, over its norm, likewise
    points: float           # integration points, mean over the steps; NaN where it broke down
    kept: float             # samples; of sets that follow each other, the mean
    misfit: float           # of their weights, the largest (see `rom.cubature`); NaN without
    iterations: tuple = ()  # of Gauss-Newton, one number for each step


class Tested(NamedTuple):
    """Fields of a study's training runs, and its tests."""

    study: object
    fields: object          # `PodFields`
    xhat: np.ndarray        # (s, k + 1, r) of the training runs
    runs: object            # `Histories` of training
    tests: dict             # {value: `Histories` of a run}
    map_alone: bool = False     # whether stress is that of the map's gradient, without affine field
    modes: object = None        # `PodFields` by which samples get weights; None: the fields
    known: dict | None = None   # modes of `runs`, kept from one fit to the next
    inversion: str = INVERSIONS[0]

    @property
    def scale(self):
        """In words."""
        sizes = self.study.sizes
        return f"{self.size}, modes {sizes.modes}, {sizes.tau} of stress, {sizes.C} of C"

    @property
    def size(self):
        """The same without what the fields are made of."""
        study, test = self.study, next(iter(self.tests.values()))
        coarse = "" if study.coarser == 1 else f", dx and dt {study.coarser} times as long"
        kept = "all" if study.spacing == 1 else f"one in {study.spacing}"
        return (f"{len(test.X)} particles, {study.run(study.test[0]).steps} steps, {kept} kept, "
                f"{counted(len(study.train), 'run')} and {counted(len(self.tests), 'test')}"
                f"{coarse}; r = {study.sizes.r}")

    @property
    def rest(self):
        """Latent coordinates (r,) near those of the start."""
        return self.xhat[:, 0].mean(axis=0)

    def of(self, value):
        """The fields in a run with this value."""
        fields = self.fields.with_parameters([value] if self.study.follows else [])
        if self.map_alone:
            return elastic_modes(fields, nsf_full_model(self.study.run(value)).problem.bodies)
        return fields

    def errors(self, value, count, draw=0, faster=1.0, weighed=False):
        """`Found` of a reduced run with so many samples, drawn or weighed by cubature; infinite
        where it breaks down.
        """
        fields, test, one = self.of(value), self.tests[value], nsf_full_model(self.study.run(value))
        sets = self.study.chosen(one, count, draw, (self.modes or self.fields) if weighed else None)
        points, iterations = [], []

        def states():
            options = FieldRunOptions(sets, faster, self.inversion)
            for t, at, report, _ in nsf_run(one, fields, options, self.rest).states():
                level = level_of(t / test.dt)
                if level:
                    points.append(report.points)
                iterations.extend(() if report is None else (report.iterations,))
                yield level, at.xhat

        found = path_errors(fields, history_reference(test), states())
        return Found(found.errors, stress_share(found.stress),
                     np.nan if found.breakdown else float(np.mean(points)),
                     float(np.mean([len(own.points) for own in sets])),
                     float(np.max([own.misfit for own in sets])), tuple(iterations))

    def nearest(self, value):
        """`PositionErrors` of the nearest states that the fields know, as far as a search finds
        them that goes on from each time to the next.
        """
        X, x = self.tests[value].X, self.tests[value].x[0, 1:]
        squares, everything = Squares(X), np.arange(len(X))
        for level, xhat in nearest_states(self.fields, x, self.rest):
            squares.add(self.fields.place(everything, xhat), x[level])
        return squares.errors

    def next_run(self, value):
        """Return the `PositionErrors` of the training run with the nearest value."""
        k = int(np.argmin(np.abs(self.runs.mu[:, 0] - value)))
        squares = Squares(self.runs.X)
        for x, reference in zip(self.runs.x[k, 1:], self.tests[value].x[0, 1:], strict=True):
            squares.add(x, reference)
        return squares.errors


def tested(study):
    """`Tested` of a study: makes its runs, and fields of them."""
    def made(value):
        return simulate_history(study.run(value), [value], np.float32, study.spacing)

    runs = join_histories(map(made, study.train), len(study.train))
    tests = {value: made(value) for value in study.test}
    return refitted(Tested(study, None, None, runs, tests, known={}), study.sizes, study.follows)


def refitted(one, sizes, follows):
    """The same runs with other fields."""
    block = BLOCK * nsf_full_model(one.study.run(one.study.train[0])).problem.dx
    fields, xhat = fit_pod_fields(one.runs, sizes, block, follows, one.known)
    return one._replace(study=one.study._replace(sizes=sizes, follows=follows), fields=fields,
                        xhat=xhat)
