"""Find the solids of a scene that prescribed motions carry into each other.

Points on a grid in the box around each collider move with it, and their depths in the other
colliders and walls are taken at several times. A solid without an end has its points around the
bodies. Contacts thinner than the distance of these points or of these times are not found.
"""

import numpy as np

from ..core.levelset import distances
from ..preflight import depths_in_solids
from ..scene import build
from ..shapes.inside import solid

SIDE = 9            # points per axis in the box around a collider
MOMENTS = 65        # times of a run
SKIN = 1e-9         # of the size of a box: so far outside a point counts as inside


def crossing_solids(scene, box):
    """Return the pairs of names of solids, one of which moves, that are more than a cell deep in
    each other at some time of a scene whose end is a time.

    box: corners (low, high) [m] around its bodies.
    """
    problem = build(scene)
    colliders = getattr(problem.conditions, "colliders", ())
    if not any(one.motion.moves for one in colliders):
        return frozenset()
    points = [points_in(one, record.shape, box)
              for one, record in zip(colliders, scene.collider, strict=True)]
    return frozenset(pair for t in np.linspace(0.0, scene.end, MOMENTS)
                     for one, X in zip(colliders, points, strict=True)
                     for pair in pairs_at(problem, one, X, t))


def points_in(collider, shape, box):
    """Return points (N, d) [m] in the solid of a collider, in the frame of its shape; none of a
    container.
    """
    own = solid(shape)
    low, high = (np.where(np.isfinite(corner), corner, around)
                 for corner, around in zip((own.low, own.high), box, strict=True))
    if collider.inside:
        return np.empty((0, len(low)))
    axes = np.linspace(low, high, SIDE).T
    X = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(low))
    return X[distances(X, collider.shape) <= SKIN * np.abs(high - low).max()]


def pairs_at(problem, collider, X, t):
    """Yield the pairs of names of a collider with each solid that one of its points X (N, d) is
    more than a cell deep in at t [s], where one of the two moves.
    """
    colliders, pose = problem.conditions.colliders, collider.motion.pose(t, 1.0, X.shape[1])
    solids = list(depths_in_solids(problem, pose.center + (X - pose.origin) @ pose.R[0].T, t))
    own = [one is collider for one in colliders].index(True)
    for k, (name, depth) in enumerate(solids):
        moves = collider.motion.moves or (k < len(colliders) and colliders[k].motion.moves)
        if k != own and moves and depth.max(initial=-np.inf) > problem.dx:
            yield tuple(sorted((solids[own][0], name)))
