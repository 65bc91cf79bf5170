"""Indicators of error that a run has in itself: they need neither a finer grid nor another run.

    watch = IndicatorWatch(problem)         # before the first step
    watch.news(state, dt)                   # after each: sentences on bounds that were passed

    gap           by how much farther apart particles of an elastic solid are that were neighbours
                  at the start [cells]: numerical fracture, where they share no node any more
    dissipation   mechanical energy that the whole run lost, as a share of what could have become
                  motion; only where nothing drives, rubs or flows, so that none should be lost
    dispersion    error of the phase of elastic waves: their crossings of a body so far, over the
                  square of the cells across it, times the share of the motion that deforms it;
                  implicit steps and return maps damp such waves anyway

A scheme of second order has waves that are slower by a share (pi/n)^2/24 where half a wave has n
cells [Trefethen1982], so that crossings add up to an error. The bounds were chosen on other scenes
than those on which `trade.limits` counts what they notice, and how often in vain.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from .body import Body
from .core.law import psi
from .energy import energy
from .materials import NoFlow, stiffness
from .simulate import ended

SAMPLES = 16        # times in a run at which states are measured, besides its end
GAP, DISPERSION, DISSIPATION = 2.0, 1.0, 0.6


class BodyAtRest(NamedTuple):
    """A body at its start, as the indicators compare it, in the order of its sampling."""

    x: np.ndarray           # (N, d) positions [m]
    neighbours: np.ndarray | None   # (N, 2 d) numbers of the nearest particles; None: not elastic
    speed: float            # of elastic waves at rest [m/s]
    length: float           # largest extent [m]
    thickness: float        # smallest extent [m]


def at_rest(body: Body):
    """Return the `BodyAtRest` of a body as it stands."""
    q, d = body.particles, body.particles.x.shape[1]
    extent = np.ptp(q.x, axis=0) + np.mean(q.V0) ** (1.0 / d)
    speed = np.sqrt(stiffness(body.law) * q.V0.sum() / q.m.sum())
    x = in_order(body, q.x)
    return BodyAtRest(x, nearest(x, 2 * d) if is_elastic(body) else None, float(speed),
                      float(extent.max()), float(extent.min()))


def in_order(body, values):
    """Return values (N, ..) of a body's particles in the order of their sampling."""
    ordered = np.empty_like(values)
    ordered[body.id] = values
    return ordered


def nearest(x, k):
    """Return the numbers (N, k) of the k points nearest to each of the points x (N, d), fewer where
    there are no more.
    """
    k = min(k, len(x) - 1)
    return cKDTree(x).query(x, k + 1)[1].reshape(len(x), -1)[:, 1:]


def is_elastic(body):
    """Return whether a body's particles stay neighbours: it is no fluid, and does not flow."""
    return body.particles.F.ndim > 1 and isinstance(body.flow, NoFlow)


def lasting(problem):
    """Return the bodies of a problem whose particles are the same from the start to the end."""
    growing = {source.body for source in problem.sources}
    return [body for k, body in enumerate(problem.bodies)
            if k not in growing and not problem.sinks]


# formulas

def widest_gap(X, x, neighbours):
    """Return by how much farther [m] points are from their neighbours (N, k) at x (N, d) than they
    were at X, at most; 0 where none is.
    """
    return float(np.max(distances(x, neighbours) - distances(X, neighbours), initial=0.0))


def distances(x, neighbours):
    """Return the distances (N, k) [m] of points x (N, d) from their neighbours (N, k)."""
    return np.sqrt(np.sum((x[neighbours] - x[:, None]) ** 2, axis=2))


def deformation_share(X, x):
    """Return the share of the motion from X to x (N, d) that no rigid motion has, of its root mean
    square; 0 where nothing moved [Kabsch1976].
    """
    A, b = X - X.mean(axis=0), x - x.mean(axis=0)
    U, _, Vt = np.linalg.svd(np.einsum("pa,pb->ab", A, b))     # the same bits for any threads
    U[:, -1] *= np.sign(np.linalg.det(U @ Vt))
    motion = np.sum((x - X) ** 2)
    return float(np.sqrt(np.sum((b - A @ U @ Vt) ** 2) / motion)) if motion > 0.0 else 0.0


def phase_error(rest, share, dx, t):
    """Return the indicator of dispersion of a body at t [s], of whose motion a share deforms it."""
    return share * (rest.speed * t / rest.length) * (dx / rest.thickness) ** 2


def energy_lost(start, least, lowest):
    """Return the share of the mechanical energy that could become motion which a run has lost.

    start: `energy.Energy`; least, lowest: the least sum and the least energy of gravity of the run
    [J].
    """
    available = start.kinetic + start.elastic + start.gravity - lowest
    return (start.sum - least) / available if available > 0.0 else 0.0


