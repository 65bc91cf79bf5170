"""Whether a run still asks its learned laws about strains that they have seen in training.

Nothing in a step fails where a law has learned nothing: it answers, smooth, and often wrong. What
tells it are the bounds of `seen`, of stretches s_0 >= s_1 >= .. and of J, in a state's elastic
deformation gradients:

    beyond_p = max over a of  max(low_a - a_p, a_p - high_a, 0) / (high_a - low_a)

how far point p is out of bounds, in their width. A state is astray where a point is beyond by more
than BEYOND, or inverted where training saw none that was, or has no finite F. Bounds do not say
what such an answer is worth: `python -m validation run extremes.nclaw` records how often the watch
speaks of runs that are right, and is silent about wrong ones.
"""

from typing import NamedTuple

import numpy as np

from ..body import Body
from ..materials.learned.strain_range import measures
from ..monitor import CHECK
from .bodies import gradients

BEYOND = 0.3        # runs of task (b) reach 0.2, those thrown twice as fast 0.8
THIN = 1e-9         # width of bounds that have none, of laws that have seen rest alone


class Sight(NamedTuple):
    """A body in a state, looked at."""

    body: str
    particle: int       # the one that is farthest out of bounds, of those that are
    measures: tuple     # its stretches and J
    beyond: float       # ... and how far it is
    count: int          # points that are beyond by more than BEYOND
    n: int              # points

    @property
    def J(self):
        """det F of that particle."""
        return self.measures[-1]

    @property
    def astray(self):
        """Whether a point is where its law has seen nothing."""
        return self.count > 0


def known(about, d):
    """Bounds of `seen`, and the `dt` [s] of training if that is told, from what is known of trained
    laws; None where no bounds are. Raises ValueError for what are none in d dimensions.
    """
    if "seen" not in about:
        return None
    given = about["seen"]
    try:
        low, high = (np.array(given[end], dtype=float) for end in ("low", "high"))
    except (TypeError, KeyError, ValueError):
        low = high = np.zeros(0)
    if low.shape != (d + 1,) or high.shape != (d + 1,) or not (low <= high).all():
        raise ValueError(f"strains seen in training: {given}; expected low and high, for {d} "
                         "stretches and J; train again")
    dt = about.get("dt")
    if dt is not None and not (isinstance(dt, int | float) and 0.0 < dt < np.inf):
        raise ValueError(f"time step of training: {dt}; expected a number above 0, in s; train "
                         "again")
    return {"low": low.tolist(), "high": high.tolist(), "dt": dt}


def other_steps(problem):
    """The warnings about laws that were trained in steps of another length than a run's."""
    for name, bounds in problem.seen.items():
        if bounds["dt"] not in (None, problem.clock.dt):
            yield (f"body {name!r}: its laws were trained in steps of {bounds['dt']:g} s, this run "
                   f"has {in_words(problem.clock.dt)}: a learned return map acts once a step, "
                   "so that it may answer otherwise")


def in_words(dt):
    """A time step [s] in words; None is an adaptive one."""
    return "an adaptive one" if dt is None else f"dt = {dt:g} s"


class Watch:
    """What the states of a run are looked at with.

    bounds: {name of a body: bounds as of `known`}, of bodies with learned laws. Each body is
    reported once.
    """

    def __init__(self, bounds):
        self.bounds, self.silent = bounds, set(bounds)

    def news(self, state):
        """The sentences about a `simulate.State`: of each body whose points are astray for the
        first time, looked at every CHECK steps.
        """
        if state.step % CHECK or not self.silent:
            return []
        found = [self.look(body) for body in state.bodies if body.name in self.silent]
        astray = [sight for sight in found if sight.astray]
        self.silent -= {sight.body for sight in astray}
        return [sentence(sight, state, self.bounds[sight.body]) for sight in astray]

    def look(self, body):
        """`Sight` of a body."""
        return look(body, self.bounds[body.name])


def watch(problem):
    """`Watch` of a run of a `Problem`; None where no law says what it has seen."""
    return Watch(problem.seen) if problem.seen else None


def look(body: Body, bounds):
    """`Sight` of a body by bounds of `seen`."""
    with np.errstate(invalid="ignore", over="ignore"):
        found = measures(gradients(body))
    out = beyond(found, bounds)
    p = int(np.argmax(out))
    return Sight(body.name, int(body.id[p]), tuple(found[p].tolist()), float(out[p]),
                 int(np.sum(out > BEYOND)), len(out))


def beyond(found, bounds):
    """How far (n,) points are out of bounds; found: their stretches and J (n, d + 1). Infinite
    where J <= 0 is below all that was seen, and where there is no finite F.
    """
    low, high = (np.array(bounds[end]) for end in ("low", "high"))
    with np.errstate(invalid="ignore", over="ignore"):
        out = np.maximum(low - found, found - high) / np.maximum(high - low, THIN)
        worst = np.maximum(out.max(axis=1), 0.0)
        inverted = (found[:, -1] <= 0.0) & (found[:, -1] < low[-1])
    return np.where(inverted | ~np.isfinite(found).all(axis=1), np.inf, worst)


def sentence(sight, state, bounds):
    """Where and when a law is asked about what it has not seen, and what may help."""
    *s, J = (f"{a:.4g}" for a in sight.measures)
    *ranges, of_J = (f"{low:.4g} to {high:.4g}"
                     for low, high in zip(bounds["low"], bounds["high"], strict=True))
    others = f", and {sight.count - 1} others" if sight.count > 1 else ""
    return (f"step {state.step}, t = {state.t:.6g} s: body {sight.body!r}: particle "
            f"{sight.particle}{others}: principal stretches {', '.join(s)}, J = {J}, are outside "
            f"what its learned law has seen in training: {', '.join(ranges)}, J {of_J}; its answer "
            "there is a guess: train on a run that strains as much, or load this one less")
