"""Position, stress and affine field of material points as networks.

The deformation map g(X; xhat) of LDM and NSF, with F and the velocity as its derivatives:

    g(X; xhat)  = X + mean + std f(Z, xhat),   Z = (X - low) / span      LDM-eq14, NSF-eq8, LDM-appB
    F           = I + diag(std) df/dX diag(1/span)                                        LDM-eq15
    dg/dxhat    = diag(std) df/dxhat                                                      LDM-eq16

f is a perceptron of the scaled reference position and the latent coordinates; its outputs are
standardised displacements, where the paper says positions: F is I plus what is learned. The box
low .. low + span is that of the body at rest, mean and std are those of the training data alone.

Stress and affine velocity field of NSF (NSF-eq9, NSF-sec4.4) are fields over the material points:

    values(X; xhat, mu) = mean + std f(Z, xhat, (mu - mu_mean) / mu_std)

Here f may read Fourier features of Z, and the field may depend on the problem's parameters mu
beside the latent coordinates (NSF-mu-dep): where runs with different parameters start from the same
state, xhat cannot tell them apart. The values of a stress are those of `symmetric`.
"""

from typing import NamedTuple

import numpy as np

from ..symmetric import tensor
from .blocks import Blocks, blocks
from .perceptron import (
    Network,
    backward,
    directional,
    feature_count,
    features,
    for_batches,
    forward,
    layers_of,
)


class DecoderUnits(NamedTuple):
    """Units of a decoder's inputs and outputs; d axes."""

    low: np.ndarray     # (d,) corner of the body's box at rest [m]
    span: np.ndarray    # (d,) its sides [m]
    mean: np.ndarray    # (d,) of the displacement [m]
    std: np.ndarray     # (d,) of the displacement [m]


class Decoder(NamedTuple):
    """A learned map: a perceptron with sizes (d + r, .., d), and its units."""

    net: Network
    units: DecoderUnits

    @property
    def dim(self):
        """Number of axes d."""
        return int(self.net.sizes[-1])

    @property
    def r(self):
        """Number of latent coordinates."""
        return int(self.net.sizes[0]) - self.dim

    def place(self, X, xhat):
        """Return x = g(X; xhat) of points X (n, d) [m]."""
        return X + self.units.mean + self.units.std * outputs(*self, X, xhat)

    def derivatives(self, X, xhat):
        """Return x (n, d), F (n, d, d) and dg/dxhat (n, d, r) [m] of points X (n, d)."""
        (n, d), layers = X.shape, layers_of(self.net)
        y, dy = np.empty((n, d)), np.empty((n, d, d + self.r))

        def work(rows):
            y[rows], slopes = forward(layers, inputs(*self, X[rows], xhat))
            for k in range(d):
                dy[rows, k] = backward(layers, slopes, k)

        for_batches(n, work)
        dy *= self.units.std[:, None]
        return (X + self.units.mean + self.units.std * y,
                np.eye(d) + dy[..., :d] / self.units.span, np.ascontiguousarray(dy[..., d:]))

    def velocity(self, X, xhat, vhat):
        """Return dg/dxhat(X; xhat) vhat of points X (n, d) [m/s]."""
        layers, v = layers_of(self.net), np.empty(X.shape)
        along = np.concatenate([np.zeros(self.dim), vhat]).astype(self.net.W.dtype)

        def work(rows):
            _, slopes = forward(layers, inputs(*self, X[rows], xhat))
            v[rows] = directional(layers, slopes, along)

        for_batches(len(X), work)
        return self.units.std * v

    def single(self):
        """Return the map with its network in single precision: faster, with errors of round-off in
        the displacements, below which `preimages` cannot converge.
        """
        net = self.net
        return self._replace(net=Network(net.sizes, *(a.astype(np.float32) for a in net[1:])))


def inputs(net, units, X, y, octaves=0):
    """Return the inputs (n, d (1 + 2 octaves) + len(y)) of a network at points X (n, d): scaled
    positions at rest, or their `features`, and the coordinates y of the state.
    """
    k = feature_count(len(units.low), octaves)
    A = np.empty((len(X), net.sizes[0]), dtype=net.W.dtype)
    A[:, :k] = features((X - units.low) / units.span, octaves)
    A[:, k:] = y
    return A


def outputs(net, units, X, y, octaves=0):
    """Return the standardised outputs (n, k) of a network at points X (n, d), coordinates y."""
    layers, values = layers_of(net), np.empty((len(X), net.sizes[-1]))

    def work(rows):
        values[rows] = forward(layers, inputs(net, units, X[rows], y, octaves))[0]

    for_batches(len(X), work)
    return values


class FieldUnits(NamedTuple):
    """Units of a field's inputs and outputs; d axes, k values, q parameters."""

    low: np.ndarray         # (d,) corner of the body's box at rest [m]
    span: np.ndarray        # (d,) its sides [m]
    mean: np.ndarray        # (k,) of the values
    std: np.ndarray         # (k,) of the values
    mu_mean: np.ndarray     # (q,) of the parameters
    mu_std: np.ndarray      # (q,) of the parameters


