"""Bars of return map and stress (see `adjoint_laws`), with their scales.

Of what a bar is computed from, F moves, and the history: their part is found by differences, as for
the primal stages (`scales.through`). In the bars that come in it is linear: their part is the sum
over their entries.
"""

from typing import NamedTuple

import numpy as np

from . import adjoint_laws
from .known import given
from .scales import size, through


class Seeds(NamedTuple):
    """Gradient of a loss by the state of one body after the step; None is not carried."""

    x: np.ndarray           # (N, d)
    v: np.ndarray           # (N, d)
    C: np.ndarray | None    # (N, d, d)
    F: np.ndarray           # (N, d, d), or (N,) of J
    y: np.ndarray | None    # (N,)


def returned(q, F_trial, dt, seed):
    """`Returned`, `Known`, of one body q, from the `Seeds` after the step; F_trial is a pair of
    values and scales (N,).
    """
    def bars(F, y, F_bar, y_bar):
        return adjoint_laws.of_return(q._replace(y=y), F, dt, F_bar, y_bar)

    (F, S_F), y = F_trial, q.y
    exact = bars(F, y, seed.F, seed.y)
    S = through(lambda F: flat(bars(F, y, seed.F, seed.y)), F, S_F)
    parts = [bars(F, y, unit, None if y is None else 0 * y) for unit in units(seed.F, size(seed.F))]
    if y is not None:
        S = plus(S, through(lambda y: flat(bars(F, y, seed.F, seed.y)), y, abs(y)))
        parts.append(bars(F, y, 0 * seed.F, seed.y))
    return scaled(exact, plus(S, *map(sizes, parts)))


def stressed(q, S_F, tau_bar):
    """`Stressed`, `Known`, of one body q whose F has the scales S_F (N,), from the bar of its
    stress, `Known`.
    """
    def bars(F, T):
        return adjoint_laws.of_stress(F, q.y, (q.law, q.flow), T)

    S = through(lambda F: flat(bars(F, tau_bar.value)), q.F, S_F)
    parts = [bars(q.F, unit) for unit in units(tau_bar.value, size(tau_bar.S[:, None]))]
    return scaled(bars(q.F, tau_bar.value), plus(S, *map(sizes, parts)))


def units(like, S):
    """Arrays shaped as `like` (N, ..) with one entry of size S (N,) in each, for all entries."""
    for k in np.ndindex(like.shape[1:]):
        unit = np.zeros_like(like)
        unit[(slice(None), *k)] = S
        yield unit


def flat(bars):
    """The arrays of a `Returned` or `Stressed`, in order, without what is None."""
    return [b for a in bars if a is not None for b in (a if isinstance(a, tuple) else [a])]


def sizes(bars):
    """Sizes (N,) of the entities of the arrays of `flat`."""
    return [size(a[:, None]) for a in flat(bars)]


def plus(*rows):
    """Sums of scales, array by array."""
    return [sum(column) for column in zip(*rows)]


def scaled(exact, S):
    """The record with `Known` for arrays, from the scales (N,) of those of `flat`."""
    left = iter(S)

    def next_known(a):
        if a is None:
            return None
        return tuple(map(next_known, a)) if isinstance(a, tuple) else given(a, next(left))

    return type(exact)(*map(next_known, exact))
