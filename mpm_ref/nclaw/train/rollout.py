"""Segments of a trajectory, run side by side with neural laws, and their loss (NCLAW-alg2).

    tau = E(F),    x, v, C, F_trial = step(x, v, C, F, tau),    F = P(F_trial)

Segments are independent: each restarts from an observed state.
"""

from typing import NamedTuple

import torch

from ..batched_step import make_nodes
from .autograd import Advance


class LawPair(NamedTuple):
    """An elastic law and a flow to be learned, functions of F (n, d, d)."""

    elastic: object     # -> tau [Pa]
    plastic: object     # -> F


def over_points(law, F):
    """Return a law of F (b, n, 3, 3)."""
    return law(F.reshape(-1, *F.shape[2:])).reshape(F.shape)


def step(laws, world, state, nodes):
    """Return the state (x, v, C, F) after a step."""
    tau = over_points(laws.elastic, state[3])
    x, v, C, F = Advance.apply(world, nodes, *state, tau)
    return x, v, C, over_points(laws.plastic, F)


class SegmentErrors(NamedTuple):
    """Squared errors of segments."""

    loss: torch.Tensor          # the loss of the training [m^2]
    positions: torch.Tensor     # its part that is of positions, without a gradient [m^2]


def segment_errors(laws, world, observed, starts, ends, velocity=0.0):
    """Return the `SegmentErrors`: mean squared errors of positions, over particles and axes, summed
    over the steps of segments from time levels `starts` to later ones, `ends`.

    Segments that have ended go no further. In the loss the errors of velocities are added, times
    `velocity` [s^2].
    """
    levels, last, total, positions = torch.tensor(starts), torch.tensor(ends), 0.0, 0.0
    state, nodes = observed.states(levels), make_nodes(world, len(starts))
    while len(levels):
        state, levels = step(laws, world, state, nodes), levels + 1
        off = observed.squared_error("x", state[0], levels)
        total, positions = total + off, positions + off.detach()
        if velocity:
            total = total + velocity * observed.squared_error("v", state[1], levels)
        under_way = levels < last
        if not under_way.all():
            levels, last, *state = (a[under_way] for a in (levels, last, *state))
    return SegmentErrors(total, positions)
