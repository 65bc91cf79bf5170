"""The scenes of NSF: particles as printed, bodies that stand well, one key for what differs."""

import numpy as np
import pytest

from mpm_ref.preflight import misplaced
from mpm_ref.scene import build, digest
from mpm_ref.scene.overrides import with_values
from validation.common.scenes import SCENES, catalogue_scene, with_

VARIED = {      # scene: the key that sets the parameter of its experiment, and the parameter's ends
    "bread": ("body.bread.material.E", (1.0, 13.0)),
    "cake": ("collider.blade.motion.angle", (0.0, 30.0)),
    "toothpaste": ("collider.brush.motion.angle", (0.0, 15.0)),
    "jelly": ("body.cube.velocity.linear[0]", (0.3, 0.5)),
    "ball": ("collider.plane.motion.angle", (0.0, 40.0)),
}


def test_sand_has_72000_particles_of_the_given_volume():
    sand = catalogue_scene("nsf_sand")
    body = sand.body[0]
    assert body.sampling.count == 72_000
    volume = np.prod(np.subtract(body.shape.upper, body.shape.lower))
    assert volume / 72_000 == pytest.approx(2.5e-8)
    assert sand.dx == 1.0 / 150.0


@pytest.mark.parametrize(("name", "counts"), [
    ("metal", [49_984]), ("bread", [36_000, 4_000]), ("cake", [200_000]), ("toothpaste", [45_412]),
    ("jelly", [4_000, 6_000]), ("ball", [97_944])])
def test_particles(name, counts):
    assert [len(body.id) for body in build(catalogue_scene(f"nsf_{name}")).bodies] == counts


@pytest.mark.parametrize("dx", [1 / 160, 1 / 80, 1 / 53])
def test_weak_elements_fill_the_gaps_of_the_bread(dx):
    """On a grid that they do not fit, too: no particle is there twice, and none is missing."""
    scene = catalogue_scene("nsf_bread", dx=dx)
    bread = scene.body[0]
    whole = with_(scene, body=(with_(bread, shape=bread.shape.shape),))
    parts, slab = (sorted(tuple(x) for body in build(one).bodies for x in body.particles.x)
                   for one in (scene, whole))
    assert parts == slab


@pytest.mark.parametrize("name", VARIED)
def test_one_key_sets_what_differs(name):
    """The key that the file names; bodies stand well at both ends of the range."""
    path, ends = VARIED[name]
    assert f"`{path}` alone sets" in (SCENES / f"nsf_{name}.toml").read_text()
    low, high = (with_values(catalogue_scene(f"nsf_{name}"), {path: value}) for value in ends)
    assert digest(low) != digest(high)
    assert [misplaced(build(end)) for end in (low, high)] == [[], []]
