"""Which material points stand for the body in a reduced step (LDM-sec3.3-hyper, LDMW-sets)."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

PER_GROUP = 5       # samples of each kinematic boundary, at least


class Draw(NamedTuple):
    """Random samples: `count` of n points, at least so many of each group of indices."""

    n: int
    count: int
    groups: tuple = ()      # index arrays: the points near each kinematic boundary
    per_group: int = PER_GROUP

    def __call__(self, rng):
        """Sorted indices, drawn uniformly without replacement, those of the groups first."""
        if self.count == self.n:
            return np.arange(self.n)
        forced = [rng.choice(group, min(self.per_group, len(group)), replace=False)
                  for group in self.groups]
        forced = np.unique(np.concatenate(forced)) if forced else np.empty(0, dtype=int)
        drawn = rng.choice(self.n, self.count, replace=False)
        rest = drawn[~np.isin(drawn, forced)][:self.count - len(forced)]
        return np.sort(np.concatenate([forced, rest]))


def draw(n, count, r, dim, groups=()):
    """`Draw` of count samples for r latent coordinates in dim axes.

    Raises ValueError where there are not so many points, too few samples for the latent coordinates
    (LDM-X14), or fewer than the groups ask for.
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
    """Indices of so many of n points that tell latent coordinates best, from dg/dxhat there, G (n,
    d, r): a QR factorisation with column pivoting takes the r most independent rows (Q-DEIM: Z.
    Drmac and S. Gugercin, SIAM J. Sci. Comput. 38 (2016) A631), then those of the points left, and
    so on.
    """
    left, chosen = np.arange(len(G)), []
    while len(chosen) < min(count, len(G)):
        rows = G[left].reshape(-1, G.shape[2])
        order = qr(rows.T, mode="r", pivoting=True)[1][:G.shape[2]] // G.shape[1]
        found = left[np.sort(np.unique(order))]
        chosen += found[:count - len(chosen)].tolist()
        left = np.setdiff1d(left, found)
    return np.array(chosen)
