"""Distances and normals of the analytic shapes.

A function that is zero on a surface, changes no faster than the distance between points, and from
every point finds the surface at its own value away, is the distance to that surface.
"""

import numpy as np
import pytest

from mpm_ref.core import levelset
from mpm_ref.core.levelset import distance, distances, normals
from mpm_ref.core.motion import rotation

A = np.array([0.3, -0.2, 0.1])           # a point
U = np.array([2.0, 1.0, 2.0]) / 3.0      # a direction
E = np.array([1.0, 0.0, -1.0])           # perpendicular to U


def made(name, d):
    """The shapes of the table in d dimensions."""
    a, u = A[:d], U[:d]
    if name == "half_space":
        return levelset.half_space(a, 5.0 * u)
    if name == "box":
        return levelset.box(a - 0.3, a + (0.2, 0.5, 0.4)[:d])
    if name == "sphere":
        return levelset.sphere(a, 0.5)
    if name in ("cylinder", "capsule"):
        return getattr(levelset, name)(a - 0.4 * u, a + 0.4 * u, 0.25)
    if name == "torus":
        return levelset.torus(a, 0.5, 0.2, u if d == 3 else None)
    return levelset.wedge(a, u, 0.5, 0.8, **({"edge": E, "width": 0.6} if d == 3 else {}))


def contains(name, x):
    """Whether points are in the shape of that name, from its definition."""
    d = x.shape[1]
    u = U[:d] / np.linalg.norm(U[:d])
    r = x - A[:d]
    h = r @ u
    off = np.linalg.norm(r - h[:, None] * u, axis=1)
    half = 0.4 * np.linalg.norm(U[:d])
    if name == "half_space":
        return h <= 0.0
    if name == "box":
        return ((r >= -0.3) & (r <= (0.2, 0.5, 0.4)[:d])).all(axis=1)
    if name == "sphere":
        return np.linalg.norm(r, axis=1) <= 0.5
    if name == "cylinder":
        return (abs(h) <= half) & (off <= 0.25)
    if name == "capsule":
        beyond = np.maximum(abs(h) - half, 0.0)
        return np.hypot(beyond, off) <= 0.25
    if name == "torus":
        ring = off if d == 3 else np.linalg.norm(r, axis=1)
        return np.hypot(ring - 0.5, h if d == 3 else 0.0) <= 0.2
    e = E / np.linalg.norm(E)
    w = r @ e if d == 3 else np.zeros(len(r))
    side = np.sqrt(np.maximum(off**2 - w**2, 0.0))
    return (side <= h * np.tan(0.5)) & (h <= 0.8) & (abs(w) <= 0.3)


NAMES = ("half_space", "box", "sphere", "cylinder", "capsule", "torus", "wedge")


@pytest.fixture(params=NAMES)
def name(request):
    return request.param


@pytest.fixture
def x(d, rng):
    """Points around the shapes."""
    return A[:d] + rng.uniform(-0.7, 0.7, (400, d))


def test_negative_inside(name, d, x):
    inside = distances(x, made(name, d)) < 0.0
    assert (inside == contains(name, x)).all()
    assert 3 < inside.sum() < len(x) - 3


def test_changes_no_faster_than_points_part(name, d, x):
    g = distances(x, made(name, d))
    apart = np.linalg.norm(x[:, None] - x, axis=2)
    assert (abs(g[:, None] - g) <= apart + 1e-14).all()


def test_finds_the_surface_at_its_value_along_the_normal(name, d, x):
    shape = made(name, d)
    foot = x - distances(x, shape)[:, None] * normals(x, shape)
    assert abs(distances(foot, shape)).max() < 1e-14


def test_normal_is_the_gradient_and_has_length_one(name, d, x):
    """The gradient by differences; no point of x is within h of a ridge."""
    shape, h = made(name, d), 1e-5
    steps = h * np.eye(d)
    rise = [distances(x + step, shape) - distances(x - step, shape) for step in steps]
    gradient = np.stack(rise, axis=1) / (2.0 * h)
    # error h^2 / 6 times the third derivative, ~1 / (distance to a centre of curvature)^2
    assert abs(gradient - normals(x, shape)).max() < 1e-6
    assert abs(np.linalg.norm(gradient, axis=1) - 1.0).max() < 1e-6


def test_unit_normals_where_the_gradient_does_not_exist(name, d):
    """Centre, axis, ridges and corners."""
    axis = A[:d] + np.linspace(-1.0, 1.0, 9)[:, None] * U[:d]
    corners = A[:d] + np.stack(np.meshgrid(*d * [(-0.3, -0.05, 0.0, 0.2)]), -1).reshape(-1, d)
    n = normals(np.concatenate((axis, corners)), made(name, d))
    assert abs(np.linalg.norm(n, axis=1) - 1.0).max() < 1e-15


@pytest.mark.parametrize("name", ["cylinder", "capsule"])
@pytest.mark.parametrize("axis", np.eye(3), ids="xyz")
def test_normals_on_an_axis_point_away_from_it(name, axis):
    n = normals(np.zeros((1, 3)), getattr(levelset, name)(-axis, axis, 0.1))[0]
    assert n @ axis == 0.0


