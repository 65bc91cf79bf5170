"""Small fields and histories with random numbers in them, for tests of NSF's networks."""


import numpy as np
import rom_toys

from mpm_ref.rom.fields.network import Field, FieldUnits
from mpm_ref.rom.fields.perceptron import feature_count, network
from mpm_ref.rom.snapshots import Histories
from mpm_ref.rom.symmetric import values

R = 3
Q = 2               # parameters
MU = np.array([31.0, 0.7])
HIDDEN = (11, 7)


def field(dim, outputs, q=0, seed=0, octaves=0):
    """A `Field` of points of the unit box, with units of its own for every input and output."""
    rng = np.random.default_rng(seed)
    units = FieldUnits(np.full(dim, -0.1), np.full(dim, 1.3), rng.normal(size=outputs),
                       rng.uniform(0.5, 2.0, outputs), rng.normal(size=q) * 30.0,
                       rng.uniform(5.0, 10.0, q))
    sizes = (feature_count(dim, octaves) + R + q, *HIDDEN, outputs)
    return Field(network(rom_toys.layers(sizes, seed)), units, octaves)


def networks(dim, q=0, seed=0, octaves=0):
    """Position, stress, which depends on q parameters, and affine field, of so many octaves."""
    return (rom_toys.decoder(dim, R, seed),
            field(dim, dim * (dim + 1) // 2, q, seed + 1, octaves),
            field(dim, dim * dim, 0, seed + 2, octaves))


def latents(seed=0):
    """Latent coordinates (r,) within [-1, 1]."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, R)


def plain(layers, A):
    """Outputs of a perceptron; A (n, in) may be complex."""
    for W, b in layers[:-1]:
        z = A @ W + b
        A = np.where(z.real > 0.0, z, np.expm1(z))
    W, b = layers[-1]
    return A @ W + b


def histories(dim=2, runs=3, steps=4, n=12):
    """`Histories` of runs that stretch along a fixed motion, all at the same pace, while their
    stress grows in proportion to their parameter: positions do not tell runs apart.
    """
    X, rng = rom_toys.cloud(dim, n), np.random.default_rng(0)
    mu = np.linspace(1.0, 2.0, runs)[:, None]
    t = np.linspace(0.0, 1.0, steps + 1)
    L = rng.normal(size=(dim, dim))
    x = np.broadcast_to(X + 0.3 * t[:, None, None] * (X @ L.T), (runs, steps + 1, n, dim))
    strain = t[:, None] * (1.0 + X[:, 0])
    own = values(L + L.T) * mu[:, :, None, None] * strain[..., None]
    C = np.broadcast_to(L.reshape(-1) * (1.0 + 0.5 * strain[..., None]),
                        (runs, steps + 1, n, dim * dim))
    return Histories(X, np.ones(n), np.ones(n), np.zeros((runs, n, dim)), mu, x.copy(),
                     100.0 * own, C.copy(), 0.1)
