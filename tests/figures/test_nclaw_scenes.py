"""NCLaw's slope, what is kept of it and drawn; and the dough."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.common.bodies import no_balls
from figures.nclaw import fig02d, fig04c
from mpm_ref.materials import Fluid, NoFlow
from validation.common.record import Measurement, write_records
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.ldm.published_bodies import keep
from validation.nclaw import other_bodies
from validation.nclaw.environments import ENVIRONMENTS, environment
from validation.nclaw.evaluate import body_with_laws
from validation.nclaw.tasks import reconstruction

pytestmark = pytest.mark.slow

mpl.use("Agg")


def kept(folder, id, **arrays):
    """Results that hold points of an experiment."""
    keep(SimpleNamespace(folder=folder, experiment=SimpleNamespace(id=id)), **arrays)
    write_records(folder / f"{id}.json", [Measurement(
        target=id, value=0.0, unit="1", scale="", seconds=0.0, seed=0, command="", commit="",
        date="", cores=1)])
    return ProfileResults(folder)


def titles(figure):
    return [ax.get_title() for ax in figure.axes if ax.images]


# The slope.

def test_the_slope_is_one_for_all_materials():
    for name in ENVIRONMENTS:
        scene = other_bodies.slope_of(name)
        assert scene.body[0].material == environment(name).body[0].material
        assert scene.body[0].density == 5000.0
        assert scene.gravity == (0.0, -1.0, 0.866)


def test_the_slope_is_run_with_true_laws_ours_and_admissible_ones(tmp_path, monkeypatch):
    """At quick water alone, in few points for a short time."""
    monkeypatch.setattr(other_bodies, "slope", lambda: reconstruction("water"))
    monkeypatch.setattr(other_bodies, "FEW", 60)
    monkeypatch.setattr(other_bodies, "SHORT", 20)
    monkeypatch.setattr(other_bodies, "trained", lambda name: name)
    monkeypatch.setattr(other_bodies, "body_maker", lambda name: other_bodies.copy_body
                        if name == "water-admissible"
                        else lambda body: body_with_laws(body, Fluid(0.0), NoFlow()))
    assert run_all([other_bodies.inclined.experiment], RunSetting("quick", tmp_path)) == []
    results = ProfileResults(tmp_path)
    found = {r.target: r for r in results.records("nclaw.slope")}
    assert not [target for target in found if "jelly" in target]
    assert found["nclaw.slope.water.admissible"].value == 0.0
    assert 0.0 < found["nclaw.slope.water.ours"].value < 1.0
    assert found["nclaw.slope.water.ours"].scale.startswith("60 particles, 20 steps, ")
    assert "a stand-in for dragon30" in found["nclaw.slope.water.ours"].scale
    assert titles(fig02d.draw(results)) == ["start", "ours", "admissible", "truth"]


def test_gravity_points_down_in_the_picture():
    g = np.array([[0.0, -1.0, 0.866]])
    balls = no_balls()._replace(x=g, n=np.array([[0.0, 1.0, 0.0]]))
    turned = fig02d.turned(balls)
    assert turned.x == pytest.approx(np.array([[0.0, -np.linalg.norm(g), 0.0]]), abs=1e-12)
    assert turned.n @ turned.x[0] == pytest.approx(-1.0)     # as far as along the floor's own


def test_the_floor_is_under_the_bodies(tmp_path):
    x = np.random.default_rng(0).uniform((0.4, 0.03, 0.2), (0.6, 0.1, 0.7), (2, 40, 3))
    results = kept(tmp_path, "nclaw.slope", water_true=x, water_ours=x, water_admissible=x)
    panels = fig02d.comparison_rows({"water_true": x, "water_ours": x}, {"water": "water"})
    balls = fig02d.floor_of(panels)
    floor = balls.x
    assert floor[:, 1] + balls.radius == pytest.approx(3.0 / 128.0)
    for axis in (0, 2):
        assert floor[:, axis].min() <= x[..., axis].min()
        assert floor[:, axis].max() >= x[..., axis].max()
    assert len(titles(fig02d.draw(results))) == 4


# The dough.

def test_the_dough_is_drawn_half_way_and_at_the_end(tmp_path):
    """A law of which nothing is kept has no column, one that broke down no picture."""
    x = np.random.default_rng(0).random((3, 30, 3))
    gone = np.full_like(x, np.nan)
    results = kept(tmp_path, "nclaw.dough", block_true=x, star_true=x, block_dough=x, star_dough=x,
                   block_guess=gone, star_guess=x)
    figure = fig04c.draw(results)
    assert titles(figure) == ["start", "truth", "ours", "guess", *12 * [""]]
    texts = [text.get_text() for ax in figure.axes for text in ax.texts if text.get_text()]
    assert texts == ["(c) block\nt = 0.021 s", "broke down", "(c) block\nt = 0.042 s", "broke down",
                     "(d) star\nt = 0.021 s", "(d) star\nt = 0.042 s"]


def test_colours_are_distances_from_the_truth_at_that_time():
    x = np.random.default_rng(0).random((3, 30, 3))
    far = x + 1e-3 * fig04c.TOP * np.arange(3)[:, None, None]
    at = {"block_true": x, "block_dough": far}
    same, end = (fig04c.body_panel(at, ("block", word, 2), "").solid.colour
                 for word in ("true", "dough"))
    assert end[0] == pytest.approx(mpl.colormaps["viridis"](1.0)[:3])
    assert same[0] == pytest.approx(mpl.colormaps["viridis"](0.0)[:3])
