"""The stages of a step as differentiable functions of PyTorch; their adjoints are ours.

States are tensors of doubles; what networks read and answer is in their own precision.
"""

import torch
from torch.autograd import Function

from ...materials.learned import invariants, response
from .. import batched_step


class Invariants(Function):
    """F (n, d, d) -> what a law reads (n, count), in single precision, and R (n, d, d)."""

    @staticmethod
    def forward(ctx, F):
        """a, R."""
        F = F.numpy()
        ctx.F, ctx.of = F, invariants.spectrum(F)
        a, R = invariants.invariants(F, ctx.of), invariants.rotations(ctx.of)
        return torch.from_numpy(a).float(), torch.from_numpy(R)

    @staticmethod
    def backward(ctx, a_bar, R_bar):
        """Gradient of F."""
        a_bar, R_bar = a_bar.double().numpy(), R_bar.contiguous().numpy()
        return torch.from_numpy(invariants.pull_back(ctx.F, ctx.of, a_bar, R_bar))


class Answer(Function):
    """Networks' Y (n, d^2), F, R (n, d, d) -> answers (n, d, d) of a kind of `response`."""

    @staticmethod
    def forward(ctx, Y, F, R, kind):
        """The answers."""
        ctx.kind, ctx.precision = kind, Y.dtype
        ctx.of = Y.double().numpy().reshape(F.shape), F.numpy(), R.numpy()
        return torch.from_numpy(response.answers(*ctx.of, kind))

    @staticmethod
    def backward(ctx, G):
        """Gradients of Y, F, R."""
        found = response.pull_back(G.contiguous().numpy(), *ctx.of, ctx.kind)
        Y, F, R = map(torch.from_numpy, found)
        return Y.reshape(len(Y), -1).to(ctx.precision), F, R, None


class Advance(Function):
    """x, v, C, F, tau (b, n, ..) -> x, v, C and trial F after a step in a world (see `apart`)."""

    @staticmethod
    def forward(ctx, world, nodes, *before):
        """The states."""
        ctx.of, ctx.on = world, nodes
        ctx.before = batched_step.States(*(a.numpy() for a in before))
        ctx.after = batched_step.advance(world, ctx.before, nodes)
        return tuple(map(torch.from_numpy, ctx.after[:4]))

    @staticmethod
    def backward(ctx, *bars):
        """Gradients of the states before and of tau."""
        bars = batched_step.States(*(bar.contiguous().numpy() for bar in bars))
        found = batched_step.pull_back(ctx.of, ctx.before, ctx.after, bars, ctx.on)
        return None, None, *map(torch.from_numpy, found)
