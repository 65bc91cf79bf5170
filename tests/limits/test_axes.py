"""Each axis changes what it claims, and nothing else."""

from math import atan, degrees, radians, tan

import numpy as np
import pytest

from mpm_ref.limits.axes import (
    AXES,
    AXIS,
    DOWN,
    SHORTER,
    UP,
    applicable,
    is_discrete,
    rungs,
    searched_rungs,
)
from mpm_ref.limits.cell import CellScenes, cell_of, cell_text, physical
from mpm_ref.scene import SceneError, build, canonical, loads
from mpm_ref.sweep.probes import choose_probes

SAND = """
dim = 2
dx = 0.1
cfl = 0.4
longest = 0.01
end = 0.5
gravity = [0.0, -10.0]
[[body]]
name = "sand"
density = 1600.0
shape = { type = "box", lower = [1.0, 1.0], upper = [1.8, 1.4] }
sampling = { type = "regular", per_cell = 3 }
velocity = { linear = [2.0, 0.0], angular = 3.0, center = [1.0, 1.0] }
[body.material]
law = "hencky"
E = 1e6
nu = 0.3
flow = { type = "drucker_prager", friction_angle = 30.0 }
[[body]]
name = "metal"
density = 2000.0
shape = { type = "sphere", center = [3.0, 1.0], radius = 0.3 }
sampling = { type = "poisson", radius = 0.05 }
material = { law = "hencky", E = 3e6, nu = 0.2, flow = { type = "von_mises", sigma_y = 1e4 } }
[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.5], normal = [0.0, 1.0] }
[[collider]]
name = "wheel"
shape = { type = "capsule", start = [2.0, 3.0], end = [2.5, 3.0], radius = 0.2 }
[collider.motion]
center = [2.0, 3.0]
translation = { type = "steady", rate = [0.5, 0.0] }
rotation = { type = "oscillation", amplitude = 0.4, frequency = 2.0 }
[walls]
low = [3, "open"]
"""


def scenes_of(text):
    scene = loads(text)
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies))
    return CellScenes(scene, probes)


@pytest.fixture(scope="module")
def sand():
    return scenes_of(SAND)


def leaves(value, path=""):
    """{path: value} of the numbers and texts in plain tables."""
    if isinstance(value, dict):
        parts = [leaves(item, f"{path}.{key}") for key, item in value.items()]
    elif isinstance(value, list | tuple):
        parts = [leaves(item, f"{path}[{k}]") for k, item in enumerate(value)]
    else:
        return {path: value}
    return {name: leaf for part in parts for name, leaf in part.items()}


def ratios(scenes, factors):
    """{path: value after over value before} of the numbers that a cell changes."""
    before = leaves(scenes.tables())
    after = leaves(scenes.tables(cell_of(factors)))
    assert before.keys() == after.keys()
    return {path.lstrip("."): after[path] / value for path, value in before.items()
            if after[path] != value}


@pytest.mark.parametrize(("name", "paths"), [
    ("stiffness", {"body[0].material.E", "body[1].material.E"}),
    ("density", {"body[0].density", "body[1].density"}),
    ("gravity", {"gravity[1]"}),
    ("yield", {"body[1].material.flow.sigma_y"}),
    ("time_step", {"cfl", "longest"}),
    ("speed", {"body[0].velocity.linear[0]", "body[0].velocity.angular",
               "collider[1].motion.translation.rate[0]", "collider[1].motion.rotation.amplitude"}),
])
def test_axis_multiplies_its_keys_alone(sand, name, paths):
    assert ratios(sand, {name: 1.7}) == {path: pytest.approx(1.7) for path in paths}


def test_friction_of_colliders_walls_and_contacts_is_an_axis():
    tables = {"body": [], "fixed": [], "collider": [{"friction": 0.2}, {"friction": 0.0}, {}],
              "walls": {"friction": 0.5}, "contact": [{"friction": 0.1}]}
    assert AXIS["friction"].reading(tables) == "friction = 0.2"
    AXIS["friction"].change(tables, 2.0, 1.0)
    assert tables["collider"] == [{"friction": 0.4}, {"friction": 0.0}, {}]
    assert tables["walls"] == {"friction": 1.0}
    assert tables["contact"] == [{"friction": 0.2}]


def test_size_multiplies_lengths_alone(sand):
    changed = ratios(sand, {"size": 1.7})
    assert all(ratio == pytest.approx(1.7) for ratio in changed.values())
    assert {"dx", "body[0].shape.lower[0]", "body[0].velocity.center[0]", "body[1].shape.radius",
            "body[1].sampling.radius", "collider[0].shape.point[1]", "collider[1].shape.end[1]",
            "collider[1].motion.center[0]",
            "collider[1].motion.translation.rate[0]"} <= set(changed)
    assert not {path for path in changed if "linear" in path or "rotation" in path
                or path.startswith(("gravity", "end", "cfl", "walls"))}


def test_poisson_scales_the_distance_from_one_half(sand):
    tables = sand.tables(cell_of({"poisson": 0.1}))
    assert [body["material"]["nu"] for body in tables["body"]] == pytest.approx([0.48, 0.47])


@pytest.mark.parametrize(("nu", "text"), [
    (0.3, "nu = 0.3"), (-0.98, "nu = -0.98"), (0.49981234, "nu = 0.499812"),
    (0.49999995, "nu = 0.49999995"), (0.0, "nu = 0")])
