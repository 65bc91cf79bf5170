"""Training snapshots as tensors, and batches of them."""

from typing import NamedTuple

import torch

from .loss import Batch, Scales


class Data(NamedTuple):
    """Snapshots of all training runs, flattened run by run; s snapshots of n points."""

    X: torch.Tensor         # (n, d)
    u: torch.Tensor         # (s, n, d)     displacement [m]
    F: torch.Tensor         # (s, n, d, d)
    v: torch.Tensor         # (s, n, d)     velocity [m/s]
    next: torch.Tensor      # (s,)          number of the successor; of a run's last one, its own
    units: Scales
    dt: float

    @property
    def standardised(self):
        """Displacements as the encoder reads them."""
        return (self.u - self.units.mean) / self.units.std


def data_of(snapshots, units, dtype=torch.float32):
    """`Data` of `Snapshots`."""
    def tensor(a):
        return torch.as_tensor(a, dtype=dtype).contiguous()

    runs, levels = snapshots.x.shape[:2]
    x, F = snapshots.flat()
    number = torch.arange(runs * levels).reshape(runs, levels)
    following = torch.cat([number[:, 1:], number[:, -1:]], dim=1).reshape(-1)
    return Data(tensor(snapshots.X), tensor(x - snapshots.X), tensor(F),
                tensor(snapshots.v.reshape(x.shape)), following,
                Scales(*map(tensor, units)), snapshots.dt)


def batch_of(data, at, points, latents):
    """`Batch` of the snapshots `at` and their successors, at some points. The last of a run has
    none, and an error of velocity of zero (LDM-eq24): no rates, and a velocity of zero to meet.

    latents(numbers) gives latent coordinates (s, r); each row of the batch is one point of one
    snapshot.
    """
    after = data.next[at]
    xhat = latents(torch.cat([at, after]))
    now, later = xhat[:len(at)], xhat[len(at):]
    def rows(a):
        return a[at][:, points].flatten(0, 1)

    def each(a):
        return a.repeat_interleave(len(points), dim=0)

    v = (data.v[after] * (after != at)[:, None, None])[:, points].flatten(0, 1)
    return Batch(data.X[points].repeat(len(at), 1), rows(data.u), rows(data.F), v,
                 each(now), each((later - now) / data.dt))
