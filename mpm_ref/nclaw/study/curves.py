"""Stress-strain curves of learned laws beside the true ones, along one-element paths."""

from math import nan
from typing import NamedTuple

import numpy as np

from ...materials import NoFlow
from ...materials.learned.strain_range import within_bounds
from ..paths import Path, course, cycles, looked_at, monotone


class Curve(NamedTuple):
    """Stresses along a path."""

    path: Path
    dt: float               # [s] of a step
    truth: np.ndarray       # (k + 1,) [Pa]
    learned: np.ndarray     # (k + 1,) [Pa]; NaN where the law broke down
    seen: np.ndarray | None     # (k + 1,) whether training saw such strains; None: not known

    @property
    def off(self):
        """Largest difference, of the largest true stress; NaN without true stress, or where the
        learned law broke down.
        """
        largest = np.abs(self.truth).max()
        return float(np.abs(self.learned - self.truth).max() / largest) if largest > 0.0 else nan

    @property
    def beyond(self):
        """The first strain of the path that training has not seen, or None."""
        outside = () if self.seen is None else np.flatnonzero(~self.seen)
        return float(self.path.strain[outside[0]]) if len(outside) else None

    @property
    def broken(self):
        """The strain at which the learned law first gives no finite stress, or None."""
        at = np.flatnonzero(~np.isfinite(self.learned))
        return float(self.path.strain[at[0]]) if len(at) else None


def curves(truth, learned, paths, dt, bounds=None):
    """[`Curve`] of paths. truth, learned: (law, flow) each; dt [s] of a step; bounds: strains that
    training has seen (see `learned.strain_range`), if known.
    """
    found = []
    for path in paths:
        true, own = (course(*of, path, dt) for of in (truth, learned))
        inside = None if bounds is None else within_bounds(own.F, bounds)
        found.append(Curve(path, dt, looked_at(path, true), looked_at(path, own), inside))
    return found


def paths_for(flows, d, strain, steps):
    """Paths to strains of this size: from rest, and where there is a flow also cycles."""
    flowing = any(not isinstance(flow, NoFlow) for flow in flows)
    return monotone(d, strain, steps) + (cycles(d, strain, steps) if flowing else [])
