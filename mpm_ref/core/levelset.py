"""Level sets: one source for colliders, prescribed regions and bodies to fill.

A shape is a NamedTuple of floats (`solids`), made by `half_space`, `box`, `sphere`, `cylinder`,
`capsule`, `torus` or `wedge`. `distance(x, shape)` [m] is negative inside; `normal(x, shape)` is
its gradient, a unit vector that points outward. Both take a point as a tuple; `distances` and
`normals` map them over arrays.

Distances are exact inside and outside. The normal is the gradient of the distance. Where that does
not exist (on an axis, at a centre, on a ridge inside a box) it is one of the gradients nearby,
always the same one, so that it is a unit vector everywhere.

Most shapes reduce to a corner: with q_k the signed distances to faces at right angles, `corner` is
the distance to the set of all q_k <= 0.
"""

from math import cos, sin

import numpy as np

from .jit import CHUNKS, by_type, chunk, kernel, parallel_if_many, prange
from .solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Sphere,
    Torus,
    Wedge,
    box,
    capsule,
    check_dimension,
    cylinder,
    half_space,
    sphere,
    torus,
    wedge,
)
from .tensor import cross, dot, lin, norm, put_vec, vec

__all__ = [
    "SHAPES",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Sphere",
    "Torus",
    "Wedge",
    "box",
    "capsule",
    "cylinder",
    "distance",
    "distances",
    "half_space",
    "normal",
    "normals",
    "sphere",
    "torus",
    "wedge",
]

SHAPES = (HalfSpace, Box, Sphere, Cylinder, Capsule, Torus, Wedge)

distance = by_type("distance")     # (x, shape) -> signed distance [m], negative inside
normal = by_type("normal")         # (x, shape) -> its gradient, a unit vector


# vectors

@kernel
def triple(x, y, z, like):
    """(x, y[, z])."""
    if len(like) == 2:
        return x, y
    else:
        return x, y, z


@kernel
def clip_below(q):
    """max(q_k, 0) of each component."""
    if len(q) == 2:
        return max(q[0], 0.0), max(q[1], 0.0)
    else:
        return max(q[0], 0.0), max(q[1], 0.0), max(q[2], 0.0)


@kernel
def unit(x, otherwise):
    """x / |x|, or `otherwise` for x = 0."""
    size = norm(x)
    return lin(1.0 / size, x, 0.0, x) if size > 0.0 else otherwise


@kernel
def sign(s):
    """1 or -1, never 0."""
    return 1.0 if s >= 0.0 else -1.0


@kernel
def largest(q):
    """Index of the largest component."""
    j = 0
    for k in range(1, len(q)):
        if q[k] > q[j]:
            j = k
    return j


@kernel
def along(j, like):
    """Unit vector of axis j."""
    return triple(1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2), like)


@kernel
def aside(a):
    """A unit vector at right angles to the unit vector a; any one for a = 0."""
    j = 0
    for k in range(1, len(a)):
        if abs(a[k]) < abs(a[j]):
            j = k
    e = along(j, a)
    return unit(lin(1.0, e, -a[j], a), e)


@kernel
def across(a, b):
    """a x b in 3D; in 2D a turned by a right angle."""
    if len(a) == 2:
        return -a[1], a[0]
    else:
        return cross(a, b)


# corner: the set of all q_k <= 0

@kernel
def corner(q):
    """Signed distance to the set of all q_k <= 0."""
    return norm(clip_below(q)) + min(q[largest(q)], 0.0)


@kernel
def corner_gradient(q):
    """Gradient of `corner` with respect to q; on ridges that of the first of the nearest faces."""
    return unit(clip_below(q), along(largest(q), q))


# half-space, box, sphere

@kernel
def from_center(x, shape):
    """x relative to the shape's (x, y, z)."""
    return lin(1.0, x, -1.0, triple(shape.x, shape.y, shape.z, x))


@kernel
def half_space_distance(x, shape):
    """n . x - offset."""
    return dot(half_space_normal(x, shape), x) - shape.offset


@kernel
def half_space_normal(x, shape):
    """The normal n."""
    return triple(shape.nx, shape.ny, shape.nz, x)


@kernel
def box_faces(x, shape):
    """Signed distances to the nearer face of each axis."""
    p = from_center(x, shape)
    a = triple(abs(p[0]), abs(p[1]), abs(p[len(p) - 1]), x)
    return lin(1.0, a, -1.0, triple(shape.hx, shape.hy, shape.hz, x))


@kernel
def box_distance(x, shape):
    """Distance to the corner of the octant of x."""
    return corner(box_faces(x, shape))


@kernel
def box_normal(x, shape):
    """Gradient of the corner, mirrored into the octant of x."""
    p, g = from_center(x, shape), corner_gradient(box_faces(x, shape))
    last = len(p) - 1
    return triple(sign(p[0]) * g[0], sign(p[1]) * g[1], sign(p[last]) * g[last], x)


@kernel
def sphere_distance(x, shape):
    """|x - c| - radius."""
    return norm(from_center(x, shape)) - shape.radius


@kernel
def sphere_normal(x, shape):
    """(x - c)/|x - c|."""
    return unit(from_center(x, shape), along(0, x))


# shapes about an axis: x - c = h a + r, with r at right angles to the unit vector a

@kernel
def axis(shape, like):
    """The vector a of the shape."""
    return triple(shape.ax, shape.ay, shape.az, like)


@kernel
def off_axis(p, a):
    """h and r of p = h a + r."""
    h = dot(p, a)
    return h, lin(1.0, p, -h, a)


@kernel
def cylinder_distance(x, shape):
    """Distance to the corner of the faces |r| = radius and |h| = half."""
    h, r = off_axis(from_center(x, shape), axis(shape, x))
    return corner((norm(r) - shape.radius, abs(h) - shape.half))


