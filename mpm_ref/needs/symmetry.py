"""Find the mirror planes of a scene at right angles to an axis, and cut the scene in half there.

A plane is one of the scene if it mirrors particles (positions, velocities, masses, materials),
gravity, colliders, regions, walls and clip to themselves. The half with larger coordinates stays;
a frictionless wall that holds matter takes the place of the other one.
"""

import numpy as np
from scipy.spatial import cKDTree

from ..core.levelset import distances
from ..scene import build
from ..scene.quantity_records import AXES, wall_name
from ..shapes import level_set
from .ingredients import MIRROR, Half, Removal
from .plane import RATES

NEAR = 1e-6             # cells within which points and distances are equal
SAMPLES = 2000          # points at which a shape is compared with its image


def mirror_removals(scene, axes):
    """Yield the removal of one half of a scene for each of its mirror planes.

    axes: those of the scene as given that the scene's own are; names are of these.
    """
    bodies = build(scene).bodies
    x = np.concatenate([body.particles.x for body in bodies])
    middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
    for axis in range(scene.dim):
        c = float(middle[axis])
        sides = body_sides(scene, bodies, axis, c)
        if sides is None or not is_symmetric(scene, axis, c) or parts_a_contact(scene, sides):
            continue
        images = part_images(scene, samples_around(x, axis, c), axis)
        if None not in images.values():
            halved = [body.name for body, side in zip(scene.body, sides) if side == 0]
            halved += [name for name, image in images.items() if name == image]
            halved += [wall_name(a, side) for a in axes if a != axes[axis] for side in "-+"]
            letter = AXES[axes[axis]]
            yield Removal(f"half {letter} < {c:.6g} m", half_edit(sides, axis, c, letter),
                          "symmetry wall", half=Half(axis, c, tuple(halved)))


def parts_a_contact(scene, sides):
    """Return whether a body that is on one side of the plane has a contact: no wall replaces it."""
    return any(side != 0 and body.name in contact.bodies
               for contact in scene.contact for side, body in zip(sides, scene.body))


def is_symmetric(scene, axis, c):
    """Return whether a plane mirrors gravity, clip and walls."""
    gravity = scene.gravity is None or not scene.gravity[axis]
    clip = scene.clip is None or is_centred(scene.clip.lower[axis] + scene.clip.upper[axis], c, 1.0)
    walls = scene.walls is None or walls_match(scene.walls, axis, c / scene.dx)
    return bool(gravity and clip and walls)


def is_centred(total, c, size):
    """Return whether two ends, given by their sum, are as far from c."""
    return abs(total - 2.0 * c) <= NEAR * size


def walls_match(walls, axis, node):
    """Return whether walls are mirrored at a plane through a node, which may be a fraction."""
    low, high = (None if nodes is None or nodes[axis] == "open" else nodes[axis]
                 for nodes in (walls.low, walls.high))
    if low is None or high is None:
        return low == high
    return is_centred(low + high, node, 1.0)


def samples_around(x, axis, c):
    """Return points in and around a cloud x (N, d), and their images behind the plane."""
    low, high = x.min(axis=0), x.max(axis=0)
    size = max((high - low).max(), 1e-9)
    points = np.random.default_rng(0).uniform(low - size, high + size, (SAMPLES, x.shape[1]))
    return points, mirrored(points, axis, c), NEAR * size


def mirrored(x, axis, c):
    """Return the images (N, d) of points behind the plane x_axis = c."""
    image = np.array(x)
    image[:, axis] = 2.0 * c - image[:, axis]
    return image


def part_images(scene, points, axis):
    """Return {name: name of its image} of the colliders and regions, None for one without."""
    return (images_of_parts(scene.collider, "shape", points, axis)
            | images_of_parts(scene.fixed, "region", points, axis))


def images_of_parts(parts, key, points, axis):
    """Return {name: name of the part, perhaps itself, that is its image and alike in all else}."""
    values = {part.name: [distances(x, level_set(getattr(part, key))) for x in points[:2]]
              for part in parts}

    def is_image(part, other):
        return alike(part, other, axis, part is other) and np.allclose(
            values[part.name][0], values[other.name][1], rtol=0.0, atol=points[2])

    return {part.name: next((other.name for other in (part, *parts) if is_image(part, other)), None)
            for part in parts}


def alike(part, other, axis, same):
    """Return whether the image of a part can be the other one: same rule, and motion in the plane;
    of two different parts none may move.
    """
    rules = ("kind", "friction", "inside", "follows", "since", "until")
    if any(getattr(part, key, None) != getattr(other, key, None) for key in rules):
        return False
    if any(one.motion.rotation is not None or one.motion.angle for one in (part, other)):
        return False
    shift = part.motion.translation
    if not same or shift is None:
        return shift is None and other.motion.translation is None
    key = next(name for name in RATES if hasattr(shift, name))
    return not np.atleast_2d(getattr(shift, key))[:, axis].any()


def body_sides(scene, bodies, axis, c):
    """Return the side of each body, 1 above the plane, -1 below or 0 across; None where the plane
    mirrors no particles, or a body across has no shape that can be cut.
    """
    sides = [int(np.sign(offset.min()) + np.sign(offset.max())) // 2
             for offset in (body.particles.x[:, axis] - c for body in bodies)]
    if any(side == 0 and record.shape is None for side, record in zip(sides, scene.body)):
        return None
    for k, body in enumerate(bodies):
        partners = [k] if sides[k] == 0 else [
            j for j, side in enumerate(sides) if side == -sides[k]]
        if not any(scene.body[j].material == scene.body[k].material
                   and is_image(body.particles, bodies[j].particles, scene.dx, (axis, c))
                   for j in partners):
            return None
    return sides


def is_image(particles, others, dx, plane):
    """Return whether the images of particles are the others."""
    axis, c = plane
    if len(particles.x) != len(others.x):
        return False
    distance, match = cKDTree(others.x).query(mirrored(particles.x, axis, c))
    if distance.max() > NEAR * dx or len(set(match)) != len(match):
        return False
    velocity = mirrored(particles.v, axis, 0.0)
    fields = ((velocity, others.v), (particles.m, others.m), (particles.V0, others.V0))
    return all(np.allclose(a, b[match], rtol=NEAR, atol=NEAR * np.abs(b).max(initial=0.0))
               for a, b in fields)


def half_edit(sides, axis, c, letter):
    """Return the edit that leaves the half above the plane, with a wall at the plane, which is
    named by the letter of its axis.
    """
    def edit(tables):
        dim = tables["dim"]
        for side, body in zip(sides, tables["body"]):
            if side == 0:
                body["shape"] = upper_part(body["shape"], axis, c, dim)
        tables["body"] = [body for side, body in zip(sides, tables["body"]) if side >= 0]
        tables["collider"] = [*tables.get("collider", ()), {
            "name": f"{MIRROR}{letter}", "kind": "slip", "shape": half_space(axis, c, dim)}]
    return edit


def half_space(axis, c, dim, sign=1.0):
    """Return the tables of the half space below a plane; above it for sign -1."""
    return {"type": "half_space", "point": [c * (a == axis) for a in range(dim)],
            "normal": [sign * (a == axis) for a in range(dim)]}


def upper_part(shape, axis, c, dim):
    """Return the tables of the part of a shape above a plane."""
    if shape["type"] == "box":
        return shape | {"lower": [c if a == axis else value
                                  for a, value in enumerate(shape["lower"])]}
    return {"type": "intersection", "shapes": [shape, half_space(axis, c, dim, -1.0)]}
