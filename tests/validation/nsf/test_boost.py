"""A map at more points than it was trained at, beside the full-order run of these (Figure 6)."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.nsf import fig06
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nsf import super_resolution
from validation.nsf.studies import jelly

mpl.use("Agg")


def stretched(X, xhat):
    """The body, stretched along x by 1 + xhat."""
    return X * np.array([1.0 + xhat[0], 1.0, 1.0])


@pytest.fixture
def recorded(rng, tmp_path):
    """{target: value} of a map, of bodies that are stretched by 0.1, 0.2 and 0.3; and results."""
    xhat = [np.array([0.1 * k]) for k in range(4)]
    few, many = (SimpleNamespace(X=X, x=np.array([[stretched(X, y) for y in xhat]]))
                 for X in (rng.uniform(1.0, 2.0, (50, 3)), rng.uniform(1.0, 2.0, (200, 3))))

    def of(place):
        found = {}
        run = SimpleNamespace(profile="quick", folder=tmp_path,
                              experiment=SimpleNamespace(id="nsf.fig6"),
                              record=lambda id, value, **rule: found.update({id[9:]: value}))
        super_resolution.record_resolutions(run, SimpleNamespace(place=place), few, many, xhat)
        return found

    return of


def test_a_map_that_is_right_everywhere_has_no_error(recorded):
    found = recorded(stretched)
    assert [found["few"], found["many"]] == pytest.approx([0.0, 0.0])
    assert found["nearest"] > 1.0


def test_errors_are_of_the_displacement_at_all_times(recorded):
    found = recorded(lambda X, xhat: stretched(X, 1.5 * xhat))
    assert [found["few"], found["many"]] == pytest.approx([50.0, 50.0])


def test_the_grid_stays_and_points_are_more():
    scene = jelly(4).run(0.45)
    more = super_resolution.finer(scene, 8)
    assert more.dx == scene.dx
    assert [body.sampling.count for body in more.body] == [
        8 * body.sampling.count for body in scene.body]
    assert super_resolution.states(scene).x.shape[1] == 1 + super_resolution.SHOTS


def test_a_figure_of_three_rows(recorded, tmp_path):
    recorded(stretched)
    axes = fig06.draw(SimpleNamespace(folder=tmp_path)).axes
    assert [ax.texts[0].get_text() for ax in axes[::3]] == [
        "points of\nthe training", "networks,\nmore points", "full order,\nmore points"]


def test_without_weights_it_says_how_they_are_made(tmp_path, monkeypatch):
    def missing(name):
        raise Untrained(f"no weights {name}.npz")

    monkeypatch.setattr(super_resolution, "trained", missing)
    assert run_all([super_resolution.boost.experiment], RunSetting("quick", tmp_path)) == []
    assert {r.target for r in ProfileResults(tmp_path).records("nsf.fig6")} == {
        "nsf.fig6", "nsf.fig6.untrained"}