@kernel
def cylinder_normal(x, shape):
    """Gradient of the corner, along r and a."""
    a = axis(shape, x)
    h, r = off_axis(from_center(x, shape), a)
    g = corner_gradient((norm(r) - shape.radius, abs(h) - shape.half))
    return lin(g[0], unit(r, aside(a)), sign(h) * g[1], a)


@kernel
def from_segment(x, shape):
    """x relative to the nearest point of the capsule's segment."""
    p, a = from_center(x, shape), axis(shape, x)
    return lin(1.0, p, -max(-shape.half, min(shape.half, dot(p, a))), a)


@kernel
def capsule_distance(x, shape):
    """Distance to the segment, less the radius."""
    return norm(from_segment(x, shape)) - shape.radius


@kernel
def capsule_normal(x, shape):
    """Away from the nearest point of the segment."""
    return unit(from_segment(x, shape), aside(axis(shape, x)))


@kernel
def from_circle(x, shape):
    """x relative to the nearest point of the torus' circle."""
    p, a = from_center(x, shape), axis(shape, x)
    _, r = off_axis(p, a)
    return lin(1.0, p, -shape.major, unit(r, aside(a)))


@kernel
def torus_distance(x, shape):
    """Distance to the circle, less the tube's radius."""
    return norm(from_circle(x, shape)) - shape.minor


@kernel
def torus_normal(x, shape):
    """Away from the nearest point of the circle."""
    a = axis(shape, x)
    _, r = off_axis(from_center(x, shape), a)
    return unit(from_circle(x, shape), unit(r, aside(a)))


# wedge: half its profile is the triangle (0, 0), (0, length), (length tan(half_angle), length)

@kernel
def triangle(u, h, shape):
    """Distance to the half profile from (u >= 0, h), and its gradient with respect to u and h."""
    s, c = sin(shape.half_angle), cos(shape.half_angle)
    face, back = u * c - h * s, h - shape.length
    if face <= 0.0 and back <= 0.0:
        return (face, c, -s) if face >= back else (back, 0.0, 1.0)
    t = max(0.0, min(shape.length / c, u * s + h * c))
    to_face = (u - t * s, h - t * c)
    to_back = (u - min(u, shape.length * s / c), back)
    g = to_face if dot(to_face, to_face) <= dot(to_back, to_back) else to_back
    d = norm(g)
    g = unit(g, (c, -s) if face >= back else (0.0, 1.0))
    return d, g[0], g[1]


@kernel
def wedge_frame(x, shape):
    """Depth h along a, width w along b, side u >= 0 along the unit vector e; and e, a, b."""
    a, b, p = axis(shape, x), triple(shape.bx, shape.by, shape.bz, x), from_center(x, shape)
    e, h, w = across(a, b), dot(p, a), dot(p, b)
    u = dot(p, e)
    return h, w, abs(u), lin(sign(u), e, 0.0, e), a, b


@kernel
def wedge_distance(x, shape):
    """Distance to the corner of the triangle and the two flat sides."""
    h, w, u, _, _, _ = wedge_frame(x, shape)
    d, _, _ = triangle(u, h, shape)
    return corner((d, abs(w) - shape.half_width))


@kernel
def wedge_normal(x, shape):
    """Gradient of the corner, along e, a and b."""
    h, w, u, e, a, b = wedge_frame(x, shape)
    d, gu, gh = triangle(u, h, shape)
    g = corner_gradient((d, abs(w) - shape.half_width))
    return lin(g[0], lin(gu, e, gh, a), sign(w) * g[1], b)


for _shape, _distance, _normal in (
    (HalfSpace, half_space_distance, half_space_normal),
    (Box, box_distance, box_normal),
    (Sphere, sphere_distance, sphere_normal),
    (Cylinder, cylinder_distance, cylinder_normal),
    (Capsule, capsule_distance, capsule_normal),
    (Torus, torus_distance, torus_normal),
    (Wedge, wedge_distance, wedge_normal),
):
    distance.method(_shape, _distance)
    normal.method(_shape, _normal)


# arrays of points

@kernel
def _distances(x, shape, out, like, bounds):
    for p in range(bounds[0], bounds[1]):
        out[p] = distance(vec(x, p, like), shape)


@kernel
def _normals(x, shape, out, like, bounds):
    for p in range(bounds[0], bounds[1]):
        put_vec(out, p, normal(vec(x, p, like), shape))


@parallel_if_many
def _all_distances(x, shape, out, like):
    for c in prange(CHUNKS):
        _distances(x, shape, out, like, chunk(c, len(x)))


@parallel_if_many
def _all_normals(x, shape, out, like):
    for c in prange(CHUNKS):
        _normals(x, shape, out, like, chunk(c, len(x)))


def distances(x, shape):
    """Signed distances (N,) [m] of points x (N, d) to the surface of a shape; negative inside.

    Raises ValueError for a shape that is not for d dimensions.
    """
    x, like = _points(x, shape)
    out = np.empty(len(x))
    _all_distances(x, shape, out, like)
    return out


def normals(x, shape):
    """Outward unit normals (N, d) of a shape at points x (N, d); see `distances`."""
    x, like = _points(x, shape)
    out = np.empty_like(x)
    _all_normals(x, shape, out, like)
    return out


def _points(x, shape):
    """The points as a C-contiguous array, and a tuple of length d."""
    x = np.ascontiguousarray(x, dtype=float)
    if x.ndim != 2 or x.shape[1] not in (2, 3):
        raise ValueError(f"points of shape {x.shape}: expected (N, 2) or (N, 3)")
    check_dimension(shape, x.shape[1])
    return x, x.shape[1] * (0.0,)
