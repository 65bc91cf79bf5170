"""Segments of a trajectory, run side by side with neural laws, and their loss (NCLAW-alg2).

    tau = E(F),    x, v, C, F_trial = step(x, v, C, F, tau),    F = P(F_trial)

Segments are independent: each restarts from an observed state.
"""

from functools import partial
from typing import NamedTuple

import torch
from torch.utils.checkpoint import checkpoint

from ..batched_step import make_nodes
from .autograd import Advance
from .recipe import Recipe

DEFAULT = Recipe()


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


def segment_errors(laws, world, observed, starts, ends, recipe=DEFAULT):
    """Return the `SegmentErrors`: mean squared errors of positions, over particles and axes, summed
    over the steps of segments from time levels `starts` to later ones, `ends`.

    Segments that have ended go no further. In the loss the errors of velocities are added, times
    the recipe's `velocity` [s^2], and `second_return`, times its `idempotence` [m^2]. Of the states
    the backward sweep keeps at least every `keep_every`-th.
    """
    levels, last = torch.tensor(starts), torch.tensor(ends)
    state, nodes = observed.states(levels), make_nodes(world, len(starts))
    anew = recipe.keep_every > 1
    positions = torch.zeros((), dtype=torch.float64)
    total = torch.zeros((), dtype=torch.float64, requires_grad=anew)    # `checkpoint` needs one
    while len(levels):
        count = int((last - levels).min())
        count = min(count, recipe.keep_every) if anew else count
        part = partial(run_part, (laws, world, observed, recipe), nodes, levels, count)
        total, positions, *state = (checkpoint(part, total, positions, *state, use_reentrant=True)
                                    if anew else part(total, positions, *state))
        positions, levels = positions.detach(), levels + count
        under_way = levels < last
        if not under_way.all():
            levels, last, *state = (a[under_way] for a in (levels, last, *state))
    return SegmentErrors(total, positions)


def run_part(terms, nodes, levels, count, total, positions, *state):
    """Advance a state at time levels by `count` steps; return both sums, with the errors after each
    step added, and the state. terms: laws, world, observation and recipe.
    """
    laws, world, observed, recipe = terms
    for k in range(1, count + 1):
        state = step(laws, world, state, nodes)
        off = observed.squared_error("x", state[0], levels + k)
        total, positions = total + off, positions + off.detach()
        if recipe.velocity:
            total = total + recipe.velocity * observed.squared_error("v", state[1], levels + k)
        if recipe.idempotence:
            total = total + recipe.idempotence * second_return(laws.plastic, state[3])
    return total, positions, *state


def second_return(law, F):
    """Return the squared change of F (b, n, d, d) in a return map, which has returned it before:
    its mean over points and components, summed over runs. It is 0 of a projection.
    """
    return ((over_points(law, F) - F) ** 2).mean(dim=(1, 2, 3)).sum()
