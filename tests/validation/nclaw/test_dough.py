"""The filmed dough: camera, marks, the run, the experiment."""

import numpy as np
import pytest

from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.camera import front_layer, observe_marks, pinhole, project
from mpm_ref.scene import build, dumps, loads
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.nclaw import dough, dough_runs, trained_laws
from validation.nclaw.states import shots


@pytest.fixture(scope="module")
def truth():
    """True frames of the block."""
    return shots(dough.scene(dough.block()), copy_body).x


# The camera.

def test_a_pinhole_sees_along_its_axis():
    """x to the right, y upwards in the image, where rows go down; half as large twice as far."""
    P = pinhole((1.0, 2.0, 3.0), 1000.0, (960.0, 540.0))
    x = np.array([[1.0, 2.0, 1.0], [1.1, 2.0, 1.0], [1.1, 2.0, -1.0], [1.0, 2.1, 1.0]])
    assert project(P, x) == pytest.approx(
        np.array([[960.0, 540.0], [1010.0, 540.0], [985.0, 540.0], [960.0, 490.0]]))
    K, R = P[:, :3] @ np.diag([1.0, -1.0, -1.0]), np.diag([1.0, -1.0, -1.0])
    assert K == pytest.approx(np.array([[1e3, 0, 960], [0, 1e3, 540], [0, 0, 1]]))
    assert P @ [1.0, 2.0, 3.0, 1.0] == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.linalg.det(R) == 1.0


def test_marks_are_those_of_the_front_off_by_noise(truth):
    marks, P = dough.observe(truth), dough.camera()
    assert 45 <= len(marks.points) <= 55            # "around 50"
    layer = truth[0, marks.points, 2]
    assert (layer == layer[0]).all()
    assert layer[0] == truth[0, :, 2].max()
    assert len(front_layer(truth[0] * [1.0, 1.0, -1.0])) == len(marks.points)
    off = marks.places - project(P, truth[:, marks.points])
    assert off.std() == pytest.approx(dough.NOISE, rel=0.05)
    assert abs(off.mean()) < 0.1 * dough.NOISE
    again = observe_marks(P, truth, marks.points, dough.NOISE, np.random.default_rng(dough.SEED))
    assert np.array_equal(again.places, marks.places)


# The run.

def test_the_body_has_fallen_half_a_metre():
    scene = dough.scene(dough.block())
    v = scene.body[0].velocity.linear[1]
    assert 0.5 * v**2 / 9.8 == pytest.approx(0.5)
    assert scene.dt * dough.EVERY == pytest.approx(1.0 / 960.0)
    law = build(scene).bodies[0]
    assert law.law.mu == pytest.approx(1e4 / 2.5)
    assert law.flow.tau_y == 1e3


@pytest.mark.parametrize("shape", [dough.block, dough.star])
def test_bodies_hit_the_floor_and_not_the_other_walls(shape):
    scene = dough.scene(shape())
    x = shots(scene, copy_body).x
    wall = dough.WALL * dough.DX
    assert x[0, :, 1].min() > wall + dough.DX
    assert x[-1, :, 1].min() < wall
    assert x[..., 1].min() > scene.clip.lower[1]
    reach = (dough.WALL + 0.5) * dough.DX           # from where on points feel nodes in walls
    for axis in (0, 2):
        assert reach < x[..., axis].min()
        assert x[..., axis].max() < dough.NODES * dough.DX - reach
    assert loads(dumps(scene)) == scene


def test_the_identity_of_a_training_tells_what_it_saw(monkeypatch):
    net = dough.doughs()["dough"]
    before = dough.identity(net)
    assert dough.identity(net._replace(seed=3)) != before
    monkeypatch.setattr(dough, "NOISE", 2.0 * dough.NOISE)
    assert dough.identity(net) != before


# The experiment.

def test_the_experiment_says_how_far_laws_are_off(tmp_path, monkeypatch):
    monkeypatch.setattr(trained_laws, "FOLDER", tmp_path)
    monkeypatch.setattr(dough_runs, "scene", short)
    dough.trained.cache_clear()
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert not run_all([dough_runs.dough.experiment], setting)
    results = ProfileResults(tmp_path)
    found = {r.target: r for r in results.records("nclaw.dough")}
    noise = found["nclaw.dough.true.pixels"].value
    assert noise == pytest.approx(dough.NOISE * 2.0**0.5, rel=0.1)
    assert found["nclaw.dough.true.block"].value == found["nclaw.dough.true.star"].value == 0.0
    for name in ("guess", "init"):
        assert found[f"nclaw.dough.{name}.pixels"].value > 2.0 * noise
        assert found[f"nclaw.dough.{name}.star"].value > 1e-4
    waiting = found["nclaw.dough.untrained"]
    assert waiting.value == len(dough.doughs())
    assert "python -m validation.training.nclaw dough" in waiting.note
    assert found["nclaw.dough.depth_speed"].value > 0.0
    dough.trained.cache_clear()


def short(shape, material=None):
    """The first half of a run."""
    return with_(dough.scene(shape, material), steps=60)


def test_a_run_that_breaks_down_is_told(truth):
    both, gone = ({body: x for body in ("block", "star")} for x in (truth, truth * np.nan))
    row = dough_runs.row("wild", gone, both, dough.observe(truth))
    assert row.broken == "block and star"
    assert np.isnan([row.pixels, row.block, row.star]).all()


