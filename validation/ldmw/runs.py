"""Reduced runs with the two hyper-reductions of the workshop paper, beside full-order runs.

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

POINT_WAY, NODE_WAY = RunOptions("lagrangian", "linear"), RunOptions("eulerian", "linear")


class Fields(NamedTuple):
    """Accumulated errors of all states, as shares: LDM-err, and its like for the other fields."""

    position: float
    velocity: float
    defgrad: float


class Runs(NamedTuple):
    """Full-order runs of a study, and what reduced runs of them need to know."""

    study: object
    cases: tuple            # `Case` of each
    full: object            # their `Snapshots`

    def levels(self, map, rest, approach):
        """x, v and F of each time level of reduced runs on a map, and those of the full-order ones:
        a list for each run. approach(case, map) gives a stepper, and a function of the time and the
        state that chooses samples.
        """
        with threads_for((self.cases[0].problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
            for one, *fields in zip(self.cases, self.full.x, self.full.v, self.full.F, strict=True):
                states = march(one, map, rest, approach)
                yield [(of_state(map, latent, one.X), there)
                       for latent, *there in zip(states, *fields, strict=True)]

    def errors(self, map, rest, approach):
        """`Fields` of reduced runs on a map, by `levels`."""
        return compared(self.levels(map, rest, approach))

    def of_net(self, name, approach):
        """`Fields` on a trained map."""
        of = trained(name)
        return self.errors(of.field, of.rest, approach)

    @property
    def X(self):
        """Points (n, d) at rest [m]."""
        return self.cases[0].X

    @property
    def scale(self):
        """How much it is, in words."""
        return (f"{len(self.X)} particles, {self.full.x.shape[1] - 1} steps, {len(self.cases)} of "
                f"{len(self.study.mu)} runs")


def compared(found):
    """`Fields` of the `levels` of runs."""
    sums = np.zeros((2, 3))
    for levels in found:
        for here, there in levels:
            sums += [[np.sum((a - b) ** 2) for a, b in zip(here, there, strict=True)],
                     [np.sum(b**2) for b in there]]
    return Fields(*np.sqrt(sums[0] / sums[1]).tolist())


def runs(study, numbers):
    """`Runs` of these numbers of a study."""
    cases = tuple(ldm_full_model(study.scene(*study.mu[k])) for k in numbers)
    return Runs(study, cases, study.run(list(numbers)))


def pod(study, r):
    """`Modes` of the training runs of a study, and their coordinates of the body at rest."""
    full = study.run(study.train)
    return modes(full.X, *full.flat(), r), np.zeros(r)


def record(run, name, fields, scale, note="", **rule):
    """Record `Fields` in per cent, each under its own name."""
    for field, share in fields._asdict().items():
        run.record(f"{name}.{field}", 100.0 * share, unit="%", scale=scale, note=note, **rule)


def march(one, map, rest, approach):
    """Yield the `Latent` of each time level of a reduced run."""
    (stepper, choose), first = approach(one, map), ldm_start(one, map, rest)
    clock = one.problem.clock
    run = ReducedRun(stepper, lambda: first,
                     lambda xhat: lambda t, latent: SampleSet(t, choose(t, latent)),
                     clock.dt, clock.steps)
    for state in run.states():
        yield state.latent


def of_state(map, latent, X):
    """x, v and F of points X in a state; the velocity is the one that was fitted."""
    x, F, _ = map.derivatives(X, latent.xhat)
    return x, map.velocity(X, latent.fitted_at, latent.vhat), F


def by_points(samples, near=None):
    """Approach #1 (LDMW-alg1): sample points, and their neighbours: those in each state, or the
    `Neighbours` that are given.
    """
    def approach(one, map):
        stepper = ldm_model(one, map, POINT_WAY)
        if near is not None:
            stepper = replace(stepper, quadrature=near)
        return stepper, lambda t, latent: samples

    return approach


def kept(name, one, samples):
    """`Neighbours` of sample points in all training states of a trained map (LDMW-sets)."""
    of = trained(name)
    points = ldm_model(one, of.field, POINT_WAY).quadrature
    return neighbours(points, of.field, of.xhat, samples)


def by_nodes(chosen, count=None):
    """Approach #2 (LDMW-alg2): the nodes of points chosen at rest are sample nodes; so many of the
    points that have all their nodes among them, or all, are samples.
    """
    def approach(one, map):
        stepper = ldm_model(one, map, NODE_WAY)
        nodes = nodes_of(one.X[chosen], stepper.quadrature.dx, stepper.quadrature.degree)
        body = node_centric(stepper.quadrature, nodes)

        def choose(t, latent):
            found = body.samples(map, latent.xhat)
            return found if count is None else found[spread(one.X[found], count)]

        return replace(stepper, quadrature=body), choose

    return approach


def spread(X, count):
    """Numbers of so many of the points X (n, 3), evenly among them from the bottom to the top."""
    order = np.argsort(X[:, 2])
    return np.sort(order[np.linspace(0, len(X) - 1, count).round().astype(int)])
