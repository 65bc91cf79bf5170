"""NCLaw's tasks: scenes with the settings of the authors' release, velocities as it draws them."""

from hashlib import sha256

import numpy as np
import pytest

from mpm_ref.problem import Clock
from mpm_ref.scene import Mesh, Poisson, build
from mpm_ref.shapes.inside import solid
from validation.common import user_meshes
from validation.common.scenes import with_
from validation.nclaw import gallery, stand_in_bodies, tasks
from validation.nclaw.environments import ENVIRONMENTS

DRAWN = {       # by the release's own code
    1: ((0.05859466755, -2.23275321281, -1.76374650039),
        (0.93549435603, 1.26997934692, 2.48310778146)),
    7: ((0.16922732571, -0.53734504612, 0.37294358750),
        (0.90049885473, 2.62066033619, 0.01579591370)),
    8: ((-0.74701461468, -2.10372601701, -0.78268181818),
        (2.60968953509, 1.17325441958, 1.31364561937)),
}
VOLUMES = {     # of the release's meshes: points times volume of each [m^3]
    "armadillo": 34468 * 6.820e-7, "bunny": 33450 * 2.036e-6, "blub": 31780 * 7.432e-7,
    "spot": 31580 * 2.284e-6,
}


@pytest.mark.parametrize("seed", tasks.SEEDS)
def test_velocities_are_those_of_the_release(seed):
    v = tasks.thrown(seed)
    linear, angular = DRAWN[seed]
    assert v.linear == pytest.approx(linear, abs=1e-10)
    assert v.angular == pytest.approx(angular, abs=1e-10)
    assert v.center == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_tasks_change_what_they_say_and_nothing_else(name):
    first, = tasks.scenes("reconstruction", name)
    longer, = tasks.scenes("time", name)
    assert longer.steps == (5000 if name == "water" else 2000)
    assert with_(longer, steps=first.steps) == first
    for scene, seed in zip(tasks.scenes("velocity", name), (1, 7, 8), strict=True):
        body, = scene.body
        assert body.velocity == tasks.thrown(seed)
        assert with_(scene, body=(with_(body, velocity=first.body[0].velocity),)) == first
    assert (first.steps, first.every, first.dt) == (1000, 5, 5e-4)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_other_bodies_fall_on_a_finer_grid(name):
    scene, = tasks.scenes("geometry", name)
    body, = scene.body
    assert (scene.dx, scene.steps, scene.scheme.mass_eps) == (1 / 32, 2000, 0.0)
    assert (scene.walls.low, scene.walls.high) == ((3, 3, 3), (29, 29, 29))
    assert scene.clip.lower == 3 * ((1 if name == "jelly" else 3) / 32,)
    assert scene.clip.upper == pytest.approx(1.0 - np.array(scene.clip.lower))
    assert body.velocity.linear == (1.0, -1.5, -1.5)
    assert body.velocity.angular == (1.0, 1.0, 1.0)
    assert body.material == tasks.reconstruction(name).body[0].material
    assert body.sampling == Poisson(count=tasks.TOYS[name].points)


@pytest.mark.parametrize("toy", tasks.TOYS.values(), ids=lambda toy: toy.name)
def test_stand_ins_are_as_long_and_as_large_as_the_meshes(toy):
    body = solid(stand_in_bodies.toy(toy.name, toy.size))
    size = body.high - body.low
    assert size.max() == pytest.approx(toy.size, rel=0.09)
    assert 0.5 * (body.high + body.low) == pytest.approx(3 * [0.5], abs=0.06)
    assert body.volume == pytest.approx(VOLUMES[toy.name], rel=0.06)


