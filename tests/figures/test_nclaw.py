"""NCLaw's figures, and what their experiments keep for them."""

import re
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.common.bodies import View, pictures
from figures.common.law_panels import comparison_rows
from figures.nclaw import fig02, fig03, fig04, fig06, fig07, table5
from mpm_ref.materials import FixedCorotated, Fluid, NoFlow
from mpm_ref.nclaw.gnn.simulator import Simulator
from mpm_ref.nclaw.study.compare import RunBroken
from validation.common import targets
from validation.common.results import RESULTS, ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.common.weights_needed import Untrained
from validation.nclaw import gallery, other_bodies, states
from validation.nclaw.evaluate import body_with_laws
from validation.nclaw.tasks import reconstruction

pytestmark = pytest.mark.slow

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
    monkeypatch.setattr(states, "body_maker", lambda laws: lambda body: body_with_laws(
        body, Fluid(1e15 if laws == "sand" else 0.0), NoFlow()))


def done(folder, experiment, profile="standard"):
    setting = RunSetting(profile, folder, targets=targets.load())   # refuses ids that are printed
    assert run_all([experiment.experiment], setting) == []
    return ProfileResults(folder)


def notes_of(axes):
    """{number of a picture: note below it}."""
    return {k: ax.texts[1].get_text() for k, ax in enumerate(axes) if ax.texts[1].get_text()}


def test_training_runs_are_drawn(tmp_path, short, monkeypatch):
    results = done(tmp_path, states.training)
    monkeypatch.setattr(fig06, "NAMES", ("jelly", "water"))
    shown = [ax for ax in fig06.draw(results).axes if ax.images]
    assert len(shown) == 3 * 2
    assert [ax.get_title() for ax in shown[:3]] == ["t = 0 s", "t = 0.0025 s", "t = 0.005 s"]
    assert "1000 particles" in fig06.scale(ProfileResults(tmp_path))


def test_ends_beside_the_truth_are_drawn_and_recorded(tmp_path, short, monkeypatch):
    """Graph networks as far as they are trained; what is not there is told."""
    def trained(name):
        if name in ("sand-gnn", "jelly-gnn"):
            raise Untrained(f"no weights {name}")
        return name

    monkeypatch.setattr(states, "trained", trained)
    monkeypatch.setattr(fig02, "NAMES", ("jelly", "water"))
    results = done(tmp_path, states.away)
    found = {r.target: r for r in results.records("nclaw.fig2")}
    ours, init, neural = (found[f"nclaw.fig2.jelly.time.{word}"].value
                          for word in ("ours", "init", "neural"))
    assert 0.0 < ours == init == neural < 1.0
    assert found["nclaw.fig2.untrained"].note == "no weights jelly-gnn; no weights sand-gnn"
    assert "nclaw.fig2.jelly.time.gnn" not in found
    figure = fig02.draw(results)
    shown = [ax for ax in figure.axes if ax.images]
    assert [ax.get_title() for ax in shown] == [
        "start", "truth", "ours", "neural", "gnn", "before\ntraining", *18 * [""]]
    assert notes_of(shown) == {4: "not trained", 16: "not trained"}
    assert shown[6].texts[0].get_text() == "water, longer\nt = 0.005 s"


def test_a_law_that_breaks_down_has_no_picture(tmp_path, short, monkeypatch):
    monkeypatch.setattr(states, "ENVIRONMENTS", ("sand",))
    monkeypatch.setattr(fig02, "NAMES", ("sand",))
    for name in ("time", "velocity"):
        monkeypatch.setattr(states, name, lambda *of: with_(reconstruction("water"), steps=100))
    figure = fig02.draw(done(tmp_path, states.away))
    notes = notes_of([ax for ax in figure.axes if ax.images])
    assert (notes[2], notes[8]) == ("broke down", "broke down")
    assert 0 not in notes
    assert 1 not in notes


