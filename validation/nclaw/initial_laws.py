"""The laws before training, drawn as PyTorch draws them from a seed (NCLAW-arch), without it.

PyTorch's generator is the Mersenne Twister of NumPy's `RandomState`; a uniform number in single
precision takes the lower 24 bits of a draw, and is scaled with one rounding. Each layer of weights
is drawn twice: by itself first, all layers of a network, then as Xavier's, U(-a, a) with
a = sqrt(6/(inputs + outputs)).
"""

from itertools import pairwise
from math import sqrt

import numpy as np

from mpm_ref.materials.learned.response import Correction, Stress
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws

SIZES = (13, 64, 64, 9)
BITS = 24


def untrained(seed=0, elastic=None, plastic=None):
    """`LearnedLaws` of a seed, the elastic law drawn first; with answers of
    `learned.response`.
    """
    draws = np.random.RandomState(seed)
    kinds = Stress() if elastic is None else elastic, Correction() if plastic is None else plastic
    laws = [LawWeights(tuple(layers(draws)), kind) for kind in kinds]
    return LearnedLaws(*laws, {"seed": seed, "epochs": 0})


def layers(draws):
    """[(W (in, out), b (out,))] of a network; b is zero."""
    for n, m in pairwise(SIZES):
        draws.randint(2**32, size=n * m, dtype=np.uint32)
    for n, m in pairwise(SIZES):
        a = np.float32(sqrt(3.0) * sqrt(2.0 / (n + m)))
        yield uniform(draws, a, (m, n)).T.copy(), np.zeros(m)


def uniform(draws, a, shape):
    """Single-precision numbers of [-a, a), as doubles."""
    u = draws.randint(2**32, size=shape, dtype=np.uint32) & np.uint32(2**BITS - 1)
    return (u * 2.0**-BITS * np.float64(2 * a) - np.float64(a)).astype(np.float32).astype(float)
