"""Stages of a step as differentiable functions of PyTorch, with the adjoints of `core`.

States are tensors of doubles; inputs and outputs of networks have the networks' precision.
"""

import torch
from torch.autograd import Function

from ...materials.learned import invariants, response
from .. import batched_step


class Invariants(Function):
    """Differentiable map F (n, d, d) -> invariants (n, count), in single precision, R (n, d, d)."""

    @staticmethod
    def forward(ctx, F):
        """Return the invariants a and R."""
        F = F.numpy()
        ctx.F, ctx.factors = F, invariants.spectrum(F)
        a, R = invariants.invariants(F, ctx.factors), invariants.rotations(ctx.factors)
        return torch.from_numpy(a).float(), torch.from_numpy(R)

    @staticmethod
    def backward(ctx, a_bar, R_bar):
        """Return the gradient of F."""
        a_bar, R_bar = a_bar.double().numpy(), R_bar.contiguous().numpy()
        return torch.from_numpy(invariants.pull_back(ctx.F, ctx.factors, a_bar, R_bar))


class Answer(Function):
    """Networks' Y (n, d^2), F, R (n, d, d) -> answers (n, d, d) of a kind of `response`."""

    @staticmethod
    def forward(ctx, Y, F, R, kind):
        """Return the answers (n, d, d)."""
        ctx.kind, ctx.precision = kind, Y.dtype
        ctx.inputs = Y.double().numpy().reshape(F.shape), F.numpy(), R.numpy()
        return torch.from_numpy(response.answers(*ctx.inputs, kind))

    @staticmethod
    def backward(ctx, G):
        """Return the gradients of Y, F, R."""
        gradients = response.pull_back(G.contiguous().numpy(), *ctx.inputs, ctx.kind)
        Y, F, R = map(torch.from_numpy, gradients)
        return Y.reshape(len(Y), -1).to(ctx.precision), F, R, None


class Advance(Function):
    """x, v, C, F, tau (b, n, ..) -> x, v, C and trial F after a step in a world (see
    `batched_step`).
    """

    @staticmethod
    def forward(ctx, world, nodes, *before):
        """Return x, v, C and the trial F after the step."""
        ctx.world, ctx.nodes = world, nodes
        ctx.before = batched_step.States(*(a.numpy() for a in before))
        ctx.after = batched_step.advance(world, ctx.before, nodes)
        return tuple(map(torch.from_numpy, ctx.after[:4]))

    @staticmethod
    def backward(ctx, *bars):
        """Return the gradients of the states before and of tau."""
        bars = batched_step.States(*(bar.contiguous().numpy() for bar in bars))
        gradients = batched_step.pull_back(ctx.world, ctx.before, ctx.after, bars, ctx.nodes)
        return None, None, *map(torch.from_numpy, gradients)
