"""Segments of a trajectory, run side by side with neural laws, and their loss (NCLAW-alg2).

    tau = E(F),    x, v, C, F_trial = step(x, v, C, F, tau),    F = P(F_trial)

Segments do not know each other: each restarts from what was observed.
"""

from typing import NamedTuple

import torch

from ..batched_step import nodes
from .autograd import Advance


class Trajectory(NamedTuple):
    """Observed states at time levels 0 .. k; tensors of doubles."""

    x: torch.Tensor     # (k + 1, n, 3)    [m]
    v: torch.Tensor     # (k + 1, n, 3)    [m/s]
    C: torch.Tensor     # (k + 1, n, 3, 3) [1/s]
    F: torch.Tensor     # (k + 1, n, 3, 3)

    def at(self, levels):
        """The states (b, n, ..) at b time levels."""
        return tuple(a[levels] for a in self)

    def restarts(self, cuts):
        """Where segments begin that are asked for at time levels `cuts`, and end: as asked for."""
        return cuts

    def off(self, name, a, levels):
        """Squared errors of a field `a` (b, n, 3) at b time levels, their mean over points and
        axes, summed over the levels.
        """
        return mean_squared(a, getattr(self, name)[levels])


def trajectory_of(observed):
    """`Trajectory` of `Observed`."""
    return Trajectory(*(torch.from_numpy(a) for a in (observed.x, observed.v, observed.C,
                                                      observed.F)))


class Laws(NamedTuple):
    """What is learned: functions of F (n, d, d)."""

    elastic: object     # -> tau [Pa]
    plastic: object     # -> F


def over_points(law, F):
    """A law of F (b, n, 3, 3)."""
    return law(F.reshape(-1, *F.shape[2:])).reshape(F.shape)


def step(laws, world, state, on):
    """The state (x, v, C, F) after a step."""
    tau = over_points(laws.elastic, state[3])
    x, v, C, F = Advance.apply(world, on, *state, tau)
    return x, v, C, over_points(laws.plastic, F)


class Squared(NamedTuple):
    """Squared errors of segments."""

    loss: torch.Tensor          # what is learned from [m^2]
    positions: torch.Tensor     # its part that is of positions, without a gradient [m^2]


def squared(laws, world, observed, starts, ends, velocity=0.0):
    """`Squared`: mean squared errors of positions, over particles and axes, summed over the steps
    of segments from time levels `starts` to later ones, `ends`. Those that have ended go no
    further. In the loss those of velocities are added, times `velocity` [s^2].
    """
    levels, last, total, positions = torch.tensor(starts), torch.tensor(ends), 0.0, 0.0
    state, on = observed.at(levels), nodes(world, len(starts))
    while len(levels):
        state, levels = step(laws, world, state, on), levels + 1
        off = observed.off("x", state[0], levels)
        total, positions = total + off, positions + off.detach()
        if velocity:
            total = total + velocity * observed.off("v", state[1], levels)
        under_way = levels < last
        if not under_way.all():
            levels, last, *state = (a[under_way] for a in (levels, last, *state))
    return Squared(total, positions)


def mean_squared(a, b):
    """Squared differences of a, b (b, n, 3), their mean over points and axes, summed over runs."""
    return ((a - b) ** 2).mean(dim=(1, 2)).sum()
