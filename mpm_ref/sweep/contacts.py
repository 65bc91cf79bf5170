"""Contacts of bodies with colliders, walls and each other during a run.

Two surfaces are in contact where they come within one cell, and have approached each other since
the last look by less than half of the distance that the fastest particle of both bodies has gone:
particles reach half their spacing beyond their position, and the grid joins what shares a node. So
a body that falls straight to its floor until the end of a run has no contact with it, however near
it starts; one that slides along it, leaves it, or comes at a grazing angle has.
"""

from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from ..preflight import depths_in_solids

REACH = 1.0         # cells between two surfaces that are in contact
FREE = 0.5          # of the way of the fastest particle: approach by more than that is no contact


class ContactRecorder:
    """Collects the contacts of a run: a dict of their texts, in the order of their first time."""

    def __init__(self, problem):
        self._problem, self.contacts, self._gaps = problem, {}, {}

    def note(self, bodies, t, travel):
        """Add the contacts of bodies in a state at time t [s].

        travel: {name of a body: longest way [m] of a particle since the last call}, with which the
        change of a gap since then is compared.
        """
        gaps = {**solid_gaps(self._problem, bodies, t), **body_gaps(bodies, self._problem.dx)}
        for (text, names), gap in gaps.items():
            before = self._gaps.get((text, names), np.inf)
            if before - gap <= FREE * max(travel[name] for name in names):
                self.contacts[text] = None
        self._gaps = gaps


def solid_gaps(problem, bodies, t):
    """Return {(text, names of bodies): gap [m]} of each body within a cell of a collider or a wall
    of a problem at t [s].
    """
    gaps = {}
    for body in bodies:
        reach = REACH * problem.dx + 0.5 * spacing(body)
        for name, depth in depths_in_solids(problem, body.particles.x, t):
            if depth.max() >= -reach:
                gaps[f"body {body.name!r} with {name}", (body.name,)] = -depth.max()
    return gaps


def body_gaps(bodies, dx):
    """Return {(text, names): gap [m]} of each pair of bodies within a cell, on a grid of spacing
    dx [m].
    """
    gaps = {}
    for a, b in combinations(bodies, 2):
        reach = REACH * dx + 0.5 * (spacing(a) + spacing(b))
        gap = distance(a.particles.x, b.particles.x, reach)
        if gap <= reach:
            gaps[f"body {a.name!r} with body {b.name!r}", (a.name, b.name)] = gap
    return gaps


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
