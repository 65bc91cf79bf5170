"""Space that repeats: nodes a period apart are one node."""

import numpy as np


class Periodic:
    """Condition that makes the grid periodic, exactly: momenta and masses of nodes that are a
    period apart are added, and all of them get the common velocity.

    cells: period of each axis in cells, 0 where space does not repeat. then: another condition,
    applied to the folded grid. Particles may lie anywhere: no images of them are kept.
    """

    def __init__(self, cells, then=None):
        self.cells, self.then = tuple(cells), then

    @property
    def moves(self):
        """Whether the condition that follows moves."""
        return getattr(self.then, "moves", False)

    def apply(self, grid, t, dt):
        """Fold the grid in place."""
        m = self.folded(grid.m, grid.origin)
        share = np.divide(1.0, m, out=np.zeros_like(m), where=m > 0.0)[..., None]
        for v in (grid.v, grid.v_old):
            if v.ndim > 1:
                v[:] = share * self.folded(grid.m[..., None] * v, grid.origin)
        grid.m[:] = m
        if self.then is not None:
            self.then.apply(grid, t, dt)

    def folded(self, a, origin):
        """Sums of a nodal array over all nodes that are one, at each of them."""
        for axis, period in enumerate(self.cells):
            if period:
                at = (origin[axis] + np.arange(a.shape[axis])) % period
                sums = np.zeros((period, *np.delete(a.shape, axis)))
                np.add.at(sums, at, np.moveaxis(a, axis, 0))
                a = np.moveaxis(sums[at], 0, axis)
        return a
