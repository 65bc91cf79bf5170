"""What NCLaw prints of its settings is what is run."""

import numpy as np
import pytest
from record_verdicts import verdict

from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import catalogue_scene, with_
from validation.common.weights_needed import Untrained
from validation.nclaw import settings

ELSEWHERE = {       # in other experiments, with what they are settings of
    *(f"nclaw.table6.{row}.trajectories" for row in ("gnn.1", "gnn.10", "gnn.100", "ours.1")),
    *(f"nclaw.appD3.{what}" for what in ("drop_height", "fps", "dots"))}
NOT_OURS = {        # of a kitchen and a lens, of other papers and machines; counts of wins; what
                    # cannot be otherwise
    *(f"nclaw.appD3.{what}" for what in ("flour", "water", "knead", "exposure")),
    "nclaw.sec4_1.trajectories", "nclaw.sec4_3.gnn_trajectories", "nclaw.appD2.gpus",
    "nclaw.ext.sand.cohesion", "nclaw.appF2.better_tasks", "nclaw.appF5.better_tasks"}
GRAPH = {"nclaw.sec4_1.gnn_step_factor", "nclaw.appF1.steps_gnn",
         "nclaw.appF4.data_ratio"}


def records(folder):
    setting = RunSetting("quick", folder, targets=targets.load())
    assert run_all([settings.settings.experiment], setting) == []
    return {r.target: r for r in ProfileResults(folder).records("nclaw.settings")
            if r.target != "nclaw.settings"}


def misses(found):
    return {target for target, r in found.items() if verdict(r) == "miss"}


def test_all_settings_are_the_printed_ones(tmp_path):
    """But for those that are named here."""
    found = records(tmp_path)
    printed = {name for name, target in targets.load().items()
               if name.startswith("nclaw.") and target.kind == "setting"}
    assert found.keys() == printed - ELSEWHERE - NOT_OURS
    assert {verdict(r) for r in found.values()} == {"pass"}


def test_other_settings_miss(tmp_path, monkeypatch):
    def changed(name):
        scene = catalogue_scene(name)
        return with_(scene, every=10) if name == "nclaw_jelly" else scene

    def other(name):
        laws = found[name]
        if name == settings.GRAPHS:
            return laws._replace(about={**laws.about, "runs": 10})
        return laws._replace(about={**laws.about, "recipe": {**laws.about["recipe"], "clip": 1.0}},
                             elastic=biased(laws.elastic))

    found = {name: settings.trained(name) for name in (settings.JELLY, settings.GRAPHS)}
    monkeypatch.setattr(settings, "catalogue_scene", changed)
    monkeypatch.setattr(settings, "trained", other)
    monkeypatch.setattr(settings, "FASTEST", 2.0)
    assert misses(records(tmp_path)) == {
        "nclaw.sec4_1.loss_stride", "nclaw.appD2.grad_clip",
        "nclaw.appD2.params", "nclaw.ext.vel_bound_lin", "nclaw.ext.vel_bound_ang"}


def biased(law):
    """A law whose last layer has biases."""
    *before, (W, b) = law.layers
    return law._replace(layers=(*before, (W, np.ones_like(b))))


@pytest.mark.parametrize(("missing", "gone"), [
    (settings.GRAPHS, lambda target: target in GRAPH),
    (settings.JELLY, lambda target: target.startswith(("nclaw.appC.", "nclaw.appD2.",
                                                       "nclaw.sec4_1.mlp_")))],
    ids=["graph network", "laws"])
def test_weights_that_are_not_there_are_told(missing, gone, tmp_path, monkeypatch):
    known = settings.trained

    def found(name):
        if name == missing:
            raise Untrained(f"no weights {name}.npz")
        return known(name)

    everything = records(tmp_path)
    monkeypatch.setattr(settings, "trained", found)
    told = records(tmp_path)
    assert told.pop("nclaw.settings.untrained").note == f"no weights {missing}.npz"
    assert told.keys() == {target for target in everything if not gone(target)}
    assert told.keys() < everything.keys()
