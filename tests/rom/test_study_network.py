"""Networks of a study: trained as its file says. Needs PyTorch."""

from dataclasses import fields

import numpy as np
import pytest
from small_studies import generated, study

from mpm_ref.rom import model_file
from mpm_ref.rom.study import dataset, reduce
from mpm_ref.rom.study.tables import KEYS, LATENTS, NETWORK, WEIGHTS, MapTable
from mpm_ref.training import Machine

torch = pytest.importorskip("torch")

from mpm_ref.rom.train import decoder, settings  # noqa: E402
from mpm_ref.rom.train.decoder import DecoderTraining, train_decoder  # noqa: E402
from mpm_ref.rom.train.loss import CODE, PRINTED, READINGS, TOWER, LossWeights, scale_weights  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A study, and the folder with its runs."""
    return generated(tmp_path_factory.mktemp("made"))


def test_a_network_is_trained_as_the_study_says():
    own = MapTable(kind="network", r=2)
    for field in fields(DecoderTraining):
        if field.name not in ("r", "weights", "schedule", "jitter"):
            assert getattr(own, field.name) == field.default
    others = {"r", "schedule", "jitter"}
    assert {field.name for field in fields(DecoderTraining)} == others | {*KEYS[NETWORK]}
    # others: NSF's fields
    assert (DecoderTraining(2).schedule, DecoderTraining(2).jitter) == ("cosine", 0.0)
    assert READINGS[own.weights] == CODE


def test_latents_and_weights_are_those_of_a_training():
    assert {*LATENTS, "encoder-nsf", "directions"} == set(decoder.LATENTS)
    for name in WEIGHTS:
        assert isinstance(settings.loss_weights(name, 1.0, 1.0), LossWeights)
    assert settings.loss_weights("code", 100.0, 6.0) == CODE
    assert settings.loss_weights("scaled", 1.0, 1.0) == CODE
    tower = settings.loss_weights("scaled", 42.0 / 0.4, 144.0 / 24.0)
    assert tower == TOWER != CODE


def test_a_network_is_trained_as_its_settings_say_and_comes_back(made, tmp_path):
    _, folder = made
    network = '"network"\nepochs = 3\nhidden = [8, 8]\nweights = "printed"\npoints = 20'
    bars = study(tmp_path, ('"modes"', network))
    data, seen = dataset.load(bars, folder, bars.train), []
    done = reduce.train_model(bars, data, {}, tmp_path / "map.pt", lambda h: seen.append(len(h)),
                        Machine())
    assert seen == [1, 2, 3]
    plain = train_decoder(DecoderTraining(3, (8, 8), weights=PRINTED, epochs=3, points=20), data)
    np.testing.assert_array_equal(done.field.net.W, plain.decoder.net.W)
    assert np.array_equal(done.about["loss"], plain.history)
    model_file.save(tmp_path / "map.npz", done)
    back = reduce.load(tmp_path / "map.npz", bars)
    np.testing.assert_array_equal(back.field.net.W, done.field.net.W)
    assert back.about["map"]["weights"] == "printed"


def test_a_network_is_trained_with_weights_that_fit_its_body(made, tmp_path):
    """The bar is 0.8 m long, its steps are of 0.01 s; latent coordinates are those of modes."""
    _, folder = made
    network = '"network"\nepochs = 3\nhidden = [8]\nweights = "scaled"\nlatent = "modes"'
    bars = study(tmp_path, ('"modes"', network))
    data = dataset.load(bars, folder, bars.train)
    done = reduce.train_model(bars, data, {}, None, None, Machine())
    fitting = scale_weights(CODE, 0.8 / 0.4, 0.01 * 144.0)
    plain, unscaled = (
        train_decoder(DecoderTraining(3, (8,), latent="modes", weights=w, epochs=3), data)
        for w in (fitting, CODE))
    np.testing.assert_allclose(done.field.net.W, plain.decoder.net.W, rtol=1e-6)
    assert not np.allclose(done.field.net.W, unscaled.decoder.net.W, rtol=1e-6)
    assert done.about["map"]["weights"] == "scaled"
    np.testing.assert_allclose(done.xhat, plain.xhat, rtol=1e-9)
