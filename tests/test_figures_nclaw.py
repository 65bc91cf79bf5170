"""NCLaw's figures, and what their experiments keep for them."""

import json

import matplotlib as mpl
import numpy as np
import pytest

from figures import nclaw_fig02, nclaw_fig03, nclaw_fig06, nclaw_loss
from figures._bodies import View, pictures
from figures._pairs import sides
from mpm_ref.materials import Fluid, NoFlow
from validation.nclaw import curves, elsewhere, states, tables
from validation.nclaw.environments import ENVIRONMENTS
from validation.nclaw.evaluate import fresh
from validation.nclaw.nets import Net, Untrained
from validation.nclaw.tasks import reconstruction
from validation.nclaw.untrained import untrained
from validation.results import Results
from validation.run import Setting, run_all
from validation.verification.scenes import with_

mpl.use("Agg")


@pytest.fixture
def short(monkeypatch):
    """Runs of few steps of water for all environments, without networks."""
    def scene(name, *seed):
        return with_(reconstruction("water"), steps=10, every=5)

    for name in ("reconstruction", "time", "velocity"):
        monkeypatch.setattr(states, name, scene)
    monkeypatch.setattr(states, "SHOTS", (0, 5, 10))
    monkeypatch.setattr(states, "trained", lambda name: name)
    monkeypatch.setattr(states, "learned", lambda laws: lambda body: fresh(
        body, Fluid(1e15 if laws == "sand" else 0.0), NoFlow()))


def done(folder, experiment, profile="standard"):
    assert run_all([experiment.experiment], Setting(profile, folder)) == []
    return Results(folder)


def test_training_runs_are_drawn(tmp_path, short, monkeypatch):
    results = done(tmp_path, states.training)
    monkeypatch.setattr(nclaw_fig06, "NAMES", ("jelly", "water"))
    shown = [ax for ax in nclaw_fig06.draw(results).axes if ax.images]
    assert len(shown) == 3 * 2
    assert [ax.get_title() for ax in shown[:3]] == ["t = 0 s", "t = 0.0025 s", "t = 0.005 s"]
    assert "1000 particles" in nclaw_fig06.scale(Results(tmp_path))


def test_ends_beside_the_truth_are_drawn_and_recorded(tmp_path, short, monkeypatch):
    monkeypatch.setattr(nclaw_fig02, "NAMES", ("jelly", "sand"))
    results = done(tmp_path, states.away)
    ours, init = (results.value("nclaw.fig2", f"nclaw.fig2.jelly.time.{word}")
                  for word in ("ours", "init"))
    assert 0.0 < ours == init < 1.0
    figure = nclaw_fig02.draw(results)
    titles = [ax.get_title() for ax in figure.axes if ax.images]
    assert titles[:3] == ["longer: truth", "longer: ours", "longer: before training"]
    assert titles[5] == "thrown otherwise: before training"
    assert titles[6:12] == 6 * [""]


def test_runs_beside_the_truth_are_drawn_as_far_as_trained(tmp_path, short, monkeypatch):
    """Rows of bodies whose laws are not there yet are told and left out."""
    def untrained_yet(name):
        raise Untrained(f"no weights {name}")

    water = with_(reconstruction("water"), steps=10)
    monkeypatch.setattr(elsewhere, "contact", lambda: water)
    monkeypatch.setattr(elsewhere, "large", lambda: with_(reconstruction("sand"), steps=10))
    monkeypatch.setattr(elsewhere, "trained", lambda name: name)
    monkeypatch.setattr(elsewhere, "learned", lambda name: elsewhere.own if name == "water"
                        else untrained_yet(name))
    results = done(tmp_path, elsewhere.many)
    assert results.value("nclaw.fig3", "nclaw.fig3.toys.off") == 0.0
    assert "no weights sand" in str(results.records("nclaw.fig3"))
    shown = [ax for ax in nclaw_fig03.draw(results).axes if ax.images]
    assert [ax.get_title() for ax in shown] == ["start", "ours", "truth"]


