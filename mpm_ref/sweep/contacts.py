"""Contacts of bodies with colliders, walls and each other during a run.

Two surfaces are in contact where they come within one cell: particles reach half their spacing
beyond their position, and the grid joins what shares a node.
"""

from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ..preflight import depths_in_solids

REACH = 1.0         # cells between two surfaces that are in contact


class ContactRecorder:
    """Collects the contacts of a run: a dict of their texts, in the order of their first time."""

    def __init__(self, problem):
        self._problem, self.contacts = problem, {}

    def note(self, bodies, t):
        """Add the contacts of bodies in a state at time t [s]."""
        self.contacts |= dict.fromkeys([*solid_contacts(self._problem, bodies, t),
                                        *body_contacts(bodies, self._problem.dx)])


def solid_contacts(problem, bodies, t):
    """Yield a text for each body in contact with a collider or a wall of a problem at t [s]."""
    for body in bodies:
        reach = REACH * problem.dx + 0.5 * spacing(body)
        for name, depth in depths_in_solids(problem, body.particles.x, t):
            if depth.max() >= -reach:
                yield f"body {body.name!r} with {name}"


def body_contacts(bodies, dx):
    """Yield a text for each pair of bodies in contact on a grid of spacing dx [m]."""
    for a, b in combinations(bodies, 2):
        reach = REACH * dx + 0.5 * (spacing(a) + spacing(b))
        if distance(a.particles.x, b.particles.x, reach) <= reach:
            yield f"body {a.name!r} with body {b.name!r}"


def spacing(body):
    """Return the mean distance of a body's neighbouring particles at rest [m]."""
    return float(np.mean(body.particles.V0)) ** (1.0 / body.particles.x.shape[1])


def distance(x, y, most):
    """Return the least distance between points x (N, d) and y (M, d) [m]; infinite where their
    bounding boxes are farther apart than `most`.
    """
    low, high = np.maximum(x.min(axis=0), y.min(axis=0)), np.minimum(x.max(axis=0), y.max(axis=0))
    if np.linalg.norm(np.maximum(low - high, 0.0)) > most:
        return np.inf
    return float(cKDTree(x).query(y)[0].min())
