"""NCLaw's learned elastic law and return map, from stored weights.

    F = U diag(s) V^T,    R = U V^T,    a = (s - 1, F^T F - I, det F - 1)    NCLAW-alg4, input-norm
    Y = NN(a),    T = (Y + Y^T) / 2,    NN: 13 -> 64 -> 64 -> 9 with GELU    NCLAW-arch
    tau = R T F^T  (P = R T),    F_new = F + alpha R T                       NCLAW-alg4

All functions pass complex numbers, for derivatives by complex steps: s and R follow from the
eigenvalues of F^T F, which then is symmetric but not Hermitian. Stretches are in descending order,
and the last one has the sign of det F.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import erf


class StoredLaw(NamedTuple):
    """A network and the constant of its answer: a unit of stress [Pa], or alpha."""

    layers: tuple           # (W (in, out), b (out,)), three times
    constant: float


def load(path, part):
    """Return the `StoredLaw` of a file of weights; part: "elastic" or "plastic"."""
    with np.load(path) as arrays:
        layers = tuple((arrays[f"{part}_W{k}"], arrays[f"{part}_b{k}"]) for k in range(3))
        return StoredLaw(layers, float(arrays[f"{part}_constants"][0]))


def stretches(F):
    """Return s (n, 3) and R (n, 3, 3) of F (n, 3, 3), real or complex."""
    solve = np.linalg.eigh if np.isrealobj(F) else np.linalg.eig
    squares, V = solve(F.mT @ F)
    order = np.argsort(-squares.real, axis=1)
    V = np.take_along_axis(V, order[:, None], axis=2)
    s = np.sqrt(np.take_along_axis(squares, order, axis=1))
    s[:, 2] *= np.sign(np.linalg.det(F).real)
    return s, F @ (V / s[:, None]) @ np.linalg.inv(V)


def gelu(z):
    """Return z times the normal distribution function of z."""
    return 0.5 * z * (1.0 + erf(z / np.sqrt(2.0)))


def invariants(F, s):
    """Return the inputs a (n, 13) of a network."""
    squared = (F.mT @ F - np.eye(3)).reshape(-1, 9)
    return np.hstack([s - 1.0, squared, np.linalg.det(F)[:, None] - 1.0])


def answer(law, F):
    """Return R T (n, 3, 3) times the law's constant."""
    s, R = stretches(F)
    a = invariants(F, s)
    (W0, b0), (W1, b1), (W2, b2) = law.layers
    Y = (gelu(gelu(a @ W0 + b0) @ W1 + b1) @ W2 + b2).reshape(-1, 3, 3)
    return law.constant * R @ (Y + Y.mT) / 2.0


def stress(law, F):
    """Return the Kirchhoff stress tau (n, 3, 3) [Pa] of F (n, 3, 3)."""
    return answer(law, F) @ F.mT


def returned(law, F):
    """Return F (n, 3, 3) after the return map of trial ones."""
    return F + answer(law, F)
