"""Bodies on lattices, the sampling without noise; space that repeats; one-dimensional strips."""

import numpy as np

from mpm_ref.body import Body, in_precision, particles_at, with_separate_gradient
from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import Fluid, NoFlow

ON_WALL = Conditions(walls=BoxWalls((1, None), (None, None), "sticky"))    # nodes at x <= 0 rest


def lattice(lower, upper, spacing):
    """Return the centres (N, d) of the cubes of side `spacing` [m] that fill a box."""
    axes = [low + spacing * (np.arange(round((high - low) / spacing)) + 0.5)
            for low, high in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def body(X, spacing, rho, law, transfer, fluid=False):
    """Return a body at rest of density rho [kg/m^3] whose particles at X own spacing^d each.

    Each particle has a body force, which is zero at first.
    """
    V0 = np.full(len(X), spacing ** X.shape[1])
    at_rest = particles_at(X.copy(), np.zeros_like(X), rho * V0, V0, transfer, fluid=fluid)
    return Body("body", at_rest._replace(b=np.zeros_like(X)), law, NoFlow(), np.arange(len(X)))


def fitted(body, scheme):
    """Return a body whose arrays are those that an `explicit.Scheme` needs."""
    particles = in_precision(body.particles, scheme.real)
    if scheme.relaxation:
        particles = with_separate_gradient(particles)
    return body._replace(particles=particles)


class Periodic:
    """Condition that makes the grid periodic, exactly.

    Momenta and masses of nodes that are a period apart are added, and all of them get the common
    velocity. cells: period of each axis in cells, 0 where space does not repeat. then: another
    condition, applied to the folded grid. Particles may lie anywhere: no images of them are kept.
    """

    def __init__(self, cells, then=None):
        self.cells, self.then = tuple(cells), then

    @property
    def moves(self):
        """Return whether the condition that follows moves."""
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
        """Return the sums of a nodal array over all nodes that are one, at each of them."""
        for axis, period in enumerate(self.cells):
            if period:
                index = (origin[axis] + np.arange(a.shape[axis])) % period
                sums = np.zeros((period, *np.delete(a.shape, axis)))
                np.add.at(sums, index, np.moveaxis(a, axis, 0))
                a = np.moveaxis(sums[index], 0, axis)
        return a


def strip(start, end, dx, rho, law, scheme):
    """Return a strip one cell wide along x, and the places X (N,) of its particles.

    It lies between x = start and end [m] in cells of size dx. scheme is (transfer, degree,
    particles per cell and direction).
    """
    transfer, _, per = scheme
    X = lattice([start, 0.0], [end, dx], dx / per)
    return body(X, dx / per, rho, law, transfer, isinstance(law, Fluid)), X[:, 0].copy()


def strip_stepper(dx, scheme, conditions=None):
    """Return the `Stepper` of a strip without gravity, in space that repeats along y."""
    transfer, degree, _ = scheme
    return Stepper(Scheme(degree, transfer), dx, 2, np.zeros(2), Periodic((0, 1), conditions))
