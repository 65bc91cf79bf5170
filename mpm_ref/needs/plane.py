"""Find the axes along which a scene is uniform, and write the scene of its section in 2D.

A scene is uniform along an axis if each shape is a prism along it, the bodies' prisms have the same
ends, and nothing moves, falls or turns out of the section. What bounds the ends alone, such as
plates and walls there, is no part of the section. An elastic section is in plane strain; return
maps in 2D have the deviator of the plane, and so another yield surface than in 3D.
"""

from functools import singledispatch

import numpy as np

from ..sampling import Jittered, Lattice, Poisson, Regular
from ..scene.quantity_records import AXES
from ..shapes import (
    Box,
    Cylinder,
    Difference,
    HalfSpace,
    Intersection,
    Union,
    Wedge,
)
from .ingredients import Removal

NEAR = 1e-9             # of a length: lengths that are equal
SHAPES = "shape", "region"      # keys of tables that are replaced as a whole
RATES = "rate", "values", "rates", "amplitude"      # keys of a schedule that hold its values


class NotUniform(ValueError):
    """A part of the scene that is not uniform along the axis."""


def plane_removals(scene):
    """Yield the removal of each axis along which a scene in 3D is uniform."""
    if scene.dim != 3:
        return
    for axis in range(3):
        try:
            length = common_length(scene, axis)
            section_tables(scene, axis)
        except NotUniform:
            continue
        left = left_axes(axis)
        names = " and ".join(AXES[a] for a in left)
        yield Removal(f"third dimension {AXES[axis]}", section_edit(scene, axis),
                      f"section in {names}", axes=left, length=length)


def left_axes(axis):
    """Return the axes of the section at right angles to an axis."""
    return tuple(a for a in range(3) if a != axis)


def across(vector, axis):
    """Return a vector without its component along an axis, as a list."""
    return [value for a, value in enumerate(vector) if a != axis]


def in_section(vector, axis):
    """Return a vector in the section as a list; None for None.

    Raises NotUniform for one with a component along the axis.
    """
    if vector is None:
        return None
    if vector[axis]:
        raise NotUniform("a vector points out of the section")
    return across(vector, axis)


# shapes

class Prism:
    """The tables of a section, None for all of it, and the ends of the prism along the axis [m]."""

    def __init__(self, tables, ends=(-np.inf, np.inf)):
        self.tables, self.ends = tables, ends


@singledispatch
def prism(shape, axis):
    """Return the `Prism` that a shape is along an axis. Raises NotUniform where it is none."""
    raise NotUniform(f"a shape of type {type(shape).__name__.lower()} is no prism")


@prism.register
def _(shape: Box, axis):
    corners = {key: across(getattr(shape, key), axis) for key in ("lower", "upper")}
    return Prism({"type": "box"} | corners, (shape.lower[axis], shape.upper[axis]))


@prism.register
def _(shape: HalfSpace, axis):
    if not any(across(shape.normal, axis)):
        end = shape.point[axis]
        return Prism(None, (-np.inf, end) if shape.normal[axis] > 0.0 else (end, np.inf))
    normal = in_section(shape.normal, axis)
    return Prism({"type": "half_space", "point": across(shape.point, axis), "normal": normal})


@prism.register
def _(shape: Cylinder, axis):
    center = across(shape.start, axis)
    if across(shape.end, axis) != center:
        raise NotUniform("a cylinder stands across the axis")
    ends = sorted((shape.start[axis], shape.end[axis]))
    return Prism({"type": "sphere", "center": center, "radius": shape.radius}, tuple(ends))


@prism.register
def _(shape: Wedge, axis):
    if shape.width is not None or shape.edge is None or any(across(shape.edge, axis)):
        raise NotUniform("a wedge has ends, or its edge is not along the axis")
    return Prism({"type": "wedge", "tip": across(shape.tip, axis),
                  "direction": in_section(shape.direction, axis),
                  "half_angle": shape.half_angle, "length": shape.length})


