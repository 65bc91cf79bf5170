"""Sources of the latent coordinates of training snapshots: an encoder, one unknown vector for each
snapshot, or vectors that are known beforehand.

The encoder is a stack of one-dimensional convolutions and two full layers (LDM-tab1, NSF-encoder;
see `architecture`). It ties the latent coordinates to one sampling of the body; online it is not
needed.
"""

from itertools import pairwise

import torch
from torch import nn

from ..fields.architecture import FEATURES, KERNEL


class Encoder(nn.Module):
    """xhat = e(standardised displacements of all points), LDM-sec4.1-encoder, NSF-encoder: of one
    row of values, or one for each axis, as the `Stack` has it.

    Latent coordinates are the last layer's plain sums; the public training code of NSF's precursor
    has an ELU on them, and stops its convolutions earlier.
    """

    def __init__(self, stack, r):
        super().__init__()
        self.rows = stack.rows[0]
        self.convolutions = nn.ModuleList(nn.Conv1d(n, m, KERNEL, stack.stride)
                                          for n, m in pairwise(stack.rows))
        self.full = nn.Linear(stack.rows[-1] * stack.lengths[-1], FEATURES)
        self.last = nn.Linear(FEATURES, r)
        for layer in (*self.convolutions, self.full, self.last):
            nn.init.xavier_uniform_(layer.weight)

    def forward(self, u):
        """Return the latent coordinates (s, r) of displacements u (s, n, d)."""
        a = u.reshape(len(u), -1, self.rows).transpose(1, 2)
        for layer in self.convolutions:
            a = nn.functional.elu(layer(a))
        return self.last(nn.functional.elu(self.full(a.flatten(1))))


class LatentTable(nn.Module):
    """Latent coordinates as unknowns of the training, one vector for each snapshot (LDMW-eq7)."""

    def __init__(self, snapshots, r):
        super().__init__()
        self.table = nn.Embedding(snapshots, r)
        nn.init.normal_(self.table.weight, std=0.1)

    def forward(self, index):
        """Return the latent coordinates (s, r) of snapshots by number."""
        return self.table(index)


class FixedLatents(nn.Module):
    """Latent coordinates that are known before the training, one vector for each snapshot; and
    perhaps the modes (n, d, r) that they are of [m].
    """

    def __init__(self, xhat, modes=None):
        super().__init__()
        self.register_buffer("table", torch.as_tensor(xhat, dtype=torch.float32))
        self.register_buffer("modes", None if modes is None else torch.as_tensor(
            modes, dtype=torch.float32), persistent=False)

    def forward(self, index):
        """Return the latent coordinates (s, r) of snapshots by number."""
        return self.table[index]


def encode(encoder, u, batch=64):
    """Return the latent coordinates of many snapshots u (s, n, d), without gradients."""
    with torch.no_grad():
        return torch.cat([encoder(u[i:i + batch]) for i in range(0, len(u), batch)])