def conserves_energy(problem):
    """Return whether a run of a problem loses no mechanical energy but by its discretisation: one
    of explicit steps, since backward Euler takes energy by design, without return maps, friction,
    moving parts, sources, sinks, body forces of particles and a box that keeps them, and with laws
    that have an energy.
    """
    bodies, conditions = problem.bodies, problem.conditions
    if problem.integrator != "explicit" or problem.clip is not None:
        return False
    if problem.sources or problem.sinks:
        return False
    if any(body.particles.b.ndim > 1 or type(body.law) not in psi.methods
           or not isinstance(body.flow, NoFlow) for body in bodies):
        return False
    return conditions is None or not (getattr(conditions, "moves", True) or any(
        part.friction for part in (*conditions.parts, conditions.walls) if part is not None))


# the bounds, and their sentences

class Indicator(NamedTuple):
    """The bound that an indicator is not to exceed, and its sentence with {value}, {bound}, {body},
    {t} [s].
    """

    bound: float
    sentence: str
    advice: str


INDICATORS = {
    "gap": Indicator(GAP, "neighbours of body {body!r} are {value:.3g} cells farther apart at "
                     "t = {t:.4g} s than at the start (bound {bound:g}): numerical fracture, the "
                     "body tears where its particles share no node", "take more points per cell, "
                     "or less load"),
    "dissipation": Indicator(DISSIPATION, "the run has lost {value:.0%} of its mechanical "
                             "energy (bound {bound:.0%}), though it has no friction, plastic "
                             "flow or moving part", "take a "
                             "finer grid, or longer steps if they are far below their bound"),
    "dispersion": Indicator(DISPERSION, "elastic waves cross body {body!r} so often on so "
                            "few cells that their phases err (indicator {value:.3g}, bound "
                            "{bound:g}, from t = {t:.4g} s on)", "take a finer grid, or an earlier "
                            "end"),
}


def sentence_of(name, value, body, t):
    """Return the sentence on an indicator whose value is past its bound at t [s]."""
    one = INDICATORS[name]
    text = one.sentence.format(value=value, bound=one.bound, body=body, t=t)
    return f"{name}: {text}; {one.advice}"


# during a run

class IndicatorWatch:
    """Measures the states of a run now and then, and reports each indicator once.

    `news` reads the state and changes nothing in it; which states are measured is a function of
    them alone. Of a resumed run the states before are not measured again.
    """

    def __init__(self, problem):
        """Prepare to watch a run of a problem whose bodies stand as they start."""
        self._problem = problem
        self._rest = {body.name: at_rest(body) for body in lasting(problem)}
        self._conserves = conserves_energy(problem)
        self._start = energy(problem.bodies, problem.gravity, problem.inertia)
        self._least, self._lowest = self._start.sum, self._start.gravity
        self._worst = {}            # {name: value}
        self._reported = set()

    def values(self):
        """Return {name: worst value so far}, of the indicators that were measured."""
        return dict(self._worst)

    def news(self, state, dt):
        """Return the sentences on indicators that are past their bounds for the first time in a
        `simulate.State` after a step of length dt [s].
        """
        if not is_due(self._problem.clock, state, dt):
            return []
        sentences = []
        for name, value, body in self._measured(state):
            self._worst[name] = max(value, self._worst.get(name, value))
            if value > INDICATORS[name].bound and name not in self._reported:
                self._reported.add(name)
                sentences.append(sentence_of(name, value, body, state.t))
        return sentences

    def _measured(self, state):
        """Yield (name, value, body's name) of all indicators of a state."""
        for body in state.bodies:
            if body.name in self._rest:
                yield from self._measured_body(body, state.t)
        if self._conserves:
            now = energy(state.bodies, self._problem.gravity, self._problem.inertia)
            self._least = min(self._least, now.sum)
            self._lowest = min(self._lowest, now.gravity)
            if ended(self._problem.clock, state):
                yield "dissipation", energy_lost(self._start, self._least, self._lowest), ""

    def _measured_body(self, body, t):
        rest, dx = self._rest[body.name], self._problem.dx
        x = in_order(body, body.particles.x)
        if not np.isfinite(x).all():            # the monitor says so
            return
        if rest.neighbours is not None:
            yield "gap", widest_gap(rest.x, x, rest.neighbours) / dx, body.name
        if self._problem.integrator == "explicit" and isinstance(body.flow, NoFlow):
            share = deformation_share(rest.x, x)
            yield "dispersion", phase_error(rest, share, dx, t), body.name


def is_due(clock, state, dt):
    """Return whether a state after a step of length dt [s] is measured: the first one past each
    sixteenth of the run, and the last.
    """
    if ended(clock, state):
        return True
    span, now, before = (clock.end, state.t, state.t - dt) if clock.end is not None else (
        clock.steps, state.step, state.step - 1)
    return int(SAMPLES * now / span) > int(SAMPLES * before / span)