@prism.register
def _(shape: Union, axis):
    parts = [bounded(prism(part, axis)) for part in shape.shapes]
    return Prism({"type": "union", "shapes": [part.tables for part in parts]}, same_ends(parts))


@prism.register
def _(shape: Intersection, axis):
    parts = [prism(part, axis) for part in shape.shapes]
    ends = max(part.ends[0] for part in parts), min(part.ends[1] for part in parts)
    sections = [part.tables for part in parts if part.tables is not None]
    if not sections:
        raise NotUniform("an intersection of half-spaces across the axis")
    tables = {"type": "intersection", "shapes": sections}
    return Prism(tables if len(sections) > 1 else sections[0], ends)


@prism.register
def _(shape: Difference, axis):
    first = bounded(prism(shape.shape, axis))
    minus = [bounded(prism(part, axis)) for part in shape.minus]
    if not all(covers(part.ends, first.ends) for part in minus):
        raise NotUniform("a part is taken away over a part of the length")
    return Prism({"type": "difference", "shape": first.tables,
                  "minus": [part.tables for part in minus]}, first.ends)


def bounded(part):
    """Return a prism with a section. Raises NotUniform for one that has none."""
    if part.tables is None:
        raise NotUniform("a half-space across the axis")
    return part


def same_ends(parts):
    """Return the ends that prisms share. Raises NotUniform where they differ."""
    ends = np.array([part.ends for part in parts])
    size = max(np.ptp(ends), 1e-300) if np.isfinite(ends).all() else 1.0
    if not np.allclose(ends, ends[0], rtol=0.0, atol=NEAR * size):
        raise NotUniform("prisms have different ends")
    return parts[0].ends


def covers(ends, inner):
    """Return whether ends reach at least as far as the inner ones."""
    slack = NEAR * (inner[1] - inner[0])
    return ends[0] <= inner[0] + slack and ends[1] >= inner[1] - slack


def common_length(scene, axis):
    """Return the length of the bodies along an axis [m]. Raises NotUniform where they differ."""
    if any(body.shape is None for body in scene.body):
        raise NotUniform("particles from arrays")
    ends = same_ends([bounded(prism(body.shape, axis)) for body in scene.body])
    if not all(map(np.isfinite, ends)):
        raise NotUniform("a body without ends")
    return ends[1] - ends[0]


# the scene

def section_tables(scene, axis):
    """Return {key: value} of the tables of a scene that differ in its section.

    Raises NotUniform where a part is not uniform along the axis.
    """
    bodies = [bounded(prism(body.shape, axis)) for body in scene.body]
    ends = same_ends(bodies)
    tables = {
        "dim": 2,
        "gravity": in_section(scene.gravity, axis),
        "body": [{"shape": body.tables, "sampling": sampling_tables(record.sampling, axis),
                  "velocity": velocity_tables(record.velocity, axis)}
                 for record, body in zip(scene.body, bodies)],
    }
    for key, inner in (("collider", "shape"), ("fixed", "region")):
        tables[key] = [part_tables(part, inner, axis, ends) for part in getattr(scene, key)]
    if scene.walls is not None:
        tables["walls"] = {key: across(nodes, axis) for key in ("low", "high")
                           if (nodes := getattr(scene.walls, key)) is not None}
    if scene.clip is not None:
        tables["clip"] = {key: across(getattr(scene.clip, key), axis) for key in ("lower", "upper")}
    return tables


def part_tables(part, key, axis, ends):
    """Return the tables of a collider or region that differ in the section; None for a plate at
    the ends, which the section does not have.
    """
    motion, section = motion_tables(part.motion, axis), prism(getattr(part, key), axis)
    if section.tables is None:
        require_outside(section.ends, part.inside, ends)
        return None
    if not covers(section.ends, ends):
        raise NotUniform("a collider ends within the bodies")
    return {key: section.tables, "motion": motion}