def test_states_of_a_run_that_breaks_down_are_missing():
    scene = with_(reconstruction("water"), steps=100, every=5)
    x = states.shots(scene, lambda body: fresh(body, Fluid(1e15), NoFlow()))
    assert x.shape == (21, 1000, 3)
    assert np.isfinite(x[0]).all()
    assert np.isnan(x[-1]).all()
    assert (nclaw_fig02.whole(x[-1], x[-1]).colour == 1.0).all()


def test_without_weights_no_curve_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(curves, "known", lambda run: {})
    assert run_all([curves.loss.experiment], Setting("quick", tmp_path)) == []
    with pytest.raises(FileNotFoundError, match="the weights were missing"):
        nclaw_loss.draw(Results(tmp_path))


def test_curves_of_ablations_stand_beside_ours(tmp_path, monkeypatch):
    found = {name: Net(name) for name in ENVIRONMENTS}
    found["plasticine-no-rotation"] = Net("plasticine")
    monkeypatch.setattr(tables, "nets", lambda: found)
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(
        about={"errors": [1e-3, 1e-4 * len(name)]}))
    results = done(tmp_path, curves.loss, "quick")
    assert results.value("nclaw.loss", "nclaw.loss.ours.sand.last") == pytest.approx(4e-4)
    assert results.value("nclaw.loss", "nclaw.loss.no-rotation.plasticine.first") == 1e-3
    left, right = nclaw_loss.draw(results).axes
    assert {line.get_label() for line in left.lines} == set(ENVIRONMENTS)
    assert [line.get_label() for line in right.lines] == ["ours", "no-rotation"]
    assert list(right.lines[1].get_ydata()) == pytest.approx([1e-3, 22e-4])
    assert nclaw_loss.scale(results) == "2 epochs"


def test_errors_of_labels_are_told_as_what_they_are_and_not_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "nets", lambda: {"sand": Net("sand"), "sand-labeled": Net("sand")})
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(
        about={"errors": [1e-3, 1e-4]}))
    results = done(tmp_path, curves.loss, "quick")
    records = json.loads((tmp_path / "nclaw.loss.json").read_text())
    units = {one["target"]: one["unit"] for one in records}
    assert units["nclaw.loss.ours.sand.last"] == "m^2"
    assert units["nclaw.loss.labeled.sand.last"] == "1"
    axes, = nclaw_loss.draw(results).axes
    assert [line.get_label() for line in axes.lines] == ["sand"]


def test_errors_with_velocities_in_them_are_told_and_not_drawn(tmp_path, monkeypatch):
    """Those of a training that says what its errors are of are as all others."""
    more = {"water-velocity": {}, "sand-velocity": {"errors_of": "positions"}}
    monkeypatch.setattr(tables, "nets", lambda: {name: Net(name.split("-")[0]) for name in more})
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(about={
        "errors": [1e-3, 1e-4], "recipe": {"velocity": 1e-4}, **more[name]}))
    results = done(tmp_path, curves.loss, "quick")
    notes = {r.target: r.note for r in results.records("nclaw.loss")}
    told = "the loss's term of velocities is in it"
    assert told in notes["nclaw.loss.velocity.water.last"]
    assert told not in notes["nclaw.loss.velocity.sand.last"]
    table = results.table("nclaw.loss", "errors")
    assert set(table["environment"]) == {"sand"}


def test_a_body_that_broke_down_leaves_its_place_empty():
    true = np.random.default_rng(0).random((2, 50, 3))
    ours = true.copy()
    ours[-1] = np.nan
    ours[-1, :20] = 0.5
    gone = np.full_like(ours, np.nan)
    panels = sides({"a_true": true, "a_ours": ours, "b_true": true, "b_ours": gone},
                   {"a": "one", "b": "other"})
    assert [len(panel.solid.x) for panel in panels] == [50, 20, 50, 50, 0, 50]
    assert [panel.title for panel in panels] == ["start", "ours", "truth", "", "broke down", ""]
    figure = pictures(panels, View(3, 2.0))
    shown = [np.ptp(ax.images[0].get_array()) > 0.0 for ax in figure.axes]
    assert shown == [True, True, True, True, False, True]