def test_a_mesh_of_the_users_is_taken_instead(tmp_path, monkeypatch):
    monkeypatch.setenv(user_meshes.VARIABLE, str(tmp_path))
    assert stand_in_bodies.body_label("bunny") == "a stand-in for bunny"
    file = tmp_path / "nclaw" / "bunny.obj"
    file.parent.mkdir()
    file.write_text("v 0 0 0")
    with pytest.raises(ValueError, match=r"bunny\.obj: another file .* its sha256 is [0-9a-f]{64}, "
                                         r"expected b83f4af5[0-9a-f]{56}; take"):
        stand_in_bodies.toy("bunny", 0.7)
    monkeypatch.setitem(stand_in_bodies.SHA256, "bunny", sha256(b"v 0 0 0").hexdigest())
    assert stand_in_bodies.toy("bunny", 0.7) == Mesh(file=str(file), size=0.7,
                                                     center=(0.5, 0.5, 0.5))
    assert stand_in_bodies.body_label("bunny") == "bunny"
    assert not isinstance(stand_in_bodies.toy("spot", 0.7), Mesh)


@pytest.mark.parametrize("scene", [tasks.slope(), gallery.large(), gallery.contact(),
                                   gallery.pool(), gallery.dessert()],
                         ids=["slope", "large", "contact", "pool", "dessert"])
def test_bodies_that_are_only_looked_at_are_within_the_box(scene):
    """But for the dessert, whose box in the release ends a millimetre or two below the clip."""
    below = 0.003 if scene.body[0].name == "icecream" else 0.0
    low, high = np.array(scene.clip.lower) - below, scene.clip.upper
    for body in scene.body:
        found = solid(body.shape)
        assert (found.low >= low).all()
        assert (found.high <= high).all()


def test_the_slope_pulls_down_and_along():
    scene = tasks.slope()
    assert scene.gravity == (0.0, -1.0, 0.866)
    assert (scene.dx, scene.steps, scene.body[0].density) == (1 / 128, 1500, 5000.0)
    assert not scene.body[0].velocity.moves


def test_the_pool_holds_as_many_points_as_printed():
    problem = build(gallery.pool())
    duck, water = problem.bodies
    assert len(duck.particles.x) + len(water.particles.x) == 102_294
    assert water.particles.m[0] / water.particles.V0[0] == pytest.approx(3000.0)
    assert problem.clock == Clock(dt=5e-4, steps=3000, every=5)


def test_the_dessert_is_as_large_as_its_meshes_and_the_chocolate_denser():
    icecream, chocolate = gallery.dessert().body
    volumes = [solid(stand_in_bodies.toy(body.name, 1.0)).volume for body in (icecream, chocolate)]
    assert volumes == pytest.approx([0.1845, 0.0254], rel=0.06)     # of the meshes
    assert (icecream.density, chocolate.density) == (1000.0, 2000.0)
    counts = [body.sampling.count for body in (icecream, chocolate)]
    bunny = tasks.TOYS["plasticine"].points / 0.19857       # points over the mesh's volume
    assert counts == pytest.approx([bunny * 0.1845, bunny * 0.0254], rel=0.01)


def test_a_halved_scene_has_its_walls_and_clip_where_they_were():
    whole = gallery.pool()
    half = gallery.halved(whole)
    assert half.dx == 2.0 * whole.dx
    assert half.clip == whole.clip
    for k in (0, 1, 2):     # the last node of the lower wall, the first of the upper one
        assert (half.walls.low[k] - 1) * half.dx == (whole.walls.low[k] - 1) * whole.dx
        assert (half.walls.high[k] + 1) * half.dx == (whole.walls.high[k] + 1) * whole.dx
    duck, water = half.body
    assert (duck.sampling.count, water.sampling.counts) == (1011, (32, 12, 32))
    assert gallery.halved(gallery.large(0.01)).body[0].sampling.spacing == 0.02


def test_toys_run_to_the_middle():
    for body in gallery.contact().body:
        middle = np.array((0.5, 0.4, 0.5)) - np.mean(
            [solid(body.shape).low, solid(body.shape).high], axis=0)
        v = np.array(body.velocity.linear)
        assert v[0] * middle[0] > 0.0
        assert v[2] * middle[2] > 0.0
        assert abs(v[[0, 2]]) == pytest.approx([2.0, 2.0])
