"""Reduced runs with the two hyper-reductions of the workshop paper, compared with full-order ones.

Its sample points are chosen once (LDMW-sets). Which, it says of its poking test only.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import threadpoolctl

from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.quadrature.lagrangian import neighbours
from mpm_ref.rom.quadrature.node_centric import node_centric, nodes_of
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ReducedRun, RunOptions, ldm_model, ldm_start
from mpm_ref.rom.study.samples import SampleSet

from ..common.scenes import threads_for
from ..ldm.networks import trained

BY_POINTS, BY_NODES = RunOptions("lagrangian", "linear"), RunOptions("eulerian", "linear")


class FieldErrors(NamedTuple):
    """Accumulated errors of all states, as shares: LDM-err, and its like for the other fields."""

    position: float
    velocity: float
    defgrad: float


class StudyRuns(NamedTuple):
    """Full-order runs of a study, and the models of them that reduced runs need."""

    study: object
    cases: tuple            # `FullModel` of each
    full: object            # their `Snapshots`

    def levels(self, g, rest, approach):
        """Yield, for each run, a list of x, v and F at each time level of a reduced run on a map g,
        and of the full-order run. approach(full model, g) gives a stepper, and a function of the
        time and the state that chooses samples.
        """
        with threads_for((self.cases[0].problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
            for one, *fields in zip(self.cases, self.full.x, self.full.v, self.full.F, strict=True):
                states = latent_states(one, g, rest, approach)
                yield [(state_fields(g, latent, one.X), full)
                       for latent, *full in zip(states, *fields, strict=True)]

    def errors(self, g, rest, approach):
        """Return the `FieldErrors` of reduced runs on a map g."""
        return field_errors(self.levels(g, rest, approach))

    def network_errors(self, name, approach):
        """Return the `FieldErrors` of reduced runs on a trained map."""
        model = trained(name)
        return self.errors(model.field, model.rest, approach)

    @property
    def X(self):
        """Points (n, d) at rest [m]."""
        return self.cases[0].X

    @property
    def scale(self):
        """Describe the size of the runs in words."""
        return (f"{len(self.X)} particles, {self.full.x.shape[1] - 1} steps, {len(self.cases)} of "
                f"{len(self.study.mu)} runs")


def field_errors(runs):
    """Return the `FieldErrors` of runs, each a list of `levels`."""
    sums = np.zeros((2, 3))
    for levels in runs:
        for reduced, full in levels:
            sums += [[np.sum((a - b) ** 2) for a, b in zip(reduced, full, strict=True)],
                     [np.sum(b**2) for b in full]]
    return FieldErrors(*np.sqrt(sums[0] / sums[1]).tolist())


def study_runs(study, numbers):
    """Return the `StudyRuns` of these numbers of a study."""
    cases = tuple(ldm_full_model(study.scene(*study.mu[k])) for k in numbers)
    return StudyRuns(study, cases, study.run(list(numbers)))


def pod(study, r):
    """Return the POD `Modes` of the training runs of a study, and their coordinates at rest."""
    full = study.run(study.train)
    return modes(full.X, *full.flat(), r), np.zeros(r)


def record(run, name, fields, scale, note="", **rule):
    """Record `FieldErrors` in per cent, each under its own name."""
    for field, share in fields._asdict().items():
        run.record(f"{name}.{field}", 100.0 * share, unit="%", scale=scale, note=note, **rule)


def latent_states(one, g, rest, approach):
    """Yield the `Latent` of each time level of a reduced run."""
    (stepper, choose), first = approach(one, g), ldm_start(one, g, rest)
    clock = one.problem.clock
    run = ReducedRun(stepper, lambda: first,
                     lambda xhat: lambda t, latent: SampleSet(t, choose(t, latent)),
                     clock.dt, clock.steps)
    for state in run.states():
        yield state.latent


def state_fields(g, latent, X):
    """Return x, v and F of points X in a state; the velocity is the one that was fitted."""
    x, F, _ = g.derivatives(X, latent.xhat)
    return x, g.velocity(X, latent.fitted_at, latent.vhat), F


def by_points(samples, near=None):
    """Return approach #1 (LDMW-alg1): sample points, and their neighbours in each state, or the
    `Neighbours` that are given.
    """
    def approach(one, g):
        stepper = ldm_model(one, g, BY_POINTS)
        if near is not None:
            stepper = replace(stepper, quadrature=near)
        return stepper, lambda t, latent: samples

    return approach


def training_neighbours(name, one, samples):
    """Return the `Neighbours` of samples in all training states of a trained map (LDMW-sets)."""
    model = trained(name)
    points = ldm_model(one, model.field, BY_POINTS).quadrature
    return neighbours(points, model.field, model.xhat, samples)


def by_nodes(chosen, count=None):
    """Return approach #2 (LDMW-alg2): the nodes of points chosen at rest are sample nodes; `count`
    of the points that have all their nodes among them, or all, are samples.
    """
    def approach(one, g):
        stepper = ldm_model(one, g, BY_NODES)
        nodes = nodes_of(one.X[chosen], stepper.quadrature.dx, stepper.quadrature.degree)
        body = node_centric(stepper.quadrature, nodes)

        def choose(t, latent):
            samples = body.samples(g, latent.xhat)
            return samples if count is None else samples[spread(one.X[samples], count)]

        return replace(stepper, quadrature=body), choose

    return approach


def spread(X, count):
    """Return the numbers of `count` of the points X (n, 3), evenly from the bottom to the top."""
    order = np.argsort(X[:, 2])
    return np.sort(order[np.linspace(0, len(X) - 1, count).round().astype(int)])
