"""What training minimises (LDM-eq24): errors of position, deformation gradient and velocity.

All three are means over snapshots and points of squared lengths, in SI units. Gradients flow
through dg/dX and dg/dxhat; the public training code evaluates them without, so that its second term
trains nothing and its third the encoder alone.
"""

from typing import NamedTuple

import torch

from .perceptron import with_derivatives


class Weights(NamedTuple):
    """Factors of the terms of LDM-eq24; their units are not printed (LDM-X7)."""

    F: float        # lambda_F [m^2]
    v: float        # lambda_v [s^2]


PRINTED = Weights(100.0, 0.01)      # LDM-defaults-train, read as SI units
CODE = Weights(1.0 / 30.0, 0.08)    # the same numbers in the units of the public training code:
                                    # 1000 MSE(u) + 100 MSE(F) + 8 * 10 MSE(v), means of components


def scaled(weights, length, time):
    """The same shares of the terms for a body and steps that are so many times larger."""
    return Weights(weights.F * length**2, weights.v * time**2)


TOWER = scaled(CODE, 42.0 / 0.4, 144.0 / 24.0)      # from the cylinder's height and time step
READINGS = {"printed": PRINTED, "code": CODE, "tower": TOWER}


class Scales(NamedTuple):
    """`Units` as tensors."""

    low: torch.Tensor
    span: torch.Tensor
    mean: torch.Tensor
    std: torch.Tensor


class Batch(NamedTuple):
    """Pairs of successive snapshots, at some points; n rows."""

    X: torch.Tensor         # (n, d)    at rest [m]
    u: torch.Tensor         # (n, d)    displacement [m]
    F: torch.Tensor         # (n, d, d)
    v: torch.Tensor         # (n, d)    velocity at the end of the step that begins here [m/s]
    xhat: torch.Tensor      # (n, r)    latent coordinates
    vhat: torch.Tensor      # (n, r)    their rates to the next snapshot [1/s]


def terms(f, batch, units, weights):
    """The three means of squared lengths [m^2, 1, m^2/s^2]; those without weight are zero and cost
    nothing.
    """
    X = (batch.X - units.low) / units.span
    if not (weights.F or weights.v):
        y = f(X, batch.xhat)
        return squared(units.std * y + units.mean - batch.u), y.new_zeros(()), y.new_zeros(())
    y, dX, dxhat = with_derivatives(f, X, batch.xhat)
    identity = torch.eye(y.shape[1], dtype=y.dtype, device=y.device)
    F = identity + units.std[:, None] * dX / units.span
    v = units.std * torch.einsum("nkr,nr->nk", dxhat, batch.vhat)
    return squared(units.std * y + units.mean - batch.u), squared(F - batch.F), squared(v - batch.v)


def squared(error):
    """Mean over the first axis of squared lengths."""
    return error.square().flatten(1).sum(dim=1).mean()


def loss(f, batch, units, weights):
    """LDM-eq24 over the variance of the displacement, and its terms."""
    found = terms(f, batch, units, weights)
    total = found[0] + weights.F * found[1] + weights.v * found[2]
    return total / units.std.square().sum(), found