def require_outside(plate, inside, ends):
    """Raise NotUniform unless the nodes that a half-space across the axis constrains, those between
    the ends of `plate` or the others, lie beyond the bodies' ends.
    """
    if inside:
        plate = (plate[1], np.inf) if np.isinf(plate[0]) else (-np.inf, plate[0])
    slack = NEAR * (ends[1] - ends[0])
    if plate[1] > ends[0] + slack and plate[0] < ends[1] - slack:
        raise NotUniform("a half-space across the axis reaches into the bodies")


@singledispatch
def sampling_tables(sampling, axis):
    """Return the keys of a sampling that differ in the section."""
    raise NotUniform("a sampling whose points have no number per axis")


@sampling_tables.register(Regular)
@sampling_tables.register(Jittered)
def _(sampling, axis):
    return {}


@sampling_tables.register
def _(sampling: Lattice, axis):
    return {} if sampling.counts is None else {"counts": across(sampling.counts, axis)}


@sampling_tables.register
def _(sampling: Poisson, axis):
    if sampling.count is not None:
        raise NotUniform("a number of points of the whole body")
    return {}


# motion

def velocity_tables(velocity, axis):
    """Return the keys of an initial velocity that differ in the section."""
    angular = velocity.angular
    turn = turn_in_section(np.broadcast_to(angular, 3) if np.ndim(angular) else [0.0] * 3, axis)
    center = None if velocity.center is None else across(velocity.center, axis)
    return {"linear": in_section(velocity.linear, axis), "angular": turn, "center": center}


def turn_in_section(angular, axis):
    """Return the angular velocity about an axis as a number in the section, whose axes keep their
    order. Raises NotUniform for one about another axis.
    """
    if any(across(angular, axis)):
        raise NotUniform("a rotation out of the section")
    return sense(axis) * float(angular[axis])


def sense(axis):
    """Return -1 for y, about which x turns away from z, and 1 for x and z."""
    return -1.0 if axis == 1 else 1.0


def motion_tables(motion, axis):
    """Return the keys of a rigid motion that differ in the section."""
    turns = motion.rotation is not None or motion.angle
    sign = axis_sense(motion.axis, axis) if turns else 1.0
    return {
        "translation": schedule_tables(motion.translation,
                                       lambda value: in_section(value, axis)),
        "rotation": schedule_tables(motion.rotation, lambda value: sign * value),
        "center": None if motion.center is None else across(motion.center, axis),
        "axis": None,
        "angle": sign * motion.angle,
    }


def axis_sense(vector, axis):
    """Return the sign of a rotation about a vector along an axis. Raises NotUniform for others."""
    if vector is None or any(across(vector, axis)):
        raise NotUniform("a rotation out of the section")
    return sense(axis) * float(np.sign(vector[axis]))


def schedule_tables(schedule, change):
    """Return the keys of a schedule with its values changed; None for None."""
    if schedule is None:
        return None
    key = next(name for name in RATES if hasattr(schedule, name))
    values = getattr(schedule, key)
    several = key in ("values", "rates")
    return {key: [change(value) for value in values] if several else change(values)}


# the edit

def section_edit(scene, axis):
    """Return the edit of the tables of a scene to those of its section."""
    section = section_tables(scene, axis)

    def edit(tables):
        for key in ("collider", "fixed"):
            tables[key] = [merged(part, change) for part, change
                           in zip(tables.get(key, ()), section[key]) if change is not None]
        tables["body"] = [merged(body, change)
                          for body, change in zip(tables["body"], section["body"])]
        for key in ("dim", "gravity"):
            tables[key] = section[key]
        for key in ("walls", "clip"):
            if key in section:
                tables[key].update(section[key])
    return edit


def merged(tables, changes):
    """Return tables with changes: a shape replaces another, tables within are merged."""
    result = dict(tables)
    for key, value in changes.items():
        old = result.get(key)
        is_part = isinstance(value, dict) and isinstance(old, dict) and key not in SHAPES
        result[key] = merged(old, value) if is_part else value
    return result
