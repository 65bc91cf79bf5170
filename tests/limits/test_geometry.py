"""Scaled and shifted shapes contain the scaled and shifted points; so do parts that move."""

import numpy as np
import pytest
from msgspec import convert, to_builtins

from mpm_ref.limits.geometry import scale_lengths, scaled_shape, shift_points, shifted_shape
from mpm_ref.scene import SceneError, loads
from mpm_ref.scene.validate import plain, validate_scene
from mpm_ref.shapes import Shape
from mpm_ref.shapes.inside import solid

BALL = {"type": "sphere", "center": [0.2, 0.1, 0.0], "radius": 0.5}
BOX = {"type": "box", "lower": [-0.4, -0.3, -0.2], "upper": [0.5, 0.6, 0.4]}
SHAPES = [
    BALL, BOX,
    {"type": "half_space", "point": [0.1, 0.2, 0.3], "normal": [1.0, 2.0, 0.5]},
    {"type": "cylinder", "start": [-0.5, 0.0, 0.1], "end": [0.5, 0.2, 0.0], "radius": 0.3},
    {"type": "capsule", "start": [-0.5, 0.0, 0.1], "end": [0.5, 0.2, 0.0], "radius": 0.3},
    {"type": "torus", "center": [0.1, 0.0, 0.0], "major": 0.5, "minor": 0.2,
     "axis": [0.0, 1.0, 0.3]},
    {"type": "wedge", "tip": [-0.3, 0.1, 0.0], "direction": [1.0, 0.0, 0.0], "half_angle": 30.0,
     "length": 0.8, "edge": [0.0, 0.0, 1.0], "width": 0.9},
    {"type": "union", "shapes": [BALL, BOX]},
    {"type": "intersection", "shapes": [BALL, BOX]},
    {"type": "difference", "shape": BOX, "minus": [BALL]},
    {"type": "moved", "shape": BOX, "scale": 0.8, "angle": 30.0, "axis": [0.0, 0.0, 1.0],
     "translate": [0.1, 0.0, 0.2]},
    {"type": "moved", "shape": BOX, "angle": 30.0, "axis": [0.0, 0.0, 1.0],
     "about": [0.3, 0.1, 0.0]},
]
CORNERS = [[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0, 0.8, 0.0], [0.0, 0.0, 0.7]]
FACES = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def is_inside(tables, x):
    return solid(convert(tables, Shape)).inside(x)


def plain_shape(tables):
    """The tables with all their keys, as those of a scene."""
    return to_builtins(convert(tables, Shape))


def points(rng):
    return rng.uniform(-1.0, 1.0, (2000, 3))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape["type"])
def test_shape_is_scaled_and_shifted(rng, shape):
    x, offset = points(rng), np.array([3.0, -2.0, 5.0])
    before = is_inside(shape, x)
    assert 0 < before.sum() < len(x)
    assert (is_inside(scaled_shape(plain_shape(shape), 2.5, 3), 2.5 * x) == before).all()
    assert (is_inside(shifted_shape(plain_shape(shape), offset), x + offset) == before).all()


def test_mesh_is_scaled_and_shifted(rng, tmp_path):
    pytest.importorskip("trimesh")
    file = tmp_path / "corner.obj"
    file.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + FACES)
    x, offset = points(rng), np.array([3.0, -2.0, 5.0])
    shape = {"type": "mesh", "file": str(file)}
    before = is_inside(shape, x)
    assert before.any()
    assert (is_inside(scaled_shape(plain_shape(shape), 2.5, 3), 2.5 * x) == before).all()
    assert (is_inside(shifted_shape(plain_shape(shape), offset), x + offset) == before).all()


SCENE = """
dim = 2
dx = 0.1
end = 1.0
[[body]]
name = "block"
density = 1.0
shape = { type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }
material = { law = "fixed_corotated", E = 1.0, nu = 0.3 }
[[collider]]
shape = { type = "box", lower = [2.0, 0.0], upper = [2.5, 0.5] }
[collider.motion]
angle = 20.0
rotation = { type = "steady", rate = 1.5 }
translation = { type = "keyframes", times = [0.0, 1.0], values = [[0.0, 0.0], [0.3, 0.1]] }
[[fixed]]
region = { type = "sphere", center = [0.0, 1.0], radius = 0.2 }
[walls]
low = [2, "open"]
high = [40, 50]
[clip]
lower = [0.0, 0.0]
upper = [5.0, 5.0]
"""


def pose_points(scene, x):
    """Where points of the first collider are at t = 0.7 s."""
    pose = scene.parts.conditions.colliders[0].motion.pose(0.7, 0.1, 2)
    return pose.center + (x - pose.origin) @ pose.R[0].T


def changed_scene(change):
    tables = {key: value for key, value in plain(loads(SCENE)).items() if value is not None}
    change(tables)
    return validate_scene(tables)


def test_moving_part_is_scaled_and_shifted(rng):
    x = rng.uniform(0.0, 3.0, (10, 2))
    before = pose_points(loads(SCENE), x)
    scaled = changed_scene(lambda tables: scale_lengths(tables, 2.0))
    assert np.allclose(pose_points(scaled, 2.0 * x), 2.0 * before)
    shifted = changed_scene(lambda tables: shift_points(tables, [30, -20]))
    assert np.allclose(pose_points(shifted, x + (3.0, -2.0)), before + (3.0, -2.0))


def test_walls_and_clip_are_scaled_and_shifted():
    scaled = changed_scene(lambda tables: scale_lengths(tables, 2.0))
    assert scaled.walls.low == (2, "open")
    assert scaled.clip.upper == (10.0, 10.0)
    shifted = changed_scene(lambda tables: shift_points(tables, [30, -20]))
    assert (shifted.walls.low, shifted.walls.high) == ((32, "open"), (70, 30))
    assert np.allclose((shifted.clip.lower, shifted.clip.upper), ((3.0, -2.0), (8.0, 3.0)))
    assert shifted.fixed[0].region.center == pytest.approx((3.0, -1.0))


def test_arrays_are_not_scaled_but_shifted():
    tables = {"dim": 2, "dx": 0.5, "collider": (), "fixed": (), "body": [
        {"particles": {"offset": None}, "velocity": {"center": [1.0, 1.0]}}]}
    with pytest.raises(ValueError, match="arrays of particles") as caught:
        scale_lengths(tables, 2.0)
    assert not isinstance(caught.value, SceneError)
    shift_points(tables, [2, 4])
    assert tables["body"][0] == {"particles": {"offset": [1.0, 2.0]},
                                 "velocity": {"center": [2.0, 3.0]}}
