"""Samples: the material points that represent the body in a reduced step (LDM-sec3.3-hyper,
LDMW-sets).
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

PER_GROUP = 5       # samples of each kinematic boundary, at least


class Draw(NamedTuple):
    """Random samples: `count` of n points, at least `per_group` of each group of indices."""

    n: int
    count: int
    groups: tuple = ()      # index arrays: the points near each kinematic boundary
    per_group: int = PER_GROUP

    def __call__(self, rng):
        """Return sorted indices, drawn uniformly without replacement, those of the groups first."""
        if self.count == self.n:
            return np.arange(self.n)
        forced = [rng.choice(group, min(self.per_group, len(group)), replace=False)
                  for group in self.groups]
        forced = np.unique(np.concatenate(forced)) if forced else np.empty(0, dtype=int)
        drawn = rng.choice(self.n, self.count, replace=False)
        rest = drawn[~np.isin(drawn, forced)][:self.count - len(forced)]
        return np.sort(np.concatenate([forced, rest]))


def draw(n, count, r, dim, groups=()):
    """Return the `Draw` of count samples for r latent coordinates in dim axes.

    Raises ValueError for more samples than points, for too few for the latent coordinates
    (LDM-X14), and for fewer than the groups need.
    """
    if not 1 <= count <= n:
        raise ValueError(f"{count} samples of {n} points: expected 1 .. {n}")
    if count * dim < r:
        raise ValueError(f"{count} samples in {dim} axes for {r} latent coordinates: expected at "
                         f"least {-(-r // dim)} samples")
    groups = tuple(np.asarray(group) for group in groups if len(group))
    if any(group.min() < 0 or group.max() >= n for group in groups):
        raise ValueError(f"a kinematic boundary names a point outside 0 .. {n - 1}")
    forced = sum(min(PER_GROUP, len(group)) for group in groups)
    if forced > count:
        raise ValueError(f"{count} samples with {PER_GROUP} for each of {len(groups)} kinematic "
                         f"boundaries: expected at least {forced}")
    return Draw(n, count, groups)


def pivoted(G, count):
    """Return indices of `count` of n points that determine latent coordinates best, by Q-DEIM (Z.
    Drmac and S. Gugercin, SIAM J. Sci. Comput. 38 (2016) A631).

    G (n, d, r): dg/dxhat at the points. A QR factorisation with column pivoting takes the points of
    the r most independent rows, then those among the points left, and so on.
    """
    left, chosen = np.arange(len(G)), []
    while len(chosen) < min(count, len(G)):
        rows = G[left].reshape(-1, G.shape[2])
        order = qr(rows.T, mode="r", pivoting=True)[1][:G.shape[2]] // G.shape[1]
        pivots = left[np.sort(np.unique(order))]
        chosen += pivots[:count - len(chosen)].tolist()
        left = np.setdiff1d(left, pivots)
    return np.array(chosen)
