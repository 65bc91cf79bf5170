"""The strains that a law has met in training: of the run that it learned from, and of its own.

A training runs in segments, each from an observed state on (NCLAW-train). There a law is asked
about strains that it has led to itself. A learned return map leaves another part of a deformation
in F than the true one does, so that the bounds of both differ; what is met lies in either.
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
    """Bounds as of `seen.seen`.

    problem: a `Problem` of one body, at its start; observed: `Observed` of its run, all
    steps; law: makes the body of learned laws (`bodies.body_maker`); cuts: time levels at which
    segments begin, and the last one. Of segments that break down there is what came before.
    """
    rows = [extremes(strain_measures(F)) for F in observed.F if np.isfinite(F).all()]
    body, stepper = law(problem.bodies[0]), problem.stepper()
    for begin, end in pairwise(cuts):
        restart(body, observed, begin)
        stepper.start((body,))
        rows += segment(problem, stepper, body, end - begin)
    low, high = (np.array(found) for found in zip(*rows, strict=True))
    return {"low": low.min(axis=0).tolist(), "high": high.max(axis=0).tolist()}


def segment_cuts(recipe, steps, epoch=None):
    """The cuts of an epoch, counted from 1, of a `learn.recipe.Recipe`; of the last one."""
    number = (epoch or recipe.epochs) - 1
    return TeacherForcing(recipe.first, recipe.last).restarts(steps, number, recipe.epochs)


def restart(body, observed, k):
    """Put a body into the observed state of time level k."""
    q = body.particles
    q.x[:], q.v[:], q.C[:] = observed.x[k], observed.v[k], observed.C[k]
    q.F[:] = convert_gradients(observed.F[k], q.F.ndim == 3, q.x.shape[1])


def segment(problem, stepper, body, steps):
    """[(low, high)] of the strains after each of so many steps."""
    found, dt = [], problem.clock.dt
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
        found.append(row)
    return found


def extremes(found):
    """The smallest and the largest of measures (n, d + 1)."""
    return found.min(axis=0), found.max(axis=0)
