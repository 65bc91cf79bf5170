"""Trained networks of NSF's scenes: which weights are taken for them, what they cost, and the
experiment on them; the training itself is in tests/validation/nsf/test_networks_learn.py.
"""

import numpy as np
import pytest
from field_toys import R, networks

from mpm_ref.rom.fields.network import Networks
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.model_file import Model, save
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import nsf_full_model
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nsf import networks as kept
from validation.nsf import networks_runs as runs
from validation.nsf import printed_networks as as_printed
from validation.nsf import printed_rates, reduced_runs
from validation.nsf.networks import (
    FieldsNet,
    NetworkPlan,
    fields_of,
    identity,
    net_of,
    nets,
    trained,
)
from validation.nsf.settings import STUDIES
from validation.nsf.studies import jelly

STUDY = jelly(4)._replace(train=(0.3, 0.5), sizes=Sizes(r=R), samples=20)
NET = FieldsNet(STUDY, NetworkPlan(4, 2, 0.1), NetworkPlan(5, 2, 0.0), NetworkPlan(6, 2, 0.0))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of weights where only those of a small study belong."""
    monkeypatch.setattr(kept, "FOLDER", tmp_path)
    for module in (kept, runs):
        monkeypatch.setattr(module, "nets", lambda: {"jelly": NET})
    trained.cache_clear()
    yield tmp_path
    trained.cache_clear()


def model(net=NET):
    """Networks drawn at random that say they are a net's."""
    rng = np.random.default_rng(0)
    fields = Networks(*networks(3))
    return Model(fields, rng.normal(size=(2, 31, R)), rng.normal(size=R), identity(net))


def test_the_networks_are_those_of_all_scenes_with_the_printed_latent_coordinates():
    printed = targets.load()
    assert {*nets()} == {"jelly", "metal", "jelly-seed-1", "jelly-seed-2",
                         *(f"{name}-waves" for name in STUDIES)}
    for name, net in nets().items():
        scene = name.split("-")[0]
        assert net.study.sizes.r == printed[f"nsf.table1.{scene}.r"].value
        assert net.study.follows is (scene in ("bread", "metal", "sand"))


def test_features_are_those_of_stress_and_affine_field_alone():
    known = nets()
    for name in ("jelly", "metal"):
        net, waves = known[name], known[f"{name}-waves"]
        assert waves == net._replace(octaves=3)
        assert "octaves" not in identity(net)
        assert identity(waves) == identity(net) | {"octaves": 3}


def test_seeds_differ_in_the_seed_alone():
    known = nets()
    for seed in (1, 2):
        assert known[f"jelly-seed-{seed}"] == known["jelly"]._replace(seed=seed)


@pytest.mark.usefixtures("folder")
def test_missing_weights_say_how_they_are_made():
    with pytest.raises(Untrained, match=r"no weights jelly.npz: python -m validation.training.nsf "
                                        "jelly"):
        trained("jelly")


def test_weights_come_back_as_fields_of_the_scene(folder):
    save(folder / "jelly.npz", model())
    fields = fields_of(trained("jelly"), STUDY)
    X, xhat, some = nsf_full_model(STUDY.run(0.45)).X, np.array([0.2, -0.1, 0.4]), np.array([3, 40])
    assert np.array_equal(fields.X, X)
    assert fields.place(some, xhat) == pytest.approx(model().field.g.place(X[some], xhat))
    assert fields.stress(some, xhat)[:, 0, 2] == pytest.approx(
        model().field.h.values(X[some], xhat)[:, 2])


@pytest.mark.parametrize("change", [{"study": STUDY._replace(train=(0.3, 0.4))},
                                    {"study": STUDY._replace(every=8)},
                                    {"study": STUDY._replace(follows=True)},
                                    {"study": STUDY._replace(sizes=Sizes(r=R + 1))},
                                    {"g": NetworkPlan(4, 2, 0.2)}, {"h": NetworkPlan(5, 3, 0.0)},
                                    {"l": NetworkPlan(7, 2, 0.0)}, {"batch": 4}, {"points": 9},
                                    {"latent": "free"}, {"schedule": "steps"}, {"seed": 1}],
                         ids=lambda change: next(iter(change)))
def test_weights_of_another_training_are_refused(folder, change):
    save(folder / "jelly.npz", model(NET._replace(**change)))
    with pytest.raises(ValueError, match=r"weights jelly.npz are of .*, now it is .*: python -m "
                                         "validation.training.nsf jelly"):
        trained("jelly")


def test_damaged_weights_are_refused(folder):
    save(folder / "jelly.npz", model())
    content = (folder / "jelly.npz").read_bytes()
    (folder / "jelly.npz").write_bytes(content[:3000] + b"?" + content[3001:])
    with pytest.raises(ValueError, match="is damaged"):
        trained("jelly")


