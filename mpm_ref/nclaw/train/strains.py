"""Range of the strains in a training: those of the observed run, and those of the law's segments.

A training runs in segments, each from an observed state (NCLAW-train), in which the law itself
determines the strains. A learned return map leaves another part of a deformation in F than the true
one, so that the bounds of both differ; the range includes both.
"""

from itertools import pairwise

import numpy as np

from ...body import keep_inside
from ...core.grid import OutOfRange
from ...materials.learned.strain_range import strain_measures
from ..bodies import convert_gradients, deformation_gradients
from .recipe import TeacherForcing

MAX_STRETCH = 100.0     # stretch or J, above which a segment has broken down


def training_bounds(problem, observed, law, cuts):
    """Return the bounds of the strains in a training, like `strain_bounds`.

    problem: a `Problem` of one body, at its start; observed: `Observed` of its run, all steps; law:
    makes the body of learned laws (`bodies.body_maker`); cuts: time levels at which segments begin,
    and the last one. Segments that break down count up to there.
    """
    rows = [extremes(strain_measures(F)) for F in observed.F if np.isfinite(F).all()]
    body, stepper = law(problem.bodies[0]), problem.stepper()
    for begin, end in pairwise(cuts):
        restart(body, observed, begin)
        stepper.start((body,))
        rows += segment(problem, stepper, body, end - begin)
    low, high = (np.array(measures) for measures in zip(*rows, strict=True))
    return {"low": low.min(axis=0).tolist(), "high": high.max(axis=0).tolist()}


def segment_cuts(recipe, steps, epoch=None):
    """Return the time levels at which segments of an epoch begin, and the last one.

    The epoch of a `Recipe` counts from 1; by default it is the last one.
    """
    number = (epoch or recipe.epochs) - 1
    return TeacherForcing(recipe.first, recipe.last).restarts(steps, number, recipe.epochs)


def restart(body, observed, k):
    """Put a body into the observed state of time level k."""
    q = body.particles
    q.x[:], q.v[:], q.C[:] = observed.x[k], observed.v[k], observed.C[k]
    q.F[:] = convert_gradients(observed.F[k], q.F.ndim == 3, q.x.shape[1])


def segment(problem, stepper, body, steps):
    """Return [(low, high)] of the strains after each of `steps` steps."""
    measures, dt = [], problem.clock.dt
    for _ in range(steps):
        try:
            stepper.step((body,), 0.0, dt)
        except OutOfRange:
            break
        if problem.clip is not None:
            keep_inside((body,), *problem.clip)
        with np.errstate(invalid="ignore", over="ignore"):
            row = extremes(strain_measures(deformation_gradients(body)))
        if not (np.abs(row).max() <= MAX_STRETCH and np.isfinite(body.particles.x).all()):
            break
        measures.append(row)
    return measures


def extremes(measures):
    """Return the smallest and the largest of strain measures (n, d + 1)."""
    return measures.min(axis=0), measures.max(axis=0)
