"""Warnings before a run about bodies that start inside a collider or a wall, or overlap, or are too
thin for their contacts.

    for sentence in misplaced(problem):
        print(sentence)

None is an error: it may be intended. The command line prints them before a run and in `info`.
"""

import json
from itertools import combinations
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from .core.levelset import distances
from .monitor import volume_ratio

ON = 1e-6           # cells: a particle this near to a surface is on it, however it was rounded
REACH = 2.0         # particle spacings: radius of the ball in which material is measured
CROWDED = 1.5       # of that ball; bodies that merely touch fill at most 1.3, also if random
THIN = 2.0          # cells: others sink into a thinner body that they touch
MOST_PLACES = 64    # of the blocks of a source that sways


def misplaced(problem):
    """Return sentences about bodies that start inside a collider or a wall, overlap, or are thin
    where others touch them; usually none.

    The regions of `fixed`, whose nodes have a given motion, may hold particles. Two bodies overlap
    where they have half as much material again as there is room, which is at a depth of one or two
    particle spacings; less is not detected. Thin is what is flat, not what is hollow. Of a source
    that sways, up to MOST_PLACES of its blocks are looked at, evenly over the run, in a scene as it
    starts.
    """
    bodies = starting(problem)
    return [*_in_solids(problem, bodies), *_in_each_other(bodies), *_swaying(problem, bodies),
            *_thin(problem)]


def starting(problem):
    """Return the bodies of a problem as they start; of a source, its first block."""
    bodies = list(problem.bodies)
    for source in problem.sources:
        bodies[source.body] = source.entering(0, source.start)
    return bodies


# in colliders and walls

def _in_solids(problem, bodies):
    """Yield a sentence for each body that is partly in a solid, and for each such solid."""
    for body in bodies:
        for name, depth in depths_in_solids(problem, body.particles.x):
            inside = depth > ON * problem.dx
            if inside.any():
                yield (f"{inside.sum()} of the {len(depth)} particles of body {body.name!r} start "
                       f"inside {name}, up to {depth.max():.3g} m deep "
                       f"({depth.max() / problem.dx:.3g} dx); move the body or the solid, unless "
                       "it is meant to hold them")


def depths_in_solids(problem, x, t=0.0):
    """Yield (name, depth (N,) [m] of the points x (N, d) in it) of each collider and each wall as
    they stand at t [s]; negative outside.
    """
    colliders = getattr(problem.conditions, "colliders", ())
    for name, collider in zip(_names(problem, len(colliders)), colliders, strict=True):
        yield name, _depth(collider, x, t)
    walls = getattr(problem.conditions, "walls", None)
    if walls is not None:
        yield from _in_walls(walls, problem.dx, x)


def _names(problem, n):
    """Return labels of n colliders: their keys, with names where the scene gives any."""
    try:
        tables = json.loads(problem.source)["collider"]
    except (ValueError, TypeError, KeyError):      # a problem made in Python has any source or none
        tables = []
    names = [table.get("name", "") for table in tables] or n * [""]
    return [f"collider[{k}] {name!r}".removesuffix(" ''") for k, name in enumerate(names)]


def _depth(collider, x, t):
    """Return the depth of points in the solid of a collider at t [s]; negative outside [m]."""
    pose = collider.motion.pose(t, 1.0, x.shape[1])
    X = pose.origin + (x - pose.center) @ pose.R[0]         # R^T r for each row r
    side = 1.0 if collider.inside else -1.0
    return side * distances(X, collider.shape)


def _in_walls(walls, dx, x):
    """Yield depths in the walls counted in nodes, each of which begins at its first node."""
    for axis, (low, high) in enumerate(zip(walls.low, walls.high, strict=True)):
        if low is not None:
            yield f"the low wall of axis {axis}", (low - 1) * dx - x[:, axis]
        if high is not None:
            yield f"the high wall of axis {axis}", x[:, axis] - (high + 1) * dx


