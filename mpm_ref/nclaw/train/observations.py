"""A trajectory of which not all is seen: errors count where it is, segments begin where it is."""

from typing import NamedTuple

import numpy as np
import torch


class Partial(NamedTuple):
    """Observed states at time levels 0 .. k, and what they count, in place of a
    `rollout.Trajectory`; tensors of doubles.

    What stands at a level where nothing counts is never read; the first level must be seen. Weights
    with a mean of 1 over the levels after the first leave the size of a loss
    as it is.
    """

    x: torch.Tensor         # (k + 1, n, 3)    [m]
    v: torch.Tensor         # (k + 1, n, 3)    [m/s]
    C: torch.Tensor         # (k + 1, n, 3, 3) [1/s]
    F: torch.Tensor         # (k + 1, n, 3, 3)
    weight: torch.Tensor    # (k + 1, n) of squared errors

    def at(self, levels):
        """The states (b, n, ..) at b time levels."""
        return tuple(a[levels] for a in self[:4])

    def restarts(self, cuts):
        """Where segments begin that are asked for at time levels `cuts`, at the last seen level
        before each; and the end as it is.
        """
        seen = np.flatnonzero(self.weight.any(dim=1).numpy())
        begins = seen[np.searchsorted(seen, cuts[:-1], side="right") - 1]
        return [*np.unique(begins).tolist(), cuts[-1]]

    def off(self, name, a, levels):
        """Weighted squared errors of a field `a` (b, n, 3) at b time levels, their mean over points
        and axes, summed over the levels.
        """
        weight = self.weight[levels]
        off = torch.where((weight > 0.0)[..., None], a - getattr(self, name)[levels], 0.0)
        return (weight * (off**2).mean(dim=2)).mean(dim=1).sum()
