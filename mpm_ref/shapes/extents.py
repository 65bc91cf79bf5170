"""Compute bounding boxes and volumes of the analytic shapes."""

from functools import singledispatch
from math import hypot, inf, pi, radians, tan

import numpy as np

from .. import shapes


def hull(x):
    """Return the corners of the bounding box of points (N, d)."""
    return x.min(axis=0), x.max(axis=0)


@singledispatch
def bounds(shape):
    """Return the corners (low, high) of the bounding box of an analytic shape."""
    raise TypeError(f"{type(shape).__name__} is not an analytic shape")


@bounds.register
def _(shape: shapes.HalfSpace):
    d = len(shape.point)
    low, high = np.full(d, -inf), np.full(d, inf)
    along = np.flatnonzero(shape.normal)
    if len(along) == 1:
        a = along[0]
        (high if shape.normal[a] > 0.0 else low)[a] = shape.point[a]
    return low, high


@bounds.register
def _(shape: shapes.Box):
    return np.array(shape.lower), np.array(shape.upper)


@bounds.register
def _(shape: shapes.Sphere):
    return np.array(shape.center) - shape.radius, np.array(shape.center) + shape.radius


@bounds.register
def _(shape: shapes.Capsule):
    low, high = hull(np.array([shape.start, shape.end]))
    return low - shape.radius, high + shape.radius


@bounds.register
def _(shape: shapes.Cylinder):
    low, high = hull(np.array([shape.start, shape.end]))
    rim = shape.radius * _disk(np.subtract(shape.end, shape.start))
    return low - rim, high + rim


@bounds.register
def _(shape: shapes.Torus):
    ring = np.ones(2) if shape.axis is None else _disk(np.array(shape.axis))
    extent = shape.major * ring + shape.minor
    return np.array(shape.center) - extent, np.array(shape.center) + extent


@bounds.register
def _(shape: shapes.Wedge):
    d = len(shape.tip)
    w = shapes.level_set(shape)
    a, b = np.array([w.ax, w.ay, w.az]), np.array([w.bx, w.by, w.bz])
    across = np.cross(a, b) if d == 3 else np.array([-a[1], a[0], 0.0])
    back = [w.length * (a + s * tan(w.half_angle) * across) for s in (-1.0, 1.0)]
    low, high = hull(np.array([0.0 * a, *back])[:, :d] + shape.tip)
    half_width = np.array([abs(c) * w.half_width if c else 0.0 for c in b[:d]])
    return low - half_width, high + half_width


@singledispatch
def volume(shape):
    """Return the volume [m^d] of an analytic shape, or None if it is infinite."""
    return None


@volume.register
def _(shape: shapes.Box):
    return float(np.prod(np.subtract(shape.upper, shape.lower)))


@volume.register
def _(shape: shapes.Sphere):
    return _ball(len(shape.center), shape.radius)


@volume.register
def _(shape: shapes.Cylinder):
    return _ball(len(shape.start) - 1, shape.radius) * _distance(shape.start, shape.end)


@volume.register
def _(shape: shapes.Capsule):
    d, r = len(shape.start), shape.radius
    return _ball(d - 1, r) * _distance(shape.start, shape.end) + _ball(d, r)


@volume.register
def _(shape: shapes.Torus):
    return 2.0 * pi * shape.major * _ball(len(shape.center) - 1, shape.minor)


@volume.register
def _(shape: shapes.Wedge):
    width = 1.0 if len(shape.tip) == 2 else shape.width
    return None if width is None else shape.length**2 * tan(radians(shape.half_angle)) * width


def _ball(d, r):
    """Return the volume of a ball of radius r in d dimensions [m^d]."""
    return {1: 2.0 * r, 2: pi * r**2, 3: 4.0 / 3.0 * pi * r**3}[d]


def _distance(a, b):
    return hypot(*np.subtract(b, a))


def _disk(axis):
    """Return the half edges of the bounding box of a unit disk at right angles to `axis`."""
    return np.sqrt(np.maximum(1.0 - (axis / hypot(*axis)) ** 2, 0.0))