def test_a_graph_network_runs_through_all_its_frames(monkeypatch):
    scene, asked = with_(reconstruction("water"), steps=20), []

    def frames(problem, law):
        asked.append(problem.clock.every)
        yield from (np.full((2, 3), float(k)) for k in range(1 + 20 // asked[-1]))

    monkeypatch.setattr(states, "frames", frames)
    simulator = Simulator(*[None] * len(Simulator._fields))
    assert states.ends(scene, simulator)[:, 0, 0].tolist() == [0.0, 4.0]
    assert states.ends(scene, states.copy_body)[:, 0, 0].tolist() == [0.0, 1.0]
    assert asked == [5, 20]


def test_runs_beside_the_truth_are_drawn_as_far_as_trained(tmp_path, short, monkeypatch):
    """Rows of bodies whose laws are not there yet are told and left out."""
    def untrained_yet(name):
        raise Untrained(f"no weights {name}")

    water = with_(reconstruction("water"), steps=10)
    monkeypatch.setattr(other_bodies, "contact", lambda points: water)
    monkeypatch.setattr(other_bodies, "large", lambda _: with_(reconstruction("sand"), steps=10))
    monkeypatch.setattr(other_bodies, "trained", lambda name: name)
    monkeypatch.setattr(other_bodies, "body_maker", lambda name: other_bodies.copy_body
                        if name.startswith("water") else untrained_yet(name))
    results = done(tmp_path, other_bodies.many)
    assert results.value("nclaw.fig3", "nclaw.fig3.contact.ours") == 0.0
    assert "no weights sand" in str(results.records("nclaw.fig3"))
    shown = [ax for ax in fig03.draw(results).axes if ax.images]
    assert [ax.get_title() for ax in shown] == ["start", "ours", "admissible", "truth"]


def test_bodies_that_share_a_grid_are_recorded_each(tmp_path, monkeypatch):
    """And a law that breaks down with the step in which it does."""
    monkeypatch.setattr(other_bodies, "pool", lambda: with_(gallery.pool(), every=20))
    monkeypatch.setattr(other_bodies, "SHORT_POOL", 20)
    monkeypatch.setattr(other_bodies, "dessert",
                        lambda: with_(gallery.dessert(), steps=20, every=20))
    monkeypatch.setattr(other_bodies, "trained", lambda name: name)
    monkeypatch.setattr(other_bodies, "body_maker", lambda name: other_bodies.copy_body
                        if "admissible" in name
                        else lambda body: body_with_laws(
                            body, FixedCorotated(1e15, 1e15), NoFlow()))
    results = done(tmp_path, other_bodies.company)
    found = {r.target: r for r in results.records("nclaw.fig4")}
    for target in ("pool.admissible", "pool.admissible.duck", "pool.admissible.pool",
                   "melting.admissible.icecream", "melting.admissible.chocolate"):
        assert np.isfinite(found[f"nclaw.fig4.{target}"].value)
    assert found["nclaw.fig4.pool.admissible.duck"].value == 0.0
    assert found["nclaw.fig4.pool.admissible.duck"].scale.startswith("1011 particles of duck, 20")
    assert re.search(r"ours: step \d+", found["nclaw.fig4.pool.ours"].note)
    shown = [ax for ax in fig04.draw(results).axes if ax.images]
    assert [ax.get_title() for ax in shown[:4]] == ["start", "ours", "admissible", "truth"]


def test_states_of_a_run_that_breaks_down_are_missing():
    scene = with_(reconstruction("water"), steps=100, every=5)
    x, end = states.shots(scene, lambda body: body_with_laws(body, Fluid(1e15), NoFlow()))
    assert x.shape == (21, 1000, 3)
    assert 0 < end.step < 100
    assert np.isfinite(x[0]).all()
    assert np.isnan(x[-1]).all()


def test_a_body_that_broke_down_leaves_its_place_empty():
    true = np.random.default_rng(0).random((2, 50, 3))
    ours = true.copy()
    ours[-1] = np.nan
    ours[-1, :20] = 0.5
    gone = np.full_like(ours, np.nan)
    panels = comparison_rows({"a_true": true, "a_ours": ours, "b_true": true, "b_ours": gone},
                   {"a": "one", "b": "other"})
    assert [len(panel.solid.x) for panel in panels] == [50, 20, 50, 50, 0, 50]
    assert [panel.title for panel in panels] == ["start", "ours", "truth", "", "", ""]
    assert [panel.note for panel in panels] == ["", "broke down", "", "", "broke down", ""]
    figure = pictures(panels, View(3, width=2.0))
    shown = [np.ptp(ax.images[0].get_array()) > 0.0 for ax in figure.axes]
    assert shown == [True, True, True, True, False, True]


def test_baselines_stand_between_ours_and_the_truth_if_they_were_kept():
    x = np.random.default_rng(0).random((2, 50, 3))
    kept = {"a_true": x, "a_ours": x, "a_neural": x + 1.0, "b_true": x, "b_ours": x}
    panels = comparison_rows(kept, {"a": "one", "b": "other", "c": "not kept"}, ("ours", "neural"))
    assert [panel.title for panel in panels] == ["start", "ours", "neural", "truth", "", "", ""]
    assert [panel.side for panel in panels] == ["one", "", "", "", "other", "", ""]
    assert panels[2].solid.x == pytest.approx(panels[1].solid.x + 1.0)


def test_bodies_of_task_c_are_run_with_baselines(tmp_path, monkeypatch):
    """Each beside the truth, as far from it as its laws are."""
    monkeypatch.setattr(other_bodies, "ENVIRONMENTS", ("water",))
    monkeypatch.setattr(other_bodies, "geometry",
                        lambda name: with_(reconstruction(name), steps=20))
    monkeypatch.setattr(other_bodies, "trained", lambda name: name)
    monkeypatch.setattr(other_bodies, "body_maker", lambda name: other_bodies.copy_body
                        if name == "water" else
                        lambda body: body_with_laws(body, Fluid(0.0), NoFlow()))
    monkeypatch.setattr(other_bodies, "with_points", lambda scene, count: scene)
    results = done(tmp_path, other_bodies.bodies)
    found = {r.target: r for r in results.records("nclaw.fig7")}
    assert found["nclaw.fig7.water.ours"].value == 0.0
    assert 0.0 < found["nclaw.fig7.water.neural"].value < 1.0
    assert "middles are 0 m apart" in found["nclaw.fig7.water.ours"].note
    shown = [ax for ax in fig07.draw(results).axes if ax.images]
    assert [ax.get_title() for ax in shown] == [
        "start", "ours", "neural", "admissible", "truth"]
    assert shown[0].texts[0].get_text() == "water\nt = 0.005 s"      # half of the steps


def test_runs_that_broke_down_are_told(tmp_path):
    notes, cached = {}, []

    def make_and_note(name, make):
        cached.append(name)
        return make()

    run = SimpleNamespace(
        experiment=SimpleNamespace(id="e"), folder=tmp_path, cached=make_and_note,
        progress=lambda items, said: items,
        record=lambda target, value, note, **rule: notes.update({target: note}))
    x = np.zeros((2, 5, 3))
    runs = {"true": x, "ours": x, "init": np.full_like(x, np.nan)}
    states.record(run, "s", {word: own[-1] for word, own in runs.items()}, 10)
    kept = {word: states.Shots(x, RunBroken(7, "gone") if word == "init" else None)
            for word, x in runs.items()}
    other_bodies.show(run, {"a": (lambda: other_bodies.thinned(kept, reconstruction("water")),
                                  "five points")})
    assert [target for target, note in notes.items() if note.startswith(states.BROKEN)] == [
        "s.init", "e.a.init"]
    assert notes["e.a.init"] == f"{states.BROKEN}; init: step 7: gone"
    assert cached == ["a: five points"]         # a run of other bodies is another part
    assert len(notes) == 4


def test_table_5_shows_the_printed_errors_beside_ours():
    """Drawn from the published records, which hold no printed values."""
    figure = table5.draw(ProfileResults(RESULTS / "standard"))
    shown = [{line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--"}
             for ax in figure.axes]
    printed = targets.load()
    assert shown == [{printed[f"nclaw.table5.{term}.{method}"].value for method in table5.BOTH}
                     for term in table5.TERMS]
