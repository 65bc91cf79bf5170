"""The loss of a decoder (LDM-eq24), and the batches of snapshots that it is evaluated on.

Its three terms, errors of position, deformation gradient and velocity, are means over snapshots
and points of squared lengths, in SI units. Gradients flow
through dg/dX and dg/dxhat; the public training code evaluates them without, so that its second term
trains nothing and its third the encoder alone.
"""

from typing import NamedTuple

import torch

from .networks import with_derivatives


class LossWeights(NamedTuple):
    """Factors of the terms of LDM-eq24; their units are not printed (LDM-X7)."""

    F: float        # lambda_F [m^2]
    v: float        # lambda_v [s^2]


PRINTED = LossWeights(100.0, 0.01)      # LDM-defaults-train, read as SI units
CODE = LossWeights(1.0 / 30.0, 0.08)    # the same numbers in the units of the public training code:
                                    # 1000 MSE(u) + 100 MSE(F) + 8 * 10 MSE(v), means of components


def scale_weights(weights, length, time):
    """Return weights that keep the shares of the terms, for a body that is `length` times and steps
    that are `time` times larger.
    """
    return LossWeights(weights.F * length**2, weights.v * time**2)


TOWER = scale_weights(CODE, 42.0 / 0.4, 144.0 / 24.0)  # from the cylinder's height and time step
READINGS = {"printed": PRINTED, "code": CODE, "tower": TOWER}


class UnitTensors(NamedTuple):
    """`DecoderUnits` as tensors."""

    low: torch.Tensor
    span: torch.Tensor
    mean: torch.Tensor
    std: torch.Tensor


class SnapshotTensors(NamedTuple):
    """Snapshots of all training runs, flattened run by run; s snapshots of n points."""

    X: torch.Tensor         # (n, d)
    u: torch.Tensor         # (s, n, d)     displacement [m]
    F: torch.Tensor         # (s, n, d, d)  None, like v: unknown
    v: torch.Tensor         # (s, n, d)     velocity [m/s]
    successor: torch.Tensor # (s,)          number of the next one; of a run's last one, its own
    units: UnitTensors
    dt: float

    @property
    def standardised(self):
        """The displacements as the encoder reads them."""
        return (self.u - self.units.mean) / self.units.std


class Batch(NamedTuple):
    """Pairs of successive snapshots, at some points; n rows."""

    X: torch.Tensor         # (n, d)    at rest [m]
    u: torch.Tensor         # (n, d)    displacement [m]
    F: torch.Tensor         # (n, d, d)
    v: torch.Tensor         # (n, d)    velocity at the end of the step that begins here [m/s]
    xhat: torch.Tensor      # (n, r)    latent coordinates
    vhat: torch.Tensor      # (n, r)    their rates to the next snapshot [1/s]


def tensors_of(snapshots, units, dtype=torch.float32, device="cpu"):
    """Return the `SnapshotTensors` of `Snapshots`, on a device but for `successor`: numbers are
    chosen on the processor.
    """
    def tensor(a):
        return torch.as_tensor(a, dtype=dtype, device=device).contiguous()

    def flat(a):
        return None if a is None else tensor(a.reshape(runs * levels, *a.shape[2:]))

    runs, levels = snapshots.x.shape[:2]
    number = torch.arange(runs * levels).reshape(runs, levels)
    following = torch.cat([number[:, 1:], number[:, -1:]], dim=1).reshape(-1)
    return SnapshotTensors(tensor(snapshots.X), flat(snapshots.x - snapshots.X), flat(snapshots.F),
                flat(snapshots.v), following, UnitTensors(*map(tensor, units)), snapshots.dt)


def batch_of(data, chosen, points, latents):
    """Return the `Batch` of chosen snapshots and their successors, at some points. The last of a
    run has none, and an error of velocity of zero (LDM-eq24): no rates, and a velocity of zero to
    meet.

    latents(numbers) gives latent coordinates (s, r); each row of the batch is one point of one
    snapshot. Where F and v are unknown, so are the batch's, and no successor is looked at.
    """
    X = data.X[points].repeat(len(chosen), 1)

    def rows(a):
        return a[chosen[:, None], points].flatten(0, 1)

    def each(a):
        return a.repeat_interleave(len(points), dim=0)

    if data.F is None:
        return Batch(X, rows(data.u), None, None, each(latents(chosen)), None)
    after = data.successor[chosen]
    xhat = latents(torch.cat([chosen, after]))
    now, later = xhat[:len(chosen)], xhat[len(chosen):]
    goes_on = (after != chosen).to(data.v.device)
    v = (data.v[after] * goes_on[:, None, None])[:, points].flatten(0, 1)
    return Batch(X, rows(data.u), rows(data.F), v, each(now), each((later - now) / data.dt))


def terms(f, batch, units, weights):
    """Return the three means of squared lengths [m^2, 1, m^2/s^2]; those without weight are zero
    and cost nothing.
    """
    X = (batch.X - units.low) / units.span
    if not (weights.F or weights.v):
        y = f(X, batch.xhat)
        position = mean_square(units.std * y + units.mean - batch.u)
        return position, y.new_zeros(()), y.new_zeros(())
    y, dX, dxhat = with_derivatives(f, X, batch.xhat)
    identity = torch.eye(y.shape[1], dtype=y.dtype, device=y.device)
    F = identity + units.std[:, None] * dX / units.span
    v = units.std * torch.einsum("nkr,nr->nk", dxhat, batch.vhat)
    return (mean_square(units.std * y + units.mean - batch.u), mean_square(F - batch.F),
            mean_square(v - batch.v))


def mean_square(error):
    """Return the mean over the first axis of squared lengths."""
    return error.square().flatten(1).sum(dim=1).mean()


def loss(f, batch, units, weights):
    """Return LDM-eq24 over the variance of the displacement, and its terms."""
    position, F, v = terms(f, batch, units, weights)
    total = position + weights.F * F + weights.v * v
    return total / units.std.square().sum(), (position, F, v)
