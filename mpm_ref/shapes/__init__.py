"""Define the shapes of scene files, and the level sets of the analytic ones.

Boolean combinations, transformed shapes and meshes have no distance, so that only bodies can have
them (see `inside`). Colliders and prescribed regions have analytic shapes.
"""

from functools import singledispatch
from math import inf, radians
from typing import Annotated

from msgspec import Meta

from ..core import levelset
from .quantities import Angle, Kind, Length, Sha256, Vector

Shapes = Annotated[tuple["Shape", ...], Meta(min_length=1, max_length=1000)]


class HalfSpace(Kind, tag="half_space"):
    """All points behind the plane through `point`; `normal`, of any length, points out of it."""

    point: Vector
    normal: Vector


class Box(Kind, tag="box"):
    """Box along the axes between two corners."""

    lower: Vector
    upper: Vector


class Sphere(Kind, tag="sphere"):
    """Ball; a disk in 2D."""

    center: Vector
    radius: Length


class Cylinder(Kind, tag="cylinder"):
    """Solid cylinder with flat ends at two points of its axis; a rectangle in 2D."""

    start: Vector
    end: Vector
    radius: Length


class Capsule(Kind, tag="capsule"):
    """Points within `radius` of a segment."""

    start: Vector
    end: Vector
    radius: Length


class Torus(Kind, tag="torus"):
    """Points within `minor` of a circle of radius `major`, about `axis` in 3D; a ring in 2D."""

    center: Vector
    major: Length
    minor: Length
    axis: Vector | None = None


class Wedge(Kind, tag="wedge"):
    """Blade with its sharp edge at `tip`, thicker along `direction` for `length`.

    `half_angle` [degrees] is that between a face and the middle plane. In 3D `edge` is the
    direction of the edge and `width` its length, without end if not given; 2D has neither.
    """

    tip: Vector
    direction: Vector
    half_angle: Annotated[float, Meta(gt=0, lt=90)]
    length: Length
    edge: Vector | None = None
    width: Length | None = None


class Union(Kind, tag="union"):
    """Points in any of the shapes."""

    shapes: Shapes


class Intersection(Kind, tag="intersection"):
    """Points in all of the shapes."""

    shapes: Shapes


class Difference(Kind, tag="difference"):
    """Points in `shape`, but in none of `minus`."""

    shape: "Shape"
    minus: Shapes


class Transformed(Kind, tag="moved"):
    """A shape scaled, then turned by `angle` [degrees], both about `about`, then shifted."""

    shape: "Shape"
    scale: Length = 1.0
    angle: Angle = 0.0
    axis: Vector | None = None
    about: Vector | None = None
    translate: Vector | None = None


class Mesh(Kind, tag="mesh"):
    """The inside of a closed triangle mesh from a file.

    `size` [m] scales it to that largest edge of its bounding box, and `center` is the middle of
    that box. With `sha256` the file is refused unless that is the hash of what it holds.
    """

    file: str
    sha256: Sha256 | None = None
    size: Length | None = None
    center: Vector | None = None


Analytic = HalfSpace | Box | Sphere | Cylinder | Capsule | Torus | Wedge
Shape = Analytic | Union | Intersection | Difference | Transformed | Mesh


@singledispatch
def level_set(shape):
    """Return the level set (see core.levelset) of an analytic shape.

    Raises ValueError for sizes that make no shape, and for shapes without a distance.
    """
    raise ValueError(f"a shape of type {type(shape).__name__.lower()} has no distance; "
                     "only analytic shapes have")


@level_set.register
def _(shape: HalfSpace):
    return levelset.half_space(shape.point, shape.normal)


@level_set.register
def _(shape: Box):
    return levelset.box(shape.lower, shape.upper)


@level_set.register
def _(shape: Sphere):
    return levelset.sphere(shape.center, shape.radius)


@level_set.register
def _(shape: Cylinder):
    return levelset.cylinder(shape.start, shape.end, shape.radius)


@level_set.register
def _(shape: Capsule):
    return levelset.capsule(shape.start, shape.end, shape.radius)


@level_set.register
def _(shape: Torus):
    return levelset.torus(shape.center, shape.major, shape.minor, shape.axis)


@level_set.register
def _(shape: Wedge):
    width = inf if shape.width is None else shape.width
    half_angle = radians(shape.half_angle)
    return levelset.wedge(
        shape.tip, shape.direction, half_angle, shape.length, shape.edge, width
    )