class Field(NamedTuple):
    """A perceptron with sizes (d (1 + 2 octaves) + r + q, .., k), and its units."""

    net: Network
    units: FieldUnits
    octaves: int = 0        # of `features`

    @property
    def dim(self):
        """Number of axes d."""
        return len(self.units.low)

    @property
    def parameters(self):
        """Number q of parameters that it depends on."""
        return len(self.units.mu_mean)

    @property
    def r(self):
        """Number of latent coordinates."""
        return int(self.net.sizes[0]) - feature_count(self.dim, self.octaves) - self.parameters

    @property
    def outputs(self):
        """Number k of values."""
        return int(self.net.sizes[-1])

    def needed_parameters(self, mu):
        """Return the parameters that the field depends on: all of a run's mu, or none."""
        return mu if self.parameters else ()

    def values(self, X, xhat, mu=()):
        """Return the values (n, k) at points X (n, d) [m]. Raises ValueError as `coordinates`."""
        y = outputs(self.net, self.units, X, self.coordinates(xhat, mu), self.octaves)
        return self.units.mean + self.units.std * y

    def coordinates(self, xhat, mu=()):
        """Return latent coordinates and normalised parameters (r + q,), as the network takes them.
        Raises ValueError for another number of either.
        """
        if np.shape(xhat) != (self.r,) or np.shape(mu) != (self.parameters,):
            raise ValueError(f"xhat of shape {np.shape(xhat)} and mu of shape {np.shape(mu)}: "
                             f"expected ({self.r},) and ({self.parameters},), as the field was "
                             "trained with")
        return np.concatenate([xhat, (np.asarray(mu, dtype=float) - self.units.mu_mean)
                               / self.units.mu_std])


class Networks(NamedTuple):
    """Position, stress and affine field as networks, which any points can be put into."""

    g: Decoder      # position
    h: Field        # stress, values of `symmetric`
    l: Field        # affine field, row by row

    @property
    def dim(self):
        """Number of axes d."""
        return self.g.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.g.r


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
        """Return x (m, d) [m] of points of these numbers."""
        return self.g.place(self.X[points], xhat)

    def derivatives(self, points, xhat):
        """Return x (m, d), None (no step needs dg/dX), and dg/dxhat (m, d, r)."""
        x, _, G = self.g.derivatives(self.X[points], xhat)
        return x, None, G

    def stress(self, points, xhat, F=None):
        """Return the Kirchhoff stress (m, d, d) [Pa]; F is not used."""
        return tensor(self._values(self.h, points, xhat), self.dim)

    def affine(self, points, xhat):
        """Return the affine velocity field C (m, d, d) [1/s]."""
        return self._values(self.l, points, xhat).reshape(-1, self.dim, self.dim)

    def near(self, xhat, x, distance):
        """Return numbers of all points that may be within a distance [m], by the largest axis, of
        one of the positions x (m, d).
        """
        return self.blocks.near(self.g, xhat, x, distance)

    def with_parameters(self, mu):
        """Return the fields in a run with parameters mu. Raises ValueError for more or fewer."""
        return self._replace(mu=checked_parameters(mu, self.h, self.l))

    def _values(self, field, points, xhat):
        return field.values(self.X[points], xhat, field.needed_parameters(self.mu))


def learned_fields(X, networks, mu, size):
    """Return the `LearnedFields` of points X (n, d) at rest, `networks` (g, h, l) and parameters
    mu; size [m] of blocks. The points need not be those of the training. Raises ValueError where
    the networks, X and mu do not fit each other.
    """
    error = mismatch(*networks)
    if error or X.shape[1:] != (networks[0].dim,):
        raise ValueError(error or f"points of shape {X.shape} for networks of {networks[0].dim} "
                                  "axes: expected (n, d)")
    return LearnedFields(X, *networks, checked_parameters(mu, *networks[1:]), blocks(X, size))


def mismatch(g, h, l):
    """Return a sentence on why three networks cannot be those of one body, or None."""
    d = g.dim
    for name, field, k in (("stress", h, d * (d + 1) // 2), ("affine field", l, d * d)):
        sizes = field.dim, field.r, field.outputs
        if sizes != (d, g.r, k):
            return (f"the {name} has {sizes[0]} axes, {sizes[1]} latent coordinates and {sizes[2]} "
                    f"values: expected {d}, {g.r} and {k}, as the position has")
    if h.parameters and l.parameters and h.parameters != l.parameters:
        return (f"the stress depends on {h.parameters} parameters, the affine field on "
                f"{l.parameters}: expected the same, or none")
    return None


def checked_parameters(mu, h, l):
    """Return mu as an array (q,). Raises ValueError where two fields depend on more or fewer."""
    mu = np.array(mu, dtype=float)
    expected = h.parameters or l.parameters or mu.size
    if mu.shape != (expected,):
        raise ValueError(f"mu of shape {mu.shape}: expected ({expected},), the parameters that the "
                         "fields depend on")
    return mu
