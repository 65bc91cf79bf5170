"""Random laws that thermodynamics admits, and what they answer in plain NumPy."""

from itertools import pairwise

import numpy as np
from neural_toys import singular
from scipy.special import erf

from mpm_ref.materials.learned.contraction import Contraction, build_flow
from mpm_ref.materials.learned.energetic import Energetic, build_law
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws

ENERGY, RETURN = (4, 6, 5, 1), (3, 7, 5, 2)
UNIT, STRAIN = 1e4, 1e-2


def energetic(seed=0):
    """`LawWeights` of an energy."""
    rng = np.random.default_rng(seed)
    layers = [(rng.lognormal(size=(n, m)) / np.sqrt(n), rng.normal(size=m))
              for n, m in pairwise(ENERGY)]
    layers[-1] = layers[-1][0], np.zeros(1)
    return LawWeights(tuple(layers), Energetic(UNIT))


def contraction(seed=1, shift=0.0):
    """`LawWeights` of a return map that takes more with the shift."""
    rng = np.random.default_rng(seed)
    layers = [(rng.normal(size=(n, m)), rng.normal(size=m)) for n, m in pairwise(RETURN)]
    layers[-1] = layers[-1][0], layers[-1][1] + shift
    return LawWeights(tuple(layers), Contraction(STRAIN))


def laws(seed=0):
    """`LearnedLaws` of both."""
    return LearnedLaws(energetic(seed), contraction(seed + 1), {})


def deployed(seed=0, shift=0.0):
    """Law and flow as runs have them."""
    return build_law(energetic(seed)), build_flow(contraction(seed + 1, shift))


def softplus(z):
    return np.logaddexp(0.0, z)


def energy(of, F):
    """psi of one F (3, 3), by the formulas of `energetic`."""
    J, K = np.linalg.det(F), np.linalg.det(F) * np.linalg.inv(F).T
    m = np.array([(F**2).sum() - 3 - 2 * np.log(J), (K**2).sum() - 3 - 4 * np.log(J),
                  (J - 1) ** 2, J - 1 - np.log(J)])
    return of.kind.unit * (network(of.layers, m) - network(of.layers, np.zeros(4)))


def network(layers, a):
    """N of measures."""
    for W, b in layers[:-1]:
        a = softplus(a @ W + b)
    return (a @ layers[-1][0]).item()


def returned(of, F):
    """What a return map leaves of one trial F, by the formulas of `contraction`."""
    U, s, V = singular(F)
    eps = np.log(s)
    theta = eps.sum()
    e = eps - theta / 3.0
    a = np.log1p(np.array([np.linalg.norm(e), max(theta, 0.0), max(-theta, 0.0)])
                 / of.kind.strain)
    for W, b in of.layers[:-1]:
        z = a @ W + b
        a = 0.5 * z * (1.0 + erf(z / np.sqrt(2.0)))
    a, b = softplus(a @ of.layers[-1][0] + of.layers[-1][1])
    kept = np.exp(-b) * theta if theta > 0.0 else theta
    return U @ np.diag(np.exp(np.exp(-a) * e + kept / 3.0)) @ V.T


def tuples(F):
    """One F as kernels read it."""
    return tuple(map(tuple, F.tolist()))
