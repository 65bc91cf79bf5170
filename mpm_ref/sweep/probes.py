"""Material points shared by runs with different particles, and their motion in each run.

A probe is a point X of the undeformed body. Its position is a combination of its neighbours'
positions with weights that reproduce linear functions of X (moving least squares
[Lancaster1981]), so that the error is of second order in the particles' distance.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

MOST = 400              # probes of all bodies
NEIGHBOURS = {2: 9, 3: 27}      # particles that a probe is fitted to
REACH = 1.1             # of the farthest neighbour's distance, where the weight vanishes


class Probe(NamedTuple):
    """The probes of one body."""

    body: str
    X: np.ndarray       # (n, d) at the start of the run [m]


def choose_probes(bodies, most=MOST, seed=0):
    """Return a tuple of `Probe`, one for each body: a random subset of its particles' positions.

    Each body has a share of the `most` probes by its number of particles, at least 8 if it has as
    many.
    """
    rng, total = np.random.default_rng(seed), sum(len(body.id) for body in bodies)
    probes = []
    for body in bodies:
        x = initial_order(body)
        n = min(len(x), max(8, round(most * len(x) / total)))
        probes.append(Probe(body.name, x[np.sort(rng.choice(len(x), n, replace=False))]))
    return tuple(probes)


def initial_order(body):
    """Return the positions (N, d) of a body's particles in the order of their sampling [m]."""
    x = np.empty_like(body.particles.x)
    x[body.id] = body.particles.x
    return x


def interpolation(x, X):
    """Return the sparse matrix (n, N) from values at the points x (N, d) to those at X (n, d).

    It is exact for linear functions where the neighbours span all directions; elsewhere it is the
    fit of the least norm.
    """
    d = x.shape[1]
    k = min(NEIGHBOURS[d], len(x))
    distance, neighbour = cKDTree(x).query(X, k)
    distance, neighbour = distance.reshape(-1, k), neighbour.reshape(-1, k)
    reach = REACH * distance[:, -1:] + 1e-300
    weight = 1.0 - (distance / reach) ** 2
    offset = (x[neighbour] - X[:, None]) / reach[..., None]
    basis = np.concatenate((np.ones((*offset.shape[:2], 1)), offset), axis=2)
    rows = np.linalg.pinv(weight[..., None] * basis)[:, 0] * weight
    rows /= rows.sum(axis=1, keepdims=True)
    indptr = np.arange(0, rows.size + 1, k)
    return csr_matrix((rows.ravel(), neighbour.ravel(), indptr), shape=(len(X), len(x)))
