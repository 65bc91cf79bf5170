"""Errors in training: what is recorded of them, and drawn; of trainings that diverged too."""

import json

import matplotlib as mpl
import numpy as np
import pytest

from figures.nclaw import loss
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nclaw import curves, tables, trained_laws
from validation.nclaw.environments import ENVIRONMENTS
from validation.nclaw.initial_laws import untrained
from validation.nclaw.trained_laws import LawNet, identity

mpl.use("Agg")
GONE = "plasticine-no-undeformed"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where weights and what is known of trainings that diverged are looked for."""
    monkeypatch.setattr(trained_laws, "FOLDER", tmp_path / "weights")
    return tmp_path / "weights"


def done(folder, experiment):
    assert run_all([experiment.experiment], RunSetting("quick", folder)) == []
    return ProfileResults(folder)


def lost(folder, **changes):
    """Keep what is known of a training that diverged."""
    about = {**identity(trained_laws.nets()[GONE]), "errors": [1e-3, 2e-3],
             "stopped": "epoch 3: gone",
             **changes}
    return trained_laws.store_diverged(folder / f"{GONE}.npz", about)


def smooth(ax):
    """{label: line} of what a legend shows."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def test_curves_are_smoothed_over_their_neighbours():
    y = np.full(40, 1e-4)
    y[20] = 1e-4 * 10.0 ** loss.EPOCHS
    shown = loss.smoothed(y)
    assert shown[20] == pytest.approx(1e-3)         # geometric mean over EPOCHS
    assert shown[20 + loss.EPOCHS // 2 + 1:] == pytest.approx(1e-4)
    assert loss.smoothed(np.array([1e-2, 1e-4])) == pytest.approx(1e-3)


def test_without_weights_no_curve_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(curves, "available_laws", lambda run: {})
    assert run_all([curves.loss.experiment], RunSetting("quick", tmp_path)) == []
    with pytest.raises(FileNotFoundError, match="the weights were missing"):
        loss.draw(ProfileResults(tmp_path))


def test_curves_of_ablations_stand_beside_ours(tmp_path, monkeypatch):
    found = {name: LawNet(name) for name in ENVIRONMENTS}
    found["plasticine-no-rotation"] = LawNet("plasticine")
    monkeypatch.setattr(tables, "nets", lambda: found)
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(
        about={"errors": [1e-3, 1e-4 * len(name)]}))
    results = done(tmp_path, curves.loss)
    assert results.value("nclaw.loss", "nclaw.loss.ours.sand.last") == pytest.approx(4e-4)
    assert results.value("nclaw.loss", "nclaw.loss.no-rotation.plasticine.first") == 1e-3
    left, right = loss.draw(results).axes
    assert set(smooth(left)) == set(ENVIRONMENTS)
    assert [*smooth(right)] == ["ours", "no-rotation"]
    raw = {line.get_label(): list(line.get_ydata()) for line in right.lines}
    assert raw["_no-rotation"] == pytest.approx([1e-3, 22e-4])
    assert loss.scale(results) == "2 epochs"


def test_errors_of_labels_are_told_as_what_they_are_and_not_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "nets", lambda: {"sand": LawNet("sand"),
                                                 "sand-labeled": LawNet("sand")})
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(
        about={"errors": [1e-3, 1e-4]}))
    results = done(tmp_path, curves.loss)
    records = json.loads((tmp_path / "nclaw.loss.json").read_text())
    units = {one["target"]: one["unit"] for one in records}
    assert units["nclaw.loss.ours.sand.last"] == "m^2"
    assert units["nclaw.loss.labeled.sand.last"] == "1"
    axes, = loss.draw(results).axes
    assert [*smooth(axes)] == ["sand"]


def test_errors_with_velocities_in_them_are_told_and_not_drawn(tmp_path, monkeypatch):
    """Those of a training that says what its errors are of are as all others."""
    more = {"water-velocity": {}, "sand-velocity": {"errors_of": "positions"}}
    monkeypatch.setattr(tables, "nets", lambda: {name: LawNet(name.split("-")[0]) for name in more})
    monkeypatch.setattr(tables, "trained", lambda name: untrained()._replace(about={
        "errors": [1e-3, 1e-4], "recipe": {"velocity": 1e-4}, **more[name]}))
    results = done(tmp_path, curves.loss)
    notes = {r.target: r.note for r in results.records("nclaw.loss")}
    told = "the loss's term of velocities is in it"
    assert told in notes["nclaw.loss.velocity.water.last"]
    assert told not in notes["nclaw.loss.velocity.sand.last"]
    table = results.table("nclaw.loss", "errors")
    assert set(table["environment"]) == {"sand"}


def test_a_training_that_diverged_has_a_curve_with_a_cross(tmp_path, folder, monkeypatch):
    lost(folder)
    known = untrained()._replace(about={"errors": [1e-3, 1e-4, 1e-5]})
    monkeypatch.setattr(curves, "available_laws", lambda run: {"ours": {"plasticine": known}})
    results = done(tmp_path, curves.loss)
    record, = (r for r in results.records("nclaw.loss") if "no-undeformed" in r.target)
    assert record.target == "nclaw.loss.no-undeformed.plasticine.epochs"
    assert (record.value, record.scale) == (2, "of 300 epochs")
    assert record.note == "the training diverged: epoch 3: gone"
    right = loss.draw(results).axes[1]
    ours, _, own, _, cross = right.lines        # raw, then smoothed
    assert list(own.get_ydata()) == [1e-3, 2e-3]
    assert (cross.get_marker(), list(cross.get_xdata())) == ("x", [2.0])
    assert len(ours.get_xdata()) == 3


def test_what_knows_the_laws_does_not_hide_the_others(tmp_path, monkeypatch):
    laws = {method: {"sand": untrained()._replace(about={"errors": [1e-6, error]})}
            for method, error in (("ours", 1e-7), ("sys-id", 1e-20))}
    monkeypatch.setattr(curves, "available_laws", lambda run: laws)
    left, right = loss.draw(done(tmp_path, curves.loss)).axes
    assert right.get_ylim()[0] == pytest.approx(loss.ROOM * 1e-7)
    assert left.get_ylim()[0] > 1e-8


def test_what_is_kept_must_be_of_that_training(folder):
    assert trained_laws.diverged(GONE, trained_laws.identity(trained_laws.nets()[GONE])) is None
    path = lost(folder, seed=7)
    with pytest.raises(ValueError,
                       match=r"is of .*'seed': 7.*now it is .*'seed': 0.*training\.nclaw"):
        trained_laws.diverged(GONE, trained_laws.identity(trained_laws.nets()[GONE]))
    path.write_text(json.dumps({"errors": []})[:-1])
    with pytest.raises(ValueError, match=f"{GONE}.diverged.json is damaged"):
        trained_laws.diverged(GONE, trained_laws.identity(trained_laws.nets()[GONE]))
