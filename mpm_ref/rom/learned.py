"""NSF's three networks in one run: position, stress and affine field of material points, which are
named by their numbers (NSF-eq8, NSF-eq9, NSF-sec4.4).

The same interface as `spanned`, for the steps of `inferred`. Networks are evaluated in batches of
points, layer by layer; `inference` is the twin that walks point by point.
"""

from typing import NamedTuple

import numpy as np

from .blocks import Blocks, blocks
from .decoder import Decoder
from .field import Field
from .symmetric import tensor


class LearnedFields(NamedTuple):
    """The three fields at given points, in a run with parameters mu."""

    X: np.ndarray       # (n, d) at rest [m]
    g: Decoder          # position
    h: Field            # stress, values of `symmetric`; may depend on mu
    l: Field            # affine field, row by row; may depend on mu
    mu: np.ndarray      # (parameters,) of this run; none where no field depends on them
    blocks: Blocks      # of X

    @property
    def dim(self):
        """Number of axes d."""
        return self.g.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.g.r

    def place(self, points, xhat):
        """x (m, d) [m] of points of these numbers."""
        return self.g.place(self.X[points], xhat)

    def derivatives(self, points, xhat):
        """x (m, d), None (no step asks for dg/dX), and dg/dxhat (m, d, r)."""
        x, _, G = self.g.derivatives(self.X[points], xhat)
        return x, None, G

    def stress(self, points, xhat):
        """Kirchhoff stress (m, d, d) [Pa]."""
        return tensor(self._values(self.h, points, xhat), self.dim)

    def affine(self, points, xhat):
        """C (m, d, d) [1/s]."""
        return self._values(self.l, points, xhat).reshape(-1, self.dim, self.dim)

    def near(self, xhat, x, distance):
        """Numbers of all points that may be within a distance [m], by the largest axis, of one of
        the positions x (m, d).
        """
        return self.blocks.near(self.g, xhat, x, distance)

    def of(self, mu):
        """The fields in a run with other parameters. Raises ValueError for more or fewer."""
        return self._replace(mu=fitting(mu, self.h, self.l))

    def _values(self, field, points, xhat):
        return field.values(self.X[points], xhat, field.own(self.mu))


def learned(X, networks, mu, size):
    """`LearnedFields` of points X (n, d) at rest, `networks` (g, h, l) and parameters mu; size [m]
    of blocks. The points need not be those of the training. Raises ValueError where the networks,
    X and mu do not fit each other.
    """
    fault = misfit(*networks)
    if fault or X.shape[1:] != (networks[0].dim,):
        raise ValueError(fault or f"points of shape {X.shape} for networks of {networks[0].dim} "
                                  "axes: expected (n, d)")
    return LearnedFields(X, *networks, fitting(mu, *networks[1:]), blocks(X, size))


def misfit(g, h, l):
    """What keeps three networks from being those of one body, or None."""
    d = g.dim
    for name, field, k in (("stress", h, d * (d + 1) // 2), ("affine field", l, d * d)):
        found = field.dim, field.r, field.outputs
        if found != (d, g.r, k):
            return (f"the {name} has {found[0]} axes, {found[1]} latent coordinates and {found[2]} "
                    f"values: expected {d}, {g.r} and {k}, as the position has")
    if h.parameters and l.parameters and h.parameters != l.parameters:
        return (f"the stress depends on {h.parameters} parameters, the affine field on "
                f"{l.parameters}: expected the same, or none")
    return None


def fitting(mu, h, l):
    """Parameters mu (q,) for two fields. Raises ValueError where one depends on more or fewer."""
    mu = np.array(mu, dtype=float)
    expected = h.parameters or l.parameters or mu.size
    if mu.shape != (expected,):
        raise ValueError(f"mu of shape {mu.shape}: expected ({expected},), the parameters that the "
                         "fields depend on")
    return mu