# in each other

def _in_each_other(bodies):
    """Yield a sentence for each pair of bodies that overlap."""
    for a, b in combinations(bodies, 2):
        x = _crowded(a, b)
        if len(x):
            at = ", ".join(f"{c:.3g}" for c in x.mean(axis=0))
            yield (f"bodies {a.name!r} and {b.name!r} overlap at the start, about ({at}): "
                   f"{len(x)} particles of {a.name!r} are where {b.name!r} is; move one of them, "
                   "or cut it out of the other with a difference")


def _crowded(a, b):
    """Return the positions of the particles of a around which both bodies have more material than
    fits.
    """
    reach = REACH * max(_spacing(a), _spacing(b))
    near_a, near_b = _near(a, b, 2.0 * reach), _near(b, a, 2.0 * reach)
    if not near_a.any() or not near_b.any():
        return np.empty((0, a.particles.x.shape[1]))
    x = a.particles.x[_near(a, b, reach)]
    ours, theirs = _filled(a, near_a, x, reach), _filled(b, near_b, x, reach)
    return x[(theirs > 0.5 * (CROWDED - 1.0)) & (ours + theirs > CROWDED)]


def _near(a, b, reach):
    """Return the particles of a that are near the bounding box of b."""
    x, y = a.particles.x, b.particles.x
    return ((x > y.min(axis=0) - reach) & (x < y.max(axis=0) + reach)).all(axis=1)


def _filled(body, near, x, reach):
    """Return the share of the ball about each point x that the body's particles fill, on average
    ones.
    """
    q = body.particles
    count = cKDTree(q.x[near]).query_ball_point(x, reach, return_length=True)
    ball = pi * reach**2 if x.shape[1] == 2 else 4.0 / 3.0 * pi * reach**3
    return count * _volume(body) / ball


def _volume(body):
    """Return the mean volume of a particle as it is deformed [m^d]."""
    q = body.particles
    return float(np.mean(q.V0 * np.abs(volume_ratio(q))))


def _spacing(body):
    return _volume(body) ** (1.0 / body.particles.x.shape[1])


# blocks that enter later

def _swaying(problem, bodies):
    """Yield the sentences about a block that a swaying source lets into a solid, or into another
    body, as these stand at the start: the first of those looked at, after that of the start.
    """
    for source in problem.sources:
        if source.sway is None:
            continue
        others = [body for k, body in enumerate(bodies) if k != source.body]
        later = source.blocks - 1
        for k in np.unique(np.linspace(1, later, min(later, MOST_PLACES)).astype(int)):
            block = source.entering(k, source.time(k))
            sentences = [*_in_solids(problem, [block])]
            for other in others:
                sentences += _in_each_other([block, other])
            at_entry = f"block {k} of a source, which enters at t = {source.time(k):.3g} s"
            yield from (f"{at_entry}: {sentence}" for sentence in sentences)
            if sentences:
                break


# thin bodies in contact

def _thin(problem):
    """Yield a sentence for each body that others touch by `BodyContact` and is THIN."""
    touched = {name for contact in problem.contacts if contact.kind == "separate"
               for name in contact.bodies}
    for body in problem.bodies:
        thickness = _thickness(body) / problem.dx if body.name in touched else np.inf
        if thickness < (1.0 - ON) * THIN:
            yield (f"body {body.name!r} is {thickness:.3g} dx thick, less than {THIN:g}: contact "
                   "measures gaps by the space that bodies fill around nodes, so that others sink "
                   "into it; take a finer grid")


def _thickness(body):
    """Return the smallest extent of a body along the axes of the grid and its own ones [m]."""
    x = body.particles.x - body.particles.x.mean(axis=0)
    axes = np.linalg.eigh(np.einsum("pa,pb->ab", x, x))[1]
    return float(min(np.ptp(x, axis=0).min(), np.ptp(x @ axes, axis=0).min())) + _spacing(body)
