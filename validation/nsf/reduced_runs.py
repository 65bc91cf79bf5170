"""Fields of a study, and errors of reduced runs on them against the held-out full-order runs."""

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


class RunErrors(NamedTuple):
    """Errors of one reduced run."""

    errors: PositionErrors          # NSF-eq11: of all points at all times but the first
    stress: float           # of the Kirchhoff stress, over its norm, likewise
    points: float           # integration points, mean over the steps; NaN where it broke down
    samples: float          # kept; of sets that follow each other, the mean
    misfit: float           # of their weights, the largest (see `rom.cubature`); NaN without
    iterations: tuple = ()  # of Gauss-Newton, one number for each step


class FittedStudy(NamedTuple):
    """Fields of a study's training runs, and its tests."""

    study: object
    fields: object          # `PodFields`
    xhat: np.ndarray        # (s, k + 1, r) of the training runs
    runs: object            # `Histories` of training
    tests: dict             # {value: `Histories` of a run}
    map_alone: bool = False     # whether stress is that of the map's gradient, without affine field
    modes: object = None        # `PodFields` by which samples get weights; None: the fields
    cached_modes: dict | None = None    # of `runs`, for the next fit
    inversion: str = INVERSIONS[0]

    @property
    def scale(self):
        """Describe the runs and the sizes of the fields in words."""
        sizes = self.study.sizes
        return f"{self.size}, modes {sizes.modes}, {sizes.tau} of stress, {sizes.C} of C"

    @property
    def size(self):
        """Describe the runs in words."""
        study, test = self.study, next(iter(self.tests.values()))
        coarse = "" if study.coarser == 1 else f", dx and dt {study.coarser} times as long"
        stored = "all" if study.spacing == 1 else f"one in {study.spacing}"
        return (f"{len(test.X)} particles, {study.run(study.test[0]).steps} steps, {stored} kept, "
                f"{counted(len(study.train), 'run')} and {counted(len(self.tests), 'test')}"
                f"{coarse}; r = {study.sizes.r}")

    @property
    def rest(self):
        """The latent coordinates (r,) near those of the start."""
        return self.xhat[:, 0].mean(axis=0)

    def fields_of_run(self, value):
        """Return the fields in a run with this value."""
        fields = self.fields.with_parameters([value] if self.study.follows else [])
        if self.map_alone:
            return elastic_modes(fields, nsf_full_model(self.study.run(value)).problem.bodies)
        return fields

    def errors(self, value, count, draw=0, dt_factor=1.0, weighted=False):
        """Return the `RunErrors` of a reduced run with `count` samples, drawn, or weighted by
        cubature; infinite where it breaks down.
        """
        fields, test = self.fields_of_run(value), self.tests[value]
        one = nsf_full_model(self.study.run(value))
        sets = self.study.chosen(one, count, draw, (self.modes or self.fields) if weighted
                                 else None)
        points, iterations = [], []

        def states():
            options = FieldRunOptions(sets, dt_factor, self.inversion)
            for t, latent, report, _ in nsf_run(one, fields, options, self.rest).states():
                level = level_of(t / test.dt)
                if level:
                    points.append(report.points)
                iterations.extend(() if report is None else (report.iterations,))
                yield level, latent.xhat

        path = path_errors(fields, history_reference(test), states())
        return RunErrors(path.errors, stress_share(path.stress),
                         np.nan if path.breakdown else float(np.mean(points)),
                         float(np.mean([len(own.points) for own in sets])),
                         float(np.max([own.misfit for own in sets])), tuple(iterations))

    def nearest_state_errors(self, value):
        """Return the `PositionErrors` of the nearest states that the fields can represent, found by
        a search that starts at each time from the state before.
        """
        X, x = self.tests[value].X, self.tests[value].x[0, 1:]
        squares, everything = Squares(X), np.arange(len(X))
        for level, xhat in nearest_states(self.fields, x, self.rest):
            squares.add(self.fields.place(everything, xhat), x[level])
        return squares.errors

    def nearest_run_errors(self, value):
        """Return the `PositionErrors` of the training run with the nearest value."""
        k = int(np.argmin(np.abs(self.runs.mu[:, 0] - value)))
        squares = Squares(self.runs.X)
        for x, reference in zip(self.runs.x[k, 1:], self.tests[value].x[0, 1:], strict=True):
            squares.add(x, reference)
        return squares.errors


def fit_study(study):
    """Return the `FittedStudy` of a study: simulate its runs, and fit fields to them."""
    def simulated(value):
        return simulate_history(study.run(value), [value], np.float32, study.spacing)

    runs = join_histories(map(simulated, study.train), len(study.train))
    tests = {value: simulated(value) for value in study.test}
    return refit(FittedStudy(study, None, None, runs, tests, cached_modes={}), study.sizes,
                 study.follows)


def refit(one, sizes, follows):
    """Return a `FittedStudy` of the same runs with fields of other sizes."""
    block = BLOCK * nsf_full_model(one.study.run(one.study.train[0])).problem.dx
    fields, xhat = fit_pod_fields(one.runs, sizes, block, follows, one.cached_modes)
    return one._replace(study=one.study._replace(sizes=sizes, follows=follows), fields=fields,
                        xhat=xhat)
