"""Laws with random weights, what they answer in plain NumPy, and a file of them."""

from itertools import pairwise

import numpy as np
from scipy.special import erf

from mpm_ref.materials.learned import response, weights
from mpm_ref.materials.learned.invariants import count

STRESSES = response.Stress, response.SymmetricStress, response.PlainStress
CORRECTIONS = response.Correction, response.PlainCorrection
HIDDEN = (64, 64)
UNIT = 1e4          # [Pa]


def trained(kind, d, hidden=HIDDEN, bias=0.0, seed=0):
    """`LawWeights` of Xavier's size."""
    rng, sizes = np.random.default_rng(seed), (count(d), *hidden, d * d)
    layers = tuple((rng.normal(size=(n, m)) * np.sqrt(2.0 / (n + m)), bias * rng.normal(size=m))
                   for n, m in pairwise(sizes))
    return weights.LawWeights(layers, kind)


def laws(d, unit=UNIT):
    """`LearnedLaws` that hardly flow."""
    plastic = trained(response.Correction(), d, seed=1)
    return weights.LearnedLaws(trained(response.Stress(unit), d), plastic, {})


def singular(F):
    """U, s, V of one F, with rotations U and V."""
    U, s, Vt = np.linalg.svd(F)
    for a in (U.T, Vt):
        if np.linalg.det(a) < 0.0:
            a[-1] *= -1.0
            s[-1] *= -1.0
    return U, s, Vt.T


def plain(of, F):
    """The answer of `LawWeights` at one F (d, d), by the formulas of the paper."""
    d, (U, s, V) = len(F), singular(F)
    a = np.concatenate([s - 1.0, (F.T @ F - np.eye(d)).ravel(), [np.linalg.det(F) - 1.0]])
    for W, b in of.layers[:-1]:
        z = a @ W + b
        a = 0.5 * z * (1.0 + erf(z / np.sqrt(2.0)))
    W, b = of.layers[-1]
    Y = (a @ W + b).reshape(d, d)
    R, T, kind = U @ V.T, 0.5 * (Y + Y.T), of.kind
    match type(kind).__name__:
        case "Stress":
            return kind.unit * R @ T @ F.T
        case "SymmetricStress":
            return kind.unit * R @ T @ R.T
        case "PlainStress":
            return kind.unit * Y @ F.T
        case "Correction":
            return F + kind.alpha * R @ T
        case "PlainCorrection":
            return F + kind.alpha * Y


def rotations(d, n, seed=0):
    """n random rotations (n, d, d)."""
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, d, d)))[0]
    Q[:, 0] *= np.linalg.det(Q)[:, None]
    return Q


def deformations(d, n=20, seed=0):
    """F (n + .., d, d): random ones, two inverted, and some of repeated singular values."""
    rng = np.random.default_rng(seed)
    F = np.eye(d) + 0.2 * rng.normal(size=(n, d, d))
    F[1, 0], F[2, -1] = -F[1, 0], -F[2, -1]
    P, Q = rotations(d, 3, seed + 1), rotations(d, 3, seed + 2)
    s = np.array([d * [1.3], [1.2, 1.2, 0.8][-d:], [1.1, 0.9, 0.9][-d:]])
    return np.concatenate([F, P * s[:, None] @ Q, [np.eye(d)]])