@pytest.mark.parametrize(("shape", "point", "value", "n"), [
    (levelset.half_space((0, 0, 1), (0, 0, 2)), (5, 6, 3), 2.0, (0, 0, 1)),
    (levelset.box((0, 0, 0), (2, 4, 6)), (1, 2, 3), -1.0, (1, 0, 0)),
    (levelset.box((0, 0, 0), (2, 4, 6)), (5, 8, 3), 5.0, (0.6, 0.8, 0)),
    (levelset.box((0, 0), (2, 4)), (-3, -4), 5.0, (-0.6, -0.8)),
    (levelset.sphere((1, 1), 2), (4, 5), 3.0, (0.6, 0.8)),
    (levelset.cylinder((0, 0, 0), (0, 0, 2), 1), (4, 0, 6), 5.0, (0.6, 0, 0.8)),
    (levelset.cylinder((0, 0, 0), (0, 0, 2), 1), (0.5, 0, 1), -0.5, (1, 0, 0)),
    (levelset.capsule((0, 0, 0), (0, 0, 2), 1), (3, 0, 6), 4.0, (0.6, 0, 0.8)),
    (levelset.torus((0, 0, 0), 2, 1, (0, 0, 3)), (0, 5, 4), 4.0, (0, 0.6, 0.8)),
    (levelset.torus((0, 0, 0), 2, 1, (0, 0, 1)), (0, 0, 0), 1.0, None),
    (levelset.torus((0, 0), 2, 1), (0.5, 0), 0.5, (-1, 0)),
    (levelset.wedge((0, 0), (0, 1), np.arctan(0.75), 4), (0, -2), 2.0, (0, -1)),
    (levelset.wedge((0, 0), (0, 1), np.arctan(0.75), 4), (4, 3), 1.4, (0.8, -0.6)),
    (levelset.wedge((0, 0), (0, 1), np.arctan(0.75), 4), (-6, 8), 5.0, (-0.6, 0.8)),
    (levelset.wedge((0, 0), (0, 1), np.arctan(0.75), 4), (2.8, 6), 2.0, (0, 1)),
    (levelset.wedge((0, 0, 0), (0, 0, 1), 0.4, 4, (0, 1, 0), 2), (0, 3, 2), 2.0, (0, 1, 0)),
    (levelset.wedge((0, 0, 0), (0, 0, 1), 0.4, 4, (0, 1, 0)), (0, 1e9, -1), 1.0, (0, 0, -1)),
])
def test_values_by_hand(shape, point, value, n):
    point = np.array([point], dtype=float)
    assert distances(point, shape) == pytest.approx([value], abs=1e-14)
    if n is not None:
        assert normals(point, shape)[0] == pytest.approx(n, abs=1e-14)


def test_a_turned_frame_changes_nothing(d, rng):
    """A cylinder along (cos, sin[, 0]) is the box along the axes (2D), or the turned cylinder."""
    Q = rotation(0.7, (0, 0, 1) if d == 3 else None)
    x = rng.uniform(-1.0, 1.0, (200, d))
    e = np.eye(d)[0]
    straight = levelset.cylinder(-0.5 * e, 0.5 * e, 0.3)
    turned = levelset.cylinder(-0.5 * Q @ e, 0.5 * Q @ e, 0.3)
    assert abs(distances(x @ Q.T, turned) - distances(x, straight)).max() < 1e-15
    if d == 2:
        flat = levelset.box((-0.5, -0.3), (0.5, 0.3))
        assert abs(distances(x, straight) - distances(x, flat)).max() < 1e-15


def test_one_point_as_a_tuple():
    assert distance((3.0, 4.0), levelset.sphere((0, 0), 1)) == 4.0
    with pytest.raises(TypeError, match=r"distance is not defined for .*float"):
        distance((3.0, 4.0), 1.0)


@pytest.mark.parametrize(("make", "said"), [
    (lambda: levelset.sphere((0, 0), -1.0), "radius = -1.0: expected a positive length"),
    (lambda: levelset.sphere((0, 0), np.nan), "radius = nan"),
    (lambda: levelset.sphere((0, np.inf), 1.0), "center = .*expected 2 or 3 finite numbers"),
    (lambda: levelset.sphere((0,), 1.0), "center = .*expected 2 or 3 finite numbers"),
    (lambda: levelset.half_space((0, 0), (0, 0)), "normal = .*positive length"),
    (lambda: levelset.box((0, 1), (1, 1)), "expected lower < upper"),
    (lambda: levelset.box((0, 0, 0), (1, 1)), "expected lower < upper"),
    (lambda: levelset.cylinder((1, 1), (1, 1), 1.0), "end - start = .*positive length"),
    (lambda: levelset.torus((0, 0), 1.0, 2.0), "expected 0 < minor <= major"),
    (lambda: levelset.torus((0, 0, 0), 2.0, 1.0), "axis = None in 3D"),
    (lambda: levelset.torus((0, 0), 2.0, 1.0, (0, 0, 1)), "in 2D"),
    (lambda: levelset.wedge((0, 0), (0, 1), 2.0, 1.0), "half_angle = 2.0"),
    (lambda: levelset.wedge((0, 0, 0), (0, 0, 1), 0.1, 1.0), "edge = None in 3D"),
    (lambda: levelset.wedge((0, 0, 0), (0, 0, 1), 0.1, 1.0, (0, 0, 2)), "are parallel"),
    (lambda: levelset.wedge((0, 0, 0), (0, 0, 1), 0.1, 1.0, (0, 1, 0), -1), "width = -1"),
    (lambda: distances(np.zeros(3), levelset.sphere((0, 0), 1.0)), r"expected \(N, 2\) or"),
    (lambda: distances(np.zeros((1, 2)), levelset.half_space((0, 0, 0), (0, 0, 1))), "in 2D"),
    (lambda: distances(np.zeros((1, 3)), levelset.box((0, 0), (1, 1))), "in 3D"),
    (lambda: normals(np.zeros((1, 3)), levelset.torus((0, 0), 2.0, 1.0)), "in 3D"),
])
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