def test_weights_that_lie_there_are_those_of_their_nets():
    """What is committed fits what is asked for; 2 MB at most each."""
    for file in kept.FOLDER.glob("*.npz"):
        assert trained(file.stem).field.r == net_of(file.stem).study.sizes.r
        assert file.stat().st_size <= 2e6


# The experiment.

def recorded(folder):
    """{id without "nsf.networks.": `Record`} of the experiment, which must not fail."""
    setting = RunSetting("standard", folder / "out", targets=targets.load())
    assert run_all([runs.networks.experiment], setting) == []
    return {r.target.removeprefix("nsf.networks."): r
            for r in ProfileResults(folder / "out").records("nsf.networks")}


def test_without_weights_there_are_costs_and_the_command(folder):
    found = recorded(folder)
    assert found["untrained"].value == 1
    assert "python -m validation.training.nsf jelly" in found["untrained"].note
    assert found["jelly.weights"].value == (6 * 4 + 4 * 16 + 4 * 3 + 6 * 5 + 4 * 25 + 5 * 6
                                            + 6 * 6 + 4 * 36 + 6 * 9)
    assert found["jelly.operations"].value == 2 * found["jelly.weights"].value
    assert "jelly.all" not in found


def test_the_printed_networks_of_jelly_are_those_of_table_1(folder, monkeypatch):
    """By hand: 5 x 96, 5 x 384 and 5 x 576."""
    monkeypatch.setattr(runs, "nets", lambda: {"jelly": nets()["jelly"]})
    assert recorded(folder)["jelly.weights.printed"].value == 37_920 + 595_200 + 1_336_896


class Ready(reduced_runs.FittedStudy):
    """`FittedStudy` with known errors, of each draw others."""

    def errors(self, value, count, draw, dt_factor, weighted):
        """Errors that tell their draw, and whether samples have weights."""
        error = (0.001 if weighted else 0.01) * (draw + 1)
        return reduced_runs.RunErrors(PositionErrors(error, 0.02, 0.03), 0.2, float(count), count,
                                      np.nan)

    def nearest_state_errors(self, value):
        """Of the nearest states."""
        return PositionErrors(0.001, 0.002, 0.003)


def ready(model, study):
    """Return a `Ready` study on networks."""
    fields = fields_of(model, study)
    test = type("History", (), {"X": fields.X, "x": np.zeros((1, 31, 1, 3))})
    return Ready(study, fields, model.xhat, None, {0.45: test})


def test_errors_are_means_in_per_cent(folder, monkeypatch):
    save(folder / "jelly.npz", model())
    monkeypatch.setattr(runs, "fit_to_networks", ready)
    found = recorded(folder)
    assert found["nsf.jelly.error.plain"].value == pytest.approx(2.0)           # mean of 1, 2, 3 %
    assert found["nsf.jelly.error.plain"].note == (
        "20 samples; mean of 3, the largest 3 %; trained networks; from the corner of the unit "
        "box that scenes stand in; from the centroid 2 %, of the displacement 3 %")
    assert found["jelly.cubature"].value == pytest.approx(0.2)
    assert found["jelly.all"].value == pytest.approx(1.0)
    assert found["jelly.nearest"].value == pytest.approx(0.1)
    for words in ("stress", "cubature.stress", "all.stress"):
        assert found[f"jelly.{words}"].value == pytest.approx(20.0)
    assert "2 runs and 1 test, dx and dt 4 times as long; r = 3, widths 4, 5 and 6, seed 0" in (
        found["nsf.jelly.error.plain"].scale)
    assert "untrained" not in found
    table = ProfileResults(folder / "out").table("nsf.networks", "errors")
    assert table["draw"].tolist() == [0, 1, 2, 0, 1, 2, 0]
    assert (table["points"] == table["samples"]).all()
    assert {*table["scene"]} == {"jelly"}


def test_weights_of_samples_are_those_of_modes_of_the_same_runs(folder):
    """The networks know no modes."""
    save(folder / "jelly.npz", model())
    one, plain = runs.fit_to_networks(trained("jelly"), STUDY), reduced_runs.fit_study(STUDY)
    scene = nsf_full_model(STUDY.run(0.45))
    asked = []
    spied = STUDY.__class__.chosen
    expected, = spied(STUDY, scene, 20, 1, plain.fields)

    class Spy(STUDY.__class__):
        def chosen(self, *given):
            asked.append(spied(self, *given))
            return asked[-1]

    one._replace(study=Spy(*STUDY)).errors(0.45, 20, 1, weighted=True)
    (found,), = asked
    assert np.array_equal(found.points, expected.points)
    assert found.weights == pytest.approx(expected.weights)


