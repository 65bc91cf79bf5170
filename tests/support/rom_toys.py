"""Small maps and snapshots with random numbers in them, for tests of reduced-order models.

Bodies fill the unit box [0, 1]^d; positions in m.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.network import Decoder, DecoderUnits
from mpm_ref.rom.fields.perceptron import network
from mpm_ref.rom.snapshots import Snapshots

MEAN, STD = np.array([0.02, -0.03, 0.01]), np.array([0.12, 0.08, 0.1])     # [m], by axis
DT = 0.01       # between snapshots [s]


def layers(sizes, seed=0):
    """Random layers [(W (in, out), b (out,))]; activations neither vanish nor grow with depth."""
    rng = np.random.default_rng(seed)
    return [(rng.normal(size=(n, m)) / np.sqrt(n), 0.3 * rng.normal(size=m))
            for n, m in pairwise(sizes)]


def decoder(dim, r, seed=0, hidden=(9, 8)):
    """A `Decoder` with F near I and det F > 0 in the unit box, for xhat within [-1, 1]."""
    units = DecoderUnits(np.zeros(dim), np.ones(dim), MEAN[:dim], STD[:dim])
    return Decoder(network(layers((dim + r, *hidden, dim), seed)), units)


def cloud(dim, n, seed=0):
    """n points (n, d) of the unit box."""
    return np.random.default_rng(seed).uniform(size=(n, dim))


def affine(dim, seed=0):
    """The affine map, and latent coordinates (r,) of a moderate deformation with a shift."""
    map = Affine(dim)
    return map, map.rest + 0.2 * np.random.default_rng(seed).uniform(-1.0, 1.0, map.r)


def snapshots(dim, runs=3, steps=4, n=40, seed=0):
    """`Snapshots` of a decoder with 3 latent coordinates that swing at random."""
    map, X, rng = decoder(dim, 3, seed), cloud(dim, n, seed), np.random.default_rng(seed)
    size, phase = rng.uniform(0.2, 0.8, (runs, 3)), rng.uniform(-3.0, 3.0, (runs, 3))
    angle = phase[:, None] + 20.0 * DT * np.arange(steps + 1)[:, None]
    path, rate = size[:, None] * np.sin(angle), 20.0 * size[:, None] * np.cos(angle)
    found = [[map.derivatives(X, xhat) for xhat in run] for run in path]
    x, F = (np.array([[level[k] for level in run] for run in found]) for k in (0, 1))
    v = np.array([[G @ vhat for (_, _, G), vhat in zip(*run)] for run in zip(found, rate)])
    return Snapshots(X, np.full(n, 1.0 / n), np.full(n, 1.0 / n), size, x, F, v, DT)


class Watched(NamedTuple):
    """A map that keeps the latent coordinates at which it is differentiated."""

    map: object
    seen: list

    @property
    def r(self):
        return self.map.r

    def place(self, X, xhat):
        return self.map.place(X, xhat)

    def derivatives(self, X, xhat):
        self.seen.append(xhat)
        return self.map.derivatives(X, xhat)


class Bent:
    """x = X + arctan(xhat): far from xhat = 0, undamped Gauss-Newton steps go farther still."""

    r = 1

    def place(self, X, xhat):
        return X + np.arctan(xhat)

    def derivatives(self, X, xhat):
        return self.place(X, xhat), None, np.full((len(X), 1, 1), 1.0 / (1.0 + xhat[0] ** 2))
