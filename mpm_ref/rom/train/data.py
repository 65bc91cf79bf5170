"""Training snapshots as tensors, and batches of them."""

from typing import NamedTuple

import torch

from .loss import Batch, Scales


class Data(NamedTuple):
    """Snapshots of all training runs, flattened run by run; s snapshots of n points."""

    X: torch.Tensor         # (n, d)
    u: torch.Tensor         # (s, n, d)     displacement [m]
    F: torch.Tensor         # (s, n, d, d)  None, like v: unknown
    v: torch.Tensor         # (s, n, d)     velocity [m/s]
    next: torch.Tensor      # (s,)          number of the successor; of a run's last one, its own
    units: Scales
    dt: float

    @property
    def standardised(self):
        """Displacements as the encoder reads them."""
        return (self.u - self.units.mean) / self.units.std


def data_of(snapshots, units, dtype=torch.float32, device="cpu"):
    """`Data` of `Snapshots`, on a device but for `next`: numbers are chosen on the processor."""
    def tensor(a):
        return torch.as_tensor(a, dtype=dtype, device=device).contiguous()

    def flat(a):
        return None if a is None else tensor(a.reshape(runs * levels, *a.shape[2:]))

    runs, levels = snapshots.x.shape[:2]
    number = torch.arange(runs * levels).reshape(runs, levels)
    following = torch.cat([number[:, 1:], number[:, -1:]], dim=1).reshape(-1)
    return Data(tensor(snapshots.X), flat(snapshots.x - snapshots.X), flat(snapshots.F),
                flat(snapshots.v), following, Scales(*map(tensor, units)), snapshots.dt)


def batch_of(data, at, points, latents):
    """`Batch` of the snapshots `at` and their successors, at some points. The last of a run has
    none, and an error of velocity of zero (LDM-eq24): no rates, and a velocity of zero to meet.

    latents(numbers) gives latent coordinates (s, r); each row of the batch is one point of one
    snapshot. Where F and v are unknown, so are the batch's, and no successor is looked at.
    """
    X = data.X[points].repeat(len(at), 1)
    def rows(a):
        return a[at[:, None], points].flatten(0, 1)

    def each(a):
        return a.repeat_interleave(len(points), dim=0)

    if data.F is None:
        return Batch(X, rows(data.u), None, None, each(latents(at)), None)
    after = data.next[at]
    xhat = latents(torch.cat([at, after]))
    now, later = xhat[:len(at)], xhat[len(at):]
    goes_on = (after != at).to(data.v.device)
    v = (data.v[after] * goes_on[:, None, None])[:, points].flatten(0, 1)
    return Batch(X, rows(data.u), rows(data.F), v, each(now), each((later - now) / data.dt))
