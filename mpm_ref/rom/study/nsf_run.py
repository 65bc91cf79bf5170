"""Reduced runs with inferred stress (NSF), step by step."""

from typing import NamedTuple

import numpy as np

from ..cubature import CANDIDATES, cubature
from ..latent import Latent, nearest
from ..quadrature.stencil_overlap import bases
from ..step import nsf_stepper

ENOUGH = 4000       # points that tell where a body is at the start
WITHIN = 1e-9       # of a step: one that ends so little after the scene is made
OFFERED = 400       # cells of so many random points are candidates


class Chosen(NamedTuple):
    """Samples from a time on."""

    since: float                    # [s]
    points: np.ndarray              # numbers, sorted
    w: np.ndarray | None = None     # weights; None: they count all the same
    misfit: float = np.nan          # of the weights (see `rom.cubature`)


class Plan(NamedTuple):
    """How a reduced run is made."""

    samples: tuple          # of `Chosen`, in order of time (NSF-sec5.4)
    faster: float = 1.0     # length of a step over that of the scene
    inversion: str = "nonlinear"

    def at(self, t):
        """The `Chosen` samples of the step that begins at t [s]."""
        return [one for one in self.samples if one.since <= t][-1]

    def steps(self, clock):
        """How many steps the run takes within the scene's `Clock`."""
        return int(clock.steps / self.faster * (1.0 + WITHIN))


def model(whole, fields, inversion="nonlinear"):
    """NSF's `ReducedStepper` of a `Whole` scene."""
    problem = whole.problem
    return nsf_stepper(fields, whole.matter, problem.dx, problem.scheme.degree, problem.gravity,
                       inversion, conditions=problem.conditions)


def infer(whole, fields, plan, start):
    """Yield (t [s], `Latent`, `Report` or None) of a reduced run until the scene ends, the start
    first, which is searched from latent coordinates near it.
    """
    yield from continued([(begin(whole, fields, start), None)], whole, fields, plan)


def begin(whole, fields, near):
    """`Latent` of a `Whole` scene at the start, searched from latent coordinates near it."""
    some = np.arange(0, len(whole.X), -(-len(whole.X) // ENOUGH))
    return Latent(nearest(fields, some, whole.X[some], near))


def continued(known, whole, fields, plan):
    """Yield the same of a run whose first states (`Latent`, `Report` or None) are known, these
    too.
    """
    require_sound(plan.samples, len(whole.X))
    stepper, clock = model(whole, fields, plan.inversion), whole.problem.clock
    dt = plan.faster * clock.dt
    for k, (at, report) in enumerate(known):
        yield k * dt, at, report
    for k in range(len(known) - 1, plan.steps(clock)):
        chosen = plan.at(k * dt)
        at, report = stepper.step(at, chosen.points, k * dt, dt, chosen.w)
        yield (k + 1) * dt, at, report


def require_sound(sets, n):
    """Raise ValueError unless samples are there from the start on, each a point of n once and in
    order, with weights of which some are positive and none is negative.
    """
    if not sets or sets[0].since > 0.0:
        raise ValueError("samples from a later time on: expected some from the start on")
    for one in sets:
        points, w = np.asarray(one.points), one.w
        if not len(points) or points[0] < 0 or points[-1] >= n or (np.diff(points) < 1).any():
            raise ValueError(f"samples {points}: expected some of 0 .. {n - 1}, sorted, each once")
        if w is not None and not (np.isfinite(w).all() and (w >= 0.0).all() and w.any()):
            raise ValueError(f"weights {w} of samples: expected finite numbers, none negative and "
                             "not all 0")


def numbers_of(among):
    """Numbers of points: of all, of which there are so many, or those given."""
    return np.arange(among) if np.ndim(among) == 0 else among


def drawn(among, count, seed, since=0.0):
    """`Chosen` samples that are drawn once and kept (NSF-sec5.4), `count` of `among`: how many
    points there are, or the numbers of those to draw from. Raises ValueError where there are not so
    many.
    """
    numbers = numbers_of(among)
    if not 1 <= count <= len(numbers):
        raise ValueError(f"{count} samples of {len(numbers)} points: expected 1 .. {len(numbers)}")
    some = np.random.default_rng(seed).choice(numbers, count, replace=False)
    return Chosen(since, np.sort(some))


def weighed(fields, among, count, seed, since=0.0):
    """`Chosen` samples with weights, at most `count` of random candidates of `among` (as of
    `drawn`), by `rom.cubature` of `Spanned` fields. Raises ValueError for too few.
    """
    some = drawn(among, min(CANDIDATES, len(numbers_of(among))), seed).points
    found = cubature(fields.U, fields.r, some, count)
    return Chosen(since, found.points, found.w, found.misfit)


def of_cells(fields, problem, among, count, seed, since=0.0):
    """`Chosen` samples with weights as of `weighed`, in at most `count` cells, those of random
    candidates: points that have the same nodes at rest. Raises ValueError for too few.
    """
    numbers = numbers_of(among)
    base = bases(fields.X[numbers], problem.dx, problem.scheme.degree)
    _, cell = np.unique(base, axis=0, return_inverse=True)
    middle = drawn(len(numbers), min(OFFERED, len(numbers)), seed).points
    offered = np.flatnonzero(np.isin(cell, cell[middle]))
    _, own = np.unique(cell[offered], return_inverse=True)
    found = cubature(fields.U, fields.r, numbers[offered], count, own)
    return Chosen(since, found.points, found.w, found.misfit)
