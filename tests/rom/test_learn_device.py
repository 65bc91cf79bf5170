"""Trainings elsewhere than on the processor: all that is computed is on one device. Needs PyTorch.

PyTorch's "meta" tensors have a device and no numbers: what mixes them with others is refused, as
on a graphics processor, which need not be there.
"""

import field_toys
import numpy as np
import pytest
import rom_toys
from command_line import assert_told, mpm_ref
from small_studies import generated

torch = pytest.importorskip("torch")

from mpm_ref.rom.train import decoder, field  # noqa: E402
from mpm_ref.rom.train.decoder import DecoderTraining  # noqa: E402
from mpm_ref.rom.train.field import FieldData, FieldTraining  # noqa: E402
from mpm_ref.rom.train.settings import device_of  # noqa: E402
from mpm_ref.rom.train.stages import POSITION, position_snapshots  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")
DATA, META = field_toys.histories(), "meta"
POSITIONS = {"encoder": {"latent": "encoder-nsf"}, "free": {"latent": "free"},
             "directions": {"latent": "directions", "jitter": 0.1}}


def of_position(device, **settings):
    """A session of NSF's first stage."""
    training = DecoderTraining(1, (4, 4), weights=POSITION, points=5, **settings)
    return decoder.DecoderSession(training, position_snapshots(DATA), device)


def of_stress(device):
    """A session of NSF's second stage, with all that it can have."""
    seen = FieldData(DATA.X, np.ones((*DATA.x.shape[:2], 1)), DATA.mu, DATA.tau, DATA.dt)
    return field.FieldSession(FieldTraining((4,), True, points=5, jitter=0.1, octaves=2), seen,
                              device)


def of_gradients(device, latent):
    """A session of LDM, whose loss has F and velocities."""
    return decoder.DecoderSession(DecoderTraining(2, (4, 4), latent, points=5),
                                  rom_toys.snapshots(2), device)


MADE = {**{name: (of_position, how) for name, how in POSITIONS.items()}, "stress": (of_stress, {}),
        "gradients": (of_gradients, {"latent": "encoder"}),
        "gradients, modes": (of_gradients, {"latent": "modes"})}


@pytest.mark.parametrize(("make", "how"), MADE.values(), ids=[*MADE])
def test_errors_and_their_gradients_are_on_the_device(make, how):
    session = make(META, **how)
    total, terms = session.error(session.order()[:3])
    total.backward()
    assert {a.device.type for a in (total, *terms)} == {META}
    grads = [own.grad for own in session.f.parameters()]
    assert {a.device.type for a in grads} == {META}


@pytest.mark.parametrize("how", POSITIONS.values(), ids=[*POSITIONS])
def test_what_latent_coordinates_are_told_from_is_on_the_device(how):
    """Not every operation on "meta" tensors refuses others: numbers of rows, einsum."""
    session = of_position(META, **how)
    known = [session.inputs, *session.encoder.parameters(), *session.encoder.buffers()]
    assert {a.device.type for a in known} == {META}


@pytest.mark.parametrize(("make", "how"), MADE.values(), ids=[*MADE])
def test_what_is_shown_does_not_depend_on_the_device(make, how):
    """Random numbers are drawn on the processor."""
    here, there = make("cpu", **how), make(META, **how)
    for _ in range(3):
        for draw in ("order", "draw_points"):
            a, b = (getattr(session, draw)() for session in (here, there))
            assert b.device.type == "cpu"
            assert a.tolist() == b.tolist()
        here.draw_jitter(2, 1), there.draw_jitter(2, 1)


def test_the_processor_is_always_there():
    assert device_of("cpu") == torch.device("cpu")


@pytest.mark.parametrize(("name", "words"), [
    ("gpu", "device 'gpu': expected one of cpu, cuda"),
    ("cuda", 'device "cuda": PyTorch finds no graphics processor here; expected "cpu"')])
def test_devices_that_are_not_there_are_told(monkeypatch, name, words):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match=words):
        device_of(name)


@pytest.mark.parametrize(("options", "words"), [
    (("--kind", "network", "--threads", "cuda"), "PyTorch finds no graphics processor here"),
    (("--kind", "network", "--threads", "gpu"), "--threads gpu: expected 1 or more, or cuda"),
    (("--threads", "0"), "--threads 0: expected 1 or more, or cuda"),
    (("--threads", "cuda"), "--threads cuda: modes are made on the processor; leave it out")])
def test_they_are_told_before_data_are_read(tmp_path, monkeypatch, options, words):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    study, _ = generated(tmp_path)
    done = mpm_ref("rom", "train", study.path, "--data", tmp_path, "--out", tmp_path / "map.npz",
                   *options)
    assert_told(done, 2, words)
    assert not (tmp_path / "map.npz").exists()
