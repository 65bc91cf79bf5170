"""Mirror planes are found where all of a scene is symmetric, and the half has half the mass."""

import numpy as np
import pytest
from needs_toys import variant_of

from mpm_ref.needs.ingredients import Half
from mpm_ref.scene import build

DISK = """
dim = 2
dx = 0.05
dt = 0.001
end = 0.05
gravity = [0.0, -9.8]
walls = { low = [2, 2], high = [18, "open"] }
clip = { lower = [0.1, 0.0], upper = [0.9, 1.0] }

[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.3], radius = 0.2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }

[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }
motion = { translation = { type = "steady", rate = [0.0, 0.1] } }
"""
PAIR = """
dim = 2
dx = 0.05
dt = 0.001
end = 0.05
""" + "".join(f"""
[[body]]
name = "{name}"
density = 1000.0
shape = {{ type = "box", lower = [{low}, 0.1], upper = [{low + 0.2}, 0.3] }}
velocity = {{ linear = [{v}, 0.0] }}
material = {{ law = "fixed_corotated", E = 1e5, nu = 0.3 }}
""" for name, low, v in (("left", 0.1, 0.1), ("right", 0.7, -0.1))) + """
[[fixed]]
region = { type = "box", lower = [0.0, 0.0], upper = [0.12, 1.0] }

[[fixed]]
region = { type = "box", lower = [0.88, 0.0], upper = [1.0, 1.0] }
"""
HALF_X = "half x < 0.5 m (symmetry wall instead)"


def halves(text):
    """The labels of the symmetric halves that a scene offers."""
    return [label for label in variant_of(text).offers if label.startswith("half")]


def test_half_of_a_disk():
    variant = variant_of(DISK)
    left = variant.without(variant.offers[HALF_X])
    body, = build(left.scene).bodies
    total, = build(variant.scene).bodies
    assert body.particles.x[:, 0].min() > 0.5
    assert len(body.id) == len(total.id) // 2
    assert body.particles.m.sum() == pytest.approx(total.particles.m.sum() / 2, rel=1e-3)
    wall = left.scene.collider[-1]
    assert (wall.kind, wall.shape.point, wall.shape.normal) == ("slip", (0.5, 0.0), (1.0, 0.0))
    assert left.halves == (Half(0, 0.5, ("disk", "floor", "wall y-", "wall y+")),)
    assert left.probes[0][1][:, 0].min() > 0.5
    assert not any(label.startswith(("half", "collider mirror")) for label in left.offers)


def test_half_of_a_box_is_a_box():
    variant = variant_of(PAIR.split("[[fixed]]")[0])
    half_y = next(label for label in variant.offers if label.startswith("half y"))
    shapes = [body.shape for body in variant.without(variant.offers[half_y]).scene.body]
    assert [shape.lower for shape in shapes] == [(0.1, 0.2), (0.7, 0.2)]


def test_pair_of_bodies_and_regions():
    variant = variant_of(PAIR)
    left = variant.without(variant.offers[HALF_X])
    assert [body.name for body in left.scene.body] == ["right"]
    assert [name for name, _ in left.probes] == ["right"]


@pytest.mark.parametrize(("old", "new"), [
    ("gravity = [0.0, -9.8]", "gravity = [0.1, -9.8]"),
    ("lower = [0.1, 0.0]", "lower = [0.0, 0.0]"),
    ("high = [18,", "high = [17,"),
    ("high = [18,", 'high = ["open",'),
    ("normal = [0.0, 1.0]", "normal = [0.01, 1.0]"),
    ("rate = [0.0, 0.1]", "rate = [0.1, 0.0]"),
    ("radius = 0.2 }", "radius = 0.2 }\nvelocity = { linear = [0.1, 0.0] }"),
    ("radius = 0.2 }", "radius = 0.2 }\nvelocity = { angular = 1.0 }"),
    ("radius = 0.2 }", 'radius = 0.2 }\nsampling = { type = "poisson", count = 50 }'),
])
def test_broken_symmetry_is_noticed(old, new):
    assert old in DISK
    assert halves(DISK) == [HALF_X]
    assert halves(DISK.replace(old, new)) == []


@pytest.mark.parametrize(("old", "new"), [
    ("linear = [-0.1, 0.0]", "linear = [0.1, 0.0]"),
    ("lower = [0.88, 0.0]", "lower = [0.87, 0.0]"),
    ('nu = 0.3 }\n\n[[fixed]]', 'nu = 0.2 }\n\n[[fixed]]'),
])
def test_unequal_pair_is_noticed(old, new):
    assert old in PAIR
    assert HALF_X in halves(PAIR)
    assert HALF_X not in halves(PAIR.replace(old, new))


def test_a_body_in_contact_with_its_image_is_not_replaced_by_a_wall():
    """It may leave the image, but not a wall that slips."""
    assert HALF_X in halves(PAIR)
    assert HALF_X not in halves(PAIR + '\n[[contact]]\nbodies = ["left", "right"]\n')


def test_velocity_in_the_plane_is_symmetric():
    text = DISK.replace("radius = 0.2 }", "radius = 0.2 }\nvelocity = { linear = [0.0, -1.0] }")
    assert halves(text) == [HALF_X]
    assert np.isclose(build(variant_of(text).scene).bodies[0].particles.v[0, 1], -1.0)


def test_random_particles_are_not_symmetric():
    text = "\n".join(line for line in DISK.splitlines() if not line.startswith(("walls", "clip")))
    assert halves(text) == [HALF_X]
    sampling = 'sampling = { type = "jittered", amplitude = 0.1 }'
    assert halves(text.replace("radius = 0.2 }", f"radius = 0.2 }}\n{sampling}")) == []
