"""Reduced runs with inferred stress beside the full-order runs that were held out, and beside the
nearest states that their fields know.

Errors of the position are NSF-eq11: over all points, and all states kept but the first; errors of
the Kirchhoff stress likewise, over its own norm.
"""

from math import inf, nan

import numpy as np

from ..kinematics import NoBody
from ..latent import nearest
from ..step import BREAKDOWNS
from ..symmetric import values
from .errors import Errors, Squares
from .evaluate import NEAREST, REDUCED, Course, Held, require_slow
from .nsf_case import whole
from .nsf_fields import of_run
from .nsf_record import plan_of
from .nsf_run import ENOUGH, Plan, infer

EVEN = 1e-6         # of a level: a state so near to one is compared with it


def evaluate(study, model, histories):
    """Yield a `Held` of each run of `Histories`, those of `study.test`. Raises ValueError for
    samples that do not suffice, and steps that end at none of the states kept.
    """
    levels = levels_of(study)
    for k, number in enumerate(study.test):
        mu, data = histories.mu[k], (histories.x[k], histories.tau[k])
        one = whole(study.scene(mu))
        fields = of_run(model.field, one, mu)
        plan = plan_of(study.tables.run, one.problem, fields)
        found = {REDUCED: course(fields, *data, reduced(one, fields, plan, model.rest, study)),
                 NEAREST: course(fields, *data, only(levels, closest(fields, data[0], model.rest)))}
        yield Held(number, mu, {name: own[0] for name, own in found.items()},
                   {name: own[1] for name, own in found.items()})


def levels_of(study):
    """Numbers of the states kept at which a step of a reduced run ends. Raises ValueError where
    there are none but the start.
    """
    faster, base = study.tables.run.faster, study.base
    ends = range(Plan((), faster).steps(base) + 1)
    levels = {level_of(step * faster / base.every) for step in ends} - {None}
    if not any(0 < level <= base.steps // base.every for level in levels):
        raise ValueError(f"faster = {faster:g}: expected steps of which some end at a state kept, "
                         f"one every {base.every} steps of the scene; take a simple fraction such "
                         "as 1.5 or 2")
    return levels


def level_of(time):
    """The level that a time, in levels, is at; None where it is between two."""
    return round(time) if abs(time - round(time)) < EVEN else None


def reduced(one, fields, plan, rest, study):
    """Yield (level or None, latent coordinates) of each state of a reduced run of a `Whole`. Raises
    `NoBody` as `require_slow` does.
    """
    every = study.base.every * study.base.dt
    everything, before = np.arange(len(fields.X)), None
    for t, at, _ in infer(one, fields, plan, rest):
        x = fields.place(everything, at.xhat)
        require_slow(x, before, one.problem)
        before = x
        yield level_of(t / every), at.xhat


def only(levels, states):
    """Yield the same states (level, latent coordinates), None in place of other levels."""
    for level, xhat in states:
        yield level if level in levels else None, xhat


def closest(fields, x, xhat):
    """Yield (level, latent coordinates) of the states nearest to positions x (k + 1, n, d),
    searched from xhat on.
    """
    some = np.arange(0, x.shape[1], -(-x.shape[1] // ENOUGH))
    for level, reference in enumerate(x):
        xhat = nearest(fields, some, reference[some].astype(float), xhat)
        yield level, xhat


def course(fields, x, tau, states):
    """`Course` of states (level or None, latent coordinates) beside x (k + 1, n, d) and values tau
    of the stress (k + 1, n, d (d + 1)/2); and the sums of squares (2,) of the stress off, and of
    the stress.
    """
    everything, step = np.arange(len(fields.X)), 0
    squares, stress, levels = Squares(fields.X), np.zeros(2), np.full(len(x), np.nan)
    try:
        for level, xhat in states:
            if level is not None and level < len(x):
                at, reference = fields.place(everything, xhat), x[level].astype(float)
                levels[level] = np.linalg.norm(at - reference) / np.linalg.norm(reference)
                if level:
                    squares.add(at, reference)
                    stress += off(values(fields.stress(everything, xhat)), tau[level].astype(float))
                if not (np.isfinite(squares.sums).all() and np.isfinite(stress).all()):
                    raise NoBody("the positions or stresses, or their squares, are not finite")
            step += 1
    except BREAKDOWNS as fault:
        said = f"step {step}: {' '.join(str(fault).split())}"
        return Course(np.full(4, inf), Errors(inf, inf, inf), levels, said), np.full(2, inf)
    return Course(squares.sums, squares.errors, levels), stress


def off(a, reference):
    """Sums of squares (2,) of what values are off, and of the reference."""
    return np.array([np.sum((a - reference) ** 2), np.sum(reference**2)])


def share(sums):
    """The error that sums of squares make: infinite of a run that broke down, NaN where there is no
    stress.
    """
    if np.isinf(sums).any():
        return inf
    return float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0.0 else nan


def stresses(found):
    """Errors of the stress of several `Held`: of all, and of each, {REDUCED, NEAREST: share}."""
    sums = [one.stress for one in found]
    every = {name: share(sum(own[name] for own in sums)) for name in (REDUCED, NEAREST)}
    return every, [{name: share(own[name]) for name in own} for own in sums]


def stress_facts(found):
    """Errors of the stress as plain values, as shares."""
    every, each = stresses(found)
    return {"all": every, "runs": [
        {"number": one.number, **own} for one, own in zip(found, each, strict=True)]}


def stress_lines(found):
    """The same as a table in per cent."""
    every, each = stresses(found)
    rows = [("run", REDUCED, NEAREST)]
    for name, own in zip([*(one.number for one in found), "all"], [*each, every], strict=True):
        rows.append((name, *(f"{100.0 * own[kind]:.3g}" for kind in (REDUCED, NEAREST))))
    return ["errors of the Kirchhoff stress [%], of its norm: of reduced runs, then of the nearest "
            "states", *("".join(f"{cell:>11}" for cell in row) for row in rows)]
