"""Pareto fronts of measured settings, and their records."""

import numpy as np

from ..extremes.outcome import STOPS
from .measure import COLUMNS, WRONG

EMULATED = (
    "32-bit storage is emulated: the state is rounded to single precision after every step, and "
    "half the bytes of what is rounded are counted; the kernels compute in double precision, so "
    "that no time is saved."
)


def front(costs, errors):
    """Return the mask (N,) of points that no other beats in both cost and error; never of NaN."""
    costs, errors = np.asarray(costs, dtype=float), np.asarray(errors, dtype=float)
    mask = np.zeros(len(costs), dtype=bool)
    least = np.inf
    for k in np.lexsort((errors, costs)):
        if errors[k] < least:
            least, mask[k] = errors[k], True
    return mask


def richardson(coarse, half, fine):
    """Return the observed order and the error of `fine`, relative, of values on three grids, each
    of half the spacing of the one before.

    The error is |half - fine|/(2^order - 1), with an order of at most 2; infinite where the values
    do not converge.
    """
    ratio = (coarse - half) / (half - fine) if half != fine else np.inf
    if not ratio > 1.0:
        return np.nan, np.inf
    order = min(float(np.log2(ratio)), 2.0)
    return order, float(abs(half - fine) / (2.0**order - 1.0) / abs(fine))


def record_points(run, points, scale, floor=0.0):
    """Record the table of all points, the error of the reference, and the failures.

    floor: error of the reference itself, relative: smaller ones are equal to it.
    """
    errors = [max(p.error, floor) if p.good and p.is_stable else np.nan for p in points]
    by_cpu = front([p.cpu for p in points], errors)
    by_bytes = front([p.nbytes for p in points], errors)
    run.table("points", COLUMNS, [(p.knob, *p.setting, *p[2:], int(c), int(b))
                                  for p, c, b in zip(points, by_cpu, by_bytes, strict=True)])
    run.record(f"{run.experiment.id}.reference_error", floor, comparator="info", scale=scale,
               note="error of the reference itself, relative: no smaller error is resolved")
    record_failures(run, points, scale)


def record_failures(run, points, scale):
    """Record the failures: their number, that each stopped by a limit, and that the bound refuses
    each.
    """
    name, bad = run.experiment.id, [p for p in points if not p.good]
    run.record(f"{name}.failures", len(bad), unit="settings", comparator="info", scale=scale,
               note="; ".join(f"{p.setting.description()}: {p.end}, step {p.steps}" for p in bad))
    broken = [p for p in bad if p.end != WRONG]
    smooth = [p for p in broken if p.setting.degree > 1]
    run.record(f"{name}.broken_unrefused", sum(not p.refused for p in smooth),
               unit="settings", comparator="<=", bound=0, scale=scale,
               note="quadratic and cubic settings that broke, all run past the bound, and that "
                    "it would not have refused at any step; a wrong answer (an error above 1) "
                    "is a failure, not a broken run")
    linear = sum(not p.refused for p in broken if p.setting.degree == 1)
    run.record(f"{name}.broken_unrefused_linear", linear, unit="settings", comparator="info",
               scale=scale, note="as above, for linear splines, whose bound is necessary only "
               "(docs/explanation/timestep.md): next to a node a particle's share of the mass goes "
               "to zero, and with it the time step, for fewer steps than lie between two "
               "checks of the bound")
    run.record(f"{name}.told", sum(p.end in STOPS for p in broken), paper=len(broken),
               unit="settings", comparator="=", scale=scale,
               note="broken runs that ended with the sentence of a limit")
