"""Bodies whose particles are the centres of equal sub-cells, the sampling without noise."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.materials import NoFlow


def lattice(lower, upper, spacing):
    """Centres (N, d) of the cubes of side `spacing` [m] that fill the box from lower to upper."""
    axes = [low + spacing * (np.arange(round((high - low) / spacing)) + 0.5)
            for low, high in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def body(X, spacing, rho, law, transfer, fluid=False):
    """Body at rest of density rho [kg/m^d] with particles at X that own spacing^d each, and a body
    force per particle, zero at first.
    """
    V0 = np.full(len(X), spacing ** X.shape[1])
    at_rest = particles_at(X.copy(), np.zeros_like(X), rho * V0, V0, transfer, fluid=fluid)
    return Body("body", at_rest._replace(b=np.zeros_like(X)), law, NoFlow(), np.arange(len(X)))