@pytest.mark.parametrize(("name", "id"), [
    ("jelly-printed", "nsf.jelly.error"), ("metal-printed", "nsf.metal.error.50"),
    ("jelly-waves", "nsf.jelly.error.waves"), ("metal-waves", "nsf.metal.error.50.waves"),
    ("jelly", "nsf.jelly.error.plain"), ("metal", "nsf.metal.error.50.plain"),
    ("toothpaste-waves", "nsf.toothpaste.error.50.waves"),
    ("jelly-seed-1", "nsf.networks.jelly-seed-1")])
def test_networks_have_the_ids_of_the_printed_errors(name, id):
    assert runs.printed_error(name, f"nsf.networks.{name}") == id
    assert (runs.own_rule(name) == {}) is ("networks" not in id)


@pytest.mark.parametrize(("scene", "widths"), [
    ("jelly", (96, 384, 576)), ("metal", (96, 288, 432)), ("sand", (144, 432, 648))])
def test_networks_as_printed_have_the_widths_epochs_and_rates_of_the_paper(scene, widths):
    """By hand from Table 1 and appendix E, with the epochs of all rates together."""
    net = as_printed.printed_nets()[f"{scene}-printed"]
    assert net.study.coarser == (1 if scene == "jelly" else 2)
    assert [(own.width, own.epochs, own.jitter) for own in (net.g, net.h, net.l)] == list(
        zip(widths, (300, 600, 600), (0.0, 0.0, 0.0), strict=True))
    assert (net.batch, net.latent, net.schedule) == (32, "encoder-nsf", "steps")


def test_errors_of_networks_as_printed_are_those_of_their_runs(folder, monkeypatch):
    about = {"errors": {"displacement": 0.04, "stress": 0.3, "affine": 0.2}}
    monkeypatch.setattr(as_printed, "printed_nets", lambda: {"jelly-printed": NET})
    monkeypatch.setattr(as_printed, "trained_as_printed",
                        lambda name: model()._replace(about=about))
    monkeypatch.setattr(as_printed, "fit_to_networks", ready)
    setting = RunSetting("standard", folder / "out", targets=targets.load())
    assert run_all([as_printed.networks_as_printed.experiment], setting) == []
    found = {r.target.removeprefix("nsf.networks-printed.jelly-printed"): r.value
             for r in ProfileResults(folder / "out").records("nsf.networks-printed")}
    assert found["nsf.jelly.error"] == pytest.approx(2.0)                  # mean of 1, 2, 3 %
    assert found[".stress"] == pytest.approx(20.0)
    assert found[".nearest"] == pytest.approx(0.1)
    assert found[".fit.displacement"] == pytest.approx(4.0)


def test_networks_of_each_rate_differ_from_those_as_printed_by_five_times_the_epochs():
    """Five rates, 300, 600 and 600 epochs at each (NSF-train)."""
    printed, net = as_printed.printed_nets()["jelly-printed"], printed_rates.rates_nets()
    assert net.keys() == {"jelly-rates"}
    assert [own.epochs for own in net["jelly-rates"][1:4]] == [1500, 3000, 3000]
    assert net["jelly-rates"]._replace(g=printed.g, h=printed.h, l=printed.l) == printed


def test_errors_of_networks_of_each_rate_are_those_of_their_runs(folder, monkeypatch):
    about = {"errors": {"displacement": 0.04, "stress": 0.3, "affine": 0.2}}
    monkeypatch.setattr(printed_rates, "rates_nets", lambda: {"jelly-rates": NET})
    monkeypatch.setattr(printed_rates, "trained_at_each_rate",
                        lambda name: model()._replace(about=about))
    monkeypatch.setattr(printed_rates, "fit_to_networks", ready)
    assert run_all([printed_rates.networks_at_each_rate.experiment],
                   RunSetting("standard", folder / "out")) == []
    found = {r.target.removeprefix("nsf.networks-rates.jelly-rates"): r.value
             for r in ProfileResults(folder / "out").records("nsf.networks-rates")}
    assert found == pytest.approx(found | {"": 2.0, ".nearest": 0.1, ".stress": 20.0,
                                           ".fit.stress": 30.0, ".fit.affine": 20.0})


def test_every_scene_has_the_id_of_a_printed_error():
    printed = targets.load()
    names = [name for name in kept.nets() if name.endswith("-waves")]
    assert len(names) == 7
    assert all(runs.printed_error(name, "").removesuffix(".waves") in printed for name in names)
    assert all(runs.printed_error(name, "") in printed for name in as_printed.printed_nets())
