"""Stress fields as networks by `mpm-ref rom train`, and runs on them: what needs PyTorch."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_nsf_studies import modelled, write

from mpm_ref.rom.fields.network import Networks, learned_fields
from mpm_ref.rom.study import reduce
from mpm_ref.rom.study.dataset import load_histories
from mpm_ref.rom.study.study import load
from mpm_ref.store.results import Results

torch = pytest.importorskip("torch")
stages = pytest.importorskip("mpm_ref.rom.train.stages")
settings = pytest.importorskip("mpm_ref.rom.train.settings")

NETWORK = ('kind = "modes"\nr = 3\nmodes = 5\ntau = 8\nC = 8\nsmoothing = 1e-6',
           'kind = "network"\nr = 3\nbeta = [3, 2, 2]\nlatent = "free"\nepochs = 40\n'
           "field_epochs = 20\noctaves = 1\nbatch = 4\npoints = 24\nseed = 1")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its networks."""
    folder = modelled(tmp_path_factory.mktemp("made"))
    study = write(folder, NETWORK)
    done = mpm_ref("rom", "train", study, "--data", folder / "data", "--out", folder / "nets.npz")
    assert done.exit_code == 0, done.output
    assert "network, r = 3, of 3 runs and " in done.stdout
    assert not (folder / "nets.pt").exists()
    return folder


@pytest.fixture(scope="module")
def study(made):
    """The `ReducedStudy`."""
    return load(made / "pairs.toml")


def test_networks_are_those_of_the_three_stages(made, study):
    data = load_histories(study, made / "data", study.train)
    plan = settings.stage_plan(study.tables.reduced_model.settings, 2)
    own = stages.train_stages(plan, data)
    model = reduce.load(made / "nets.npz", study)
    assert isinstance(model.field, Networks)
    for ours, theirs in zip(model.field, (own.g.decoder, own.h.field, own.l.field), strict=True):
        assert np.array_equal(ours.net.W, theirs.net.W)
    assert np.array_equal(model.xhat, own.g.xhat)
    x = np.stack([own.g.decoder.place(data.X, y) for y in own.g.xhat.reshape(-1, 3)])
    off = np.linalg.norm(x - data.x.reshape(x.shape)) / np.linalg.norm(data.x)
    assert model.about["fit"]["errors"]["origin"] == pytest.approx(off, rel=1e-4)
    assert model.about["losses"]["h"] == own.h.history[-1]
    assert (model.about["torch"], model.about["threads"]) == (torch.__version__, 1)


def test_a_plan_is_the_printed_one_with_the_studys_numbers(study):
    plan = settings.stage_plan(study.tables.reduced_model.settings, 2)
    assert (plan.g.hidden, plan.h.hidden, plan.l.hidden) == (5 * (6,), 5 * (6,), 5 * (8,))
    assert (plan.g.r, plan.g.latent, plan.g.epochs) == (3, "free", 40)
    assert [(own.follows, own.epochs) for own in (plan.h, plan.l)] == [(True, 20), (False, 20)]
    assert [own.octaves for own in (plan.h, plan.l)] == [1, 1]
    assert {(own.batch, own.points, own.seed, own.schedule) for own in plan} == {
        (4, 24, 1, "steps")}


def test_latent_coordinates_of_modes_are_in_one_unit_and_can_be_trained(made, study):
    """Positions alone are known: no norm of the loss with gradients."""
    plan = settings.stage_plan({**study.tables.reduced_model.settings, "latent": "modes"}, 2)
    assert plan.g.latent == "directions"
    data = load_histories(study, made / "data", study.train)
    found = stages.train_decoder(replace(plan.g, epochs=1), stages.position_snapshots(data))
    assert found.xhat.shape == (*data.x.shape[:2], 3)


def test_a_run_is_one_on_the_networks(made, study, tmp_path):
    out = tmp_path / "run.h5"
    done = mpm_ref("rom", "run", made / "pairs.toml", "--map", made / "nets.npz", "--out", out,
                   "--set", "v=1.9", "--json")
    assert done.exit_code in (0, 3), done.output
    model = reduce.load(made / "nets.npz", study)
    with Results(out) as results:
        X = np.concatenate([results.field(body, "x", 0) for body in ("hard", "soft")])
        xhat, mu = results.h5["reduced/xhat"][0], [1.9]
        rest = load_histories(study, made / "data", (0,), float).X
        fields = learned_fields(rest, model.field, mu, 0.3)
        tau = np.concatenate([results.field(body, "tau", 0) for body in ("hard", "soft")])
        assert np.array_equal(X, fields.place(np.arange(len(X)), xhat))
        assert np.array_equal(tau, fields.stress(np.arange(len(X)), xhat))
    assert json.loads(done.stdout)["reduced"]["map"]["kind"] == "network"


def test_networks_have_no_single_precision(made, tmp_path):
    study = write(tmp_path, ("points = 20", 'points = 20\nprecision = "single"'))
    done = mpm_ref("rom", "run", study, "--map", made / "nets.npz", "--set", "v=1.9", "--out",
                   tmp_path / "run.h5")
    assert_told(done, 2, "run.precision = 'single': expected 'double' for fields of kind 'network'")
    assert not (tmp_path / "run.h5").exists()


def test_networks_are_evaluated_and_described(made, tmp_path):
    done = mpm_ref("rom", "evaluate", made / "pairs.toml", "--map", made / "nets.npz", "--data",
                   made / "data", "--out", tmp_path / "e.png", "--json")
    found = json.loads(done.stdout)["all"]["nearest"]
    assert 0.0 < found["origin"] < found["displacement"] < 1.0
    what, of, sizes, losses, *_ = mpm_ref("info", made / "nets.npz").stdout.splitlines()
    assert "nets.npz: stress fields, network, r = 3, 2D" in what
    assert of.startswith("made of 3 runs of 9 states")
    assert sizes == ("factors of width 3, 2, 2, octaves of sines and cosines: 1; the stress "
                     "sees the parameters")
    assert losses.startswith("last losses: ")
    assert "factors of width 3, 2, 2" in mpm_ref("info", made / "pairs.toml").stdout


def test_a_training_that_was_cut_off_goes_on_from_its_stages(made, study, tmp_path, monkeypatch):
    seen = []

    learn, command = settings.fit_stages, (
        "train", made / "pairs.toml", "--data", made / "data", "--out", tmp_path / "nets.npz")

    def fitted(settings, histories, folder, on_epoch, machine):
        def shown(stage, history):
            seen.append((stage, len(history)))
            if len(seen) == 50:
                raise KeyboardInterrupt
            on_epoch(stage, history)
        return learn(settings, histories, folder, shown, machine)

    monkeypatch.setattr(settings, "fit_stages", fitted)
    done = mpm_ref("rom", *command)
    assert_told(done, 130, f"the same command again goes on from {tmp_path / 'nets.pt'}")
    assert seen[-1] == ("h", 10)
    again = mpm_ref("rom", *command)
    assert again.exit_code == 0, again.output
    assert seen[50] == ("h", 1)
    assert not (tmp_path / "nets.pt").exists()
    ours, theirs = (reduce.load(folder / "nets.npz", study) for folder in (tmp_path, made))
    assert np.array_equal(ours.field.l.net.W, theirs.field.l.net.W)