def test_poissons_ratio_is_shown_with_its_distance_from_one_half(nu, text):
    tables = {"body": [{"material": {"lam": 1.0}}, {"material": {"nu": nu}}]}
    assert AXIS["poisson"].reading(tables) == text


@pytest.mark.parametrize(("nus", "factors"), [
    ((0.4,), (10.0, 14.0)), ((0.3,), (7.0,)), ((0.3, -0.2), (2.0,)), ((-0.95,), ()),
    ((0.4995,), (10.0, 100.0, 1000.0))])
def test_poissons_ratio_stays_above_the_least_of_a_scene(nus, factors):
    tables = {"body": [{"material": {}}, *({"material": {"nu": nu}} for nu in nus)]}
    found = searched_rungs(AXIS["poisson"], tables, UP)
    assert found == pytest.approx(factors)
    assert searched_rungs(AXIS["poisson"], tables, DOWN) == rungs(AXIS["poisson"], tables, DOWN)


def test_friction_scales_the_tangent(sand):
    flow = sand.tables(cell_of({"friction": 3.0}))["body"][0]["material"]["flow"]
    assert flow["friction_angle"] == pytest.approx(degrees(atan(3.0 * tan(radians(30.0)))))


def test_particles_are_whole_numbers_per_cell(sand):
    factors = rungs(AXIS["particles"], sand.tables(), DOWN)
    numbers = [sand.tables(cell_of({"particles": f}))["body"][0]["sampling"]["per_cell"]
               for f in factors]
    assert numbers == [2, 1]
    up = rungs(AXIS["particles"], sand.tables(), UP)
    assert list(up) == [4 / 3, 5 / 3, 2.0, 3.0, 4.0]
    assert is_discrete(AXIS["particles"], UP)


def test_origin_shifts_everything_by_whole_cells(sand):
    before, after = sand.tables(), sand.tables(cell_of({"origin": 11.0}))
    n = round(10.0 * sand.size / 0.1)
    a, b = leaves(before), leaves(after)
    shifted = {path.lstrip("."): b[path] - a[path] for path in a if a[path] != b[path]}
    assert shifted.pop("walls.low[0]") == n
    assert set(np.round(list(shifted.values()), 9)) == {round(0.1 * n, 9)}
    assert {path.partition("[")[0] for path in shifted} == {"body", "collider"}
    assert "collider[0].shape.normal[1]" not in shifted


def test_the_interval_of_frames_which_bounds_the_step_is_scaled():
    scenes = scenes_of(SAND.replace("longest = 0.01", "longest = 0.01\ninterval = 0.002"))
    tables = scenes.tables(cell_of({"time_step": 4.0}))
    assert (tables["longest"], tables["interval"]) == (0.04, 0.008)


def test_fixed_step_is_scaled_and_frames_follow():
    scenes = scenes_of(SAND.replace("cfl = 0.4\nlongest = 0.01", "dt = 0.001\ninterval = 0.002"))
    tables = scenes.tables(cell_of({"time_step": 4.0}))
    assert (tables["dt"], tables["interval"]) == (0.004, 0.004)
    assert scenes.tables(cell_of({"time_step": 0.5}))["interval"] == 0.002


def test_probes_follow_size_and_place(sand):
    (name, X), _ = sand.probes(())
    (_, Y), _ = sand.probes(cell_of({"size": 2.0, "origin": 3.0}))
    shift = 0.1 * round(2.0 * sand.size / 0.1)
    assert name == "sand"
    assert np.allclose(Y, 2.0 * (X + shift))
    built = build(sand.scene(cell_of({"size": 2.0, "origin": 3.0}))).bodies[0]
    assert np.allclose(built.particles.x.min(axis=0), 2.0 * (np.array([1.0, 1.0]) + shift),
                       atol=0.1)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_every_axis_gives_a_scene_that_builds(sand, axis):
    assert axis.reading(sand.tables())
    for direction in (DOWN, UP):
        factors = rungs(axis, sand.tables(), direction)
        if factors and not (axis.name == "time_step" and direction == UP):
            scene = sand.scene(cell_of({axis.name: factors[0]}))
            if axis.name == "poisson" and direction == UP:
                assert isinstance(scene, SceneError)        # nu below -1
            else:
                assert canonical(scene) != canonical(sand.scene(()))
                assert canonical(sand.scene(cell_of({axis.name: factors[0]}), dx=2.0))


def test_axes_that_do_not_apply_say_why():
    plain = SAND[:SAND.index("[[body]]\nname = \"metal\"")].replace("gravity = [0.0, -10.0]", "")
    plain = plain.replace("velocity =", "#").replace("flow =", "#")
    tables = scenes_of(plain).tables()
    axes, reasons = applicable(tables, ("path:1.0,1.0@end",))
    assert [axis.name for axis in axes] == ["time_step", "stiffness", "poisson", "density",
                                            "particles"]
    assert set(reasons) == {"speed", "gravity", "friction", "yield", "origin", "size"}
    assert all(reasons.values())
    assert "path:1.0,1.0@end" in reasons["size"]


def test_cells_have_one_key_and_know_their_physical_problem():
    cell = cell_of({"size": 2.0, "time_step": 0.5, "density": 1.0})
    assert cell == cell_of({"time_step": 0.5, "size": 2.0})
    assert cell_text(cell) == "time_step x 0.5, size x 2"
    assert physical(cell) == (("size", 2.0),)
    assert physical(cell_of({"origin": 1e3, "particles": 2.0})) == ()
    assert rungs(AXIS["time_step"], {}, DOWN) == SHORTER
