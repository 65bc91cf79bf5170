"""Which material points stand for the body in a reduced step (LDM-sec3.3-hyper, LDMW-sets)."""

from typing import NamedTuple

import numpy as np

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
        free = np.setdiff1d(np.arange(self.n), forced)
        rest = rng.choice(free, max(self.count - len(forced), 0), replace=False)
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
