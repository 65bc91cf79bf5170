"""Analytic shapes as records of floats, and functions that make them from points and sizes.

The same records describe 2D and 3D; what has no meaning in 2D is zero there. In 2D a sphere is a
disk, a cylinder a rectangle, a capsule a stadium, a torus a ring and a wedge a triangle. Make
shapes with the lower-case functions: they check their arguments and raise ValueError. Points and
vectors are sequences of 2 or 3 numbers.
"""

from math import hypot, inf, isfinite, pi
from typing import NamedTuple


class HalfSpace(NamedTuple):
    """Points with n . x <= offset."""

    nx: float             # outward unit normal n
    ny: float
    nz: float
    offset: float         # [m]


class Box(NamedTuple):
    """Box along the axes. The motion of a collider can turn it."""

    x: float              # centre [m]
    y: float
    z: float
    hx: float             # half sizes [m]
    hy: float
    hz: float


class Sphere(NamedTuple):
    """Ball; a disk in 2D."""

    x: float              # centre [m]
    y: float
    z: float
    radius: float         # [m]


class Cylinder(NamedTuple):
    """Solid cylinder with flat ends."""

    x: float              # centre [m]
    y: float
    z: float
    ax: float             # unit vector along the axis
    ay: float
    az: float
    radius: float         # [m]
    half: float           # half length [m]


class Capsule(NamedTuple):
    """Points within `radius` of a segment."""

    x: float              # middle of the segment [m]
    y: float
    z: float
    ax: float             # unit vector along the segment
    ay: float
    az: float
    radius: float         # [m]
    half: float           # half length of the segment [m]


class Torus(NamedTuple):
    """Points within `minor` of a circle."""

    x: float              # centre [m]
    y: float
    z: float
    ax: float             # unit vector along the axis; zero in 2D
    ay: float
    az: float
    major: float          # radius of the circle [m]
    minor: float          # radius of the tube [m]


class Wedge(NamedTuple):
    """Blade: a symmetric triangle with its tip at (x, y, z), drawn out along the sharp edge."""

    x: float              # middle of the sharp edge [m]
    y: float
    z: float
    ax: float             # unit vector from the edge into the blade
    ay: float
    az: float
    bx: float             # unit vector along the edge; zero in 2D
    by: float
    bz: float
    half_angle: float     # between a face and the middle plane [rad]
    length: float         # from the edge to the back [m]
    half_width: float     # half length of the edge [m]


IN_3D = {Box: ("hz",), Torus: ("ax", "ay", "az"), Wedge: ("bx", "by", "bz")}     # not all zero


def half_space(point, normal):
    """Everything behind the plane through `point` [m]; `normal` points out of it, of any length."""
    n = _unit("normal", normal)
    return HalfSpace(*n, sum(a * b for a, b in zip(_vector("point", point), n)))


def box(lower, upper):
    """Box between two opposite corners [m]."""
    low, high = _vector("lower", lower), _vector("upper", upper)
    d = len(tuple(lower))
    if len(tuple(upper)) != d or not all(a < b for a, b in zip(low[:d], high[:d])):
        raise ValueError(f"box from {lower} to {upper}: expected lower < upper on every axis")
    half = [0.5 * (b - a) for a, b in zip(low, high)]
    return Box(*(a + h for a, h in zip(low, half)), *half)


def sphere(center, radius):
    """Ball about `center` [m]; a disk in 2D."""
    return Sphere(*_vector("center", center), _positive("radius", radius))


def cylinder(start, end, radius):
    """Solid cylinder with flat ends at the points `start` and `end` of its axis [m]."""
    return Cylinder(*_segment(start, end), _positive("radius", radius), _half_length(start, end))


def capsule(start, end, radius):
    """Points within `radius` of the segment from `start` to `end` [m]."""
    return Capsule(*_segment(start, end), _positive("radius", radius), _half_length(start, end))


def torus(center, major, minor, axis=None):
    """Points within `minor` of a circle of radius `major` about `center` [m]; 3D: and `axis`."""
    if not 0.0 < minor <= major < inf:
        raise ValueError(f"major = {major}, minor = {minor}: expected 0 < minor <= major")
    _dimensions(center, axis, "axis")
    a = (0.0, 0.0, 0.0) if axis is None else _unit("axis", axis)
    return Torus(*_vector("center", center), *a, float(major), float(minor))


def wedge(tip, direction, half_angle, length, edge=None, width=inf):
    """Blade with its sharp edge at `tip` [m], getting thicker along `direction` for `length` [m].

    half_angle [rad], between a face and the middle plane, is in (0, pi/2). In 3D the edge lies
    along `edge`, made perpendicular to `direction`, and is `width` [m] long with `tip` in its
    middle; in 2D there is neither.
    """
    if not 0.0 < half_angle < 0.5 * pi:
        raise ValueError(f"half_angle = {half_angle}: expected an angle between 0 and pi/2 in rad")
    _dimensions(tip, edge, "edge")
    a = _unit("direction", direction)
    b = (0.0, 0.0, 0.0) if edge is None else _perpendicular(_unit("edge", edge), a)
    if not width > 0.0:
        raise ValueError(f"width = {width}: expected a positive length in m")
    sizes = float(half_angle), _positive("length", length), 0.5 * width
    return Wedge(*_vector("tip", tip), *a, *b, *sizes)


def check_dimension(shape, d):
    """Raise ValueError for a shape that is not one of d dimensions."""
    if d == 2:
        fits = not any(getattr(shape, name, 0.0) for name in ("z", "nz", "az", "bz", "hz"))
    else:
        names = IN_3D.get(type(shape))
        fits = names is None or any(getattr(shape, name) for name in names)
    if not fits:
        raise ValueError(f"{shape} in {d}D: expected a shape made from points of {d} numbers")


def _vector(name, x):
    """Three finite floats; the third is 0 in 2D."""
    x = tuple(float(a) for a in x)
    if len(x) not in (2, 3) or not all(map(isfinite, x)):
        raise ValueError(f"{name} = {x}: expected 2 or 3 finite numbers")
    return (*x, 0.0)[:3]


def _positive(name, size):
    if not 0.0 < size < inf:
        raise ValueError(f"{name} = {size}: expected a positive length in m")
    return float(size)


def _unit(name, x):
    x = _vector(name, x)
    size = hypot(*x)
    if not size > 0.0:
        raise ValueError(f"{name} = {x}: expected a vector of positive length")
    return tuple(a / size for a in x)


def _perpendicular(b, a):
    """b without its part along a, as a unit vector."""
    h = sum(p * q for p, q in zip(a, b))
    rest = tuple(q - h * p for p, q in zip(a, b))
    if hypot(*rest) < 1e-6:
        raise ValueError(f"edge = {b} and direction = {a} are parallel: expected them not to be")
    return _unit("edge", rest)


def _dimensions(point, direction, name):
    """A direction that only 3D has is given in 3D, and only there."""
    d = len(tuple(point))
    if (direction is None) == (d == 3):
        raise ValueError(f"{name} = {direction} in {d}D: expected it in 3D, and only there")


def _half_length(start, end):
    low, high = _vector("start", start), _vector("end", end)
    return 0.5 * _positive("length", hypot(*(b - a for a, b in zip(low, high))))


def _segment(start, end):
    """Middle and unit vector of a segment."""
    low, high = _vector("start", start), _vector("end", end)
    middle = (0.5 * (a + b) for a, b in zip(low, high))
    return *middle, *_unit("end - start", [b - a for a, b in zip(low, high)])
