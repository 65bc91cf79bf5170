"""Solids that a change of the speed carries into each other, and those that are so as given."""

import numpy as np
import pytest

from mpm_ref.limits import cell
from mpm_ref.limits.cell import CellScenes, cell_of
from mpm_ref.limits.crossing import crossing_solids
from mpm_ref.limits.verdict import CellJudge
from mpm_ref.scene import build, loads
from mpm_ref.sweep.observation import REFUSED
from mpm_ref.sweep.probes import choose_probes

PRESS = """
dim = 2
dx = 0.05
end = 0.1
[[body]]
name = "block"
density = 1000.0
shape = {{ type = "box", lower = [0.2, 0.0], upper = [0.6, 0.4] }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "hencky", E = 1e5, nu = 0.3 }}
[[collider]]
name = "floor"
shape = {{ type = "half_space", point = [0.0, 0.0], normal = [0.0, 1.0] }}
[[collider]]
name = "punch"
shape = {{ type = {shape} }}
motion = {{ translation = {{ type = "steady", rate = [1.0, 0.0] }} }}
[[collider]]
name = "stop"
shape = {{ type = "half_space", point = [0.8, 0.0], normal = [-1.0, 0.0] }}
"""
BOX = '"box", lower = [0.0, -0.2], upper = [0.1, 0.3]'
SHAPES = (BOX, '"sphere", center = [0.0, 0.2], radius = 0.1',
          '"half_space", point = [0.1, 0.0], normal = [1.0, 0.0]',
          '"wedge", tip = [0.1, 0.2], direction = [-1.0, 0.0], half_angle = 20.0, length = 0.2')
MEET = ("collider[1] 'punch'", "collider[2] 'stop'")


def scenes_of(text):
    scene = loads(text)
    return CellScenes(scene, tuple((p.body, p.X) for p in choose_probes(build(scene).bodies)))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_punch_meets_the_stop_where_its_way_is_long_enough(shape):
    """It is 0.7 m away, and moves 0.1 m as given."""
    scenes = scenes_of(PRESS.format(shape=shape))
    for factor in (0.1, 5.0, 6.9, 7.4):
        assert not scenes.refusal(cell_of({"speed": factor}))
    for factor in (7.6 if "sphere" not in shape else 9.0, 20.0):
        message = scenes.refusal(cell_of({"speed": factor}))
        assert message == ("collider[1] 'punch' and collider[2] 'stop' move into each other, which "
                           "they do not in the scene as given")


def test_solids_that_are_in_each_other_as_given_are_no_refusal():
    scenes = scenes_of(PRESS.format(shape=BOX))
    box = np.array([-0.2, -0.4]), np.array([1.0, 0.8])
    pairs = crossing_solids(scenes.scene(cell_of({"speed": 20.0})), box)
    assert pairs == {MEET, ("collider[0] 'floor'", "collider[1] 'punch'")}
    assert crossing_solids(scenes.scene(()), box) == pairs - {MEET}


def test_only_scenes_with_another_speed_are_looked_at(monkeypatch):
    scenes = scenes_of(PRESS.format(shape=BOX))
    monkeypatch.setattr(cell, "crossing_solids", lambda *_: pytest.fail("not needed"))
    assert not scenes.refusal(cell_of({"size": 10.0, "density": 10.0}))


STOP = '"half_space", point = [0.8, 0.0], normal = [-1.0, 0.0]'


def test_a_small_solid_is_found_by_its_own_points():
    """It lies between the points of a half space that moves into it."""
    text = PRESS.format(shape=SHAPES[2]).replace(STOP, '"sphere", center = [0.81, 0.11], '
                                                       'radius = 0.04')
    assert "'punch' and collider[2] 'stop'" in scenes_of(text).refusal(cell_of({"speed": 15.0}))


def test_the_corner_of_the_box_around_a_sphere_is_no_solid():
    text = PRESS.format(shape='"sphere", center = [0.0, 0.2], radius = 0.2').replace(
        STOP, '"box", lower = [0.8, 0.33], upper = [1.6, 1.0]')
    scenes = scenes_of(text)
    assert not scenes.refusal(cell_of({"speed": 7.0}))
    assert scenes.refusal(cell_of({"speed": 9.0}))


def test_the_room_in_a_container_is_no_solid():
    text = PRESS.format(shape='"box", lower = [-0.4, -0.4], upper = [1.2, 1.2]')
    text = text.replace('name = "punch"', 'name = "punch"\ninside = true')
    text = text.replace(STOP, '"sphere", center = [0.8, 0.2], radius = 0.1')
    box = np.array([-0.2, -0.4]), np.array([1.0, 0.8])
    assert MEET not in crossing_solids(loads(text), box)
    assert MEET in crossing_solids(loads(text.replace("rate = [1.0", "rate = [-9.0")), box)


def test_still_solids_do_not_cross():
    text = PRESS.format(shape='"box", lower = [0.7, 0.0], upper = [0.9, 0.3]')
    text = text.replace("rate = [1.0, 0.0]", "rate = [0.0, 0.0]")
    scenes = scenes_of(text.replace('type = "steady"', 'type = "steady", stop = 0.0'))
    assert not scenes.refusal(cell_of({"speed": 20.0}))


def test_a_container_that_a_collider_leaves_is_crossed():
    text = PRESS.format(shape=BOX).replace(
        STOP,
        '"box", lower = [-0.5, -0.5], upper = [0.8, 0.8] }\ninside = true\nmotion = {')
    message = scenes_of(text).refusal(cell_of({"speed": 9.0}))
    assert "'stop' move into each other" in message


def test_a_cell_with_crossing_solids_is_refused_without_a_run():
    scene = loads(PRESS.format(shape=BOX))
    judge = CellJudge(scene, Runs(), tuple((p.body, p.X) for p in choose_probes(
        build(scene).bodies)), ("positions",), 0.05)
    fast, both = cell_of({"speed": 20.0}), cell_of({"speed": 20.0, "density": 2.0})
    assert judge.judge([fast])[fast].outcome == REFUSED
    assert judge.judge([fast], by_fine_grids=True)[fast].outcome == REFUSED
    assert judge.refused_alone(both).alone == "speed"


class Runs:
    """No run is made."""

    def observe(self, requests):
        assert not requests
        return {}
