"""What a training says it took, also one that was cut off. Needs PyTorch."""

from types import SimpleNamespace

import pytest
import rom_toys

torch = pytest.importorskip("torch")

from mpm_ref import training  # noqa: E402
from mpm_ref.rom.study.reduce import decoder_model  # noqa: E402
from mpm_ref.rom.train import decoder  # noqa: E402
from mpm_ref.rom.train.decoder import DecoderTraining, train_decoder  # noqa: E402


@pytest.fixture
def clock(monkeypatch):
    """Time that stands still but for what is added to `t`; each epoch is saved."""
    now = SimpleNamespace(t=0.0)
    monkeypatch.setattr(training, "process_time", lambda: 10.0 + 2.0 * now.t)
    monkeypatch.setattr(training, "perf_counter", lambda: 30.0 + 3.0 * now.t)
    monkeypatch.setattr(decoder, "SAVE", 1)
    return now


def trained(clock, path, until=None):
    """A training of seven epochs, each followed by a second, that is cut off after one of them."""
    def on_epoch(history):
        clock.t += 1.0
        if len(history) == until:
            raise KeyboardInterrupt

    return train_decoder(DecoderTraining(2, (6,), epochs=7), rom_toys.snapshots(2), path, on_epoch)


def test_the_cost_of_a_training_is_that_of_all_its_parts(clock, tmp_path):
    assert trained(clock, tmp_path / "whole.pt").cost == (14.0, 21.0)
    for until in (3, 5):
        with pytest.raises(KeyboardInterrupt):
            trained(clock, tmp_path / "cut.pt", until)
        clock.t += 100.0
    assert trained(clock, tmp_path / "cut.pt").cost == (10.0, 15.0)     # two were not saved


def test_the_file_of_a_map_says_what_its_training_took(clock, tmp_path):
    data = rom_toys.snapshots(2)
    done = trained(clock, tmp_path / "a.pt")._replace(cost=training.TrainingTime(12.34, 56.78))
    about = decoder_model(done, data.X, {"seed": 3}).about
    assert (about["cpu_seconds"], about["wall_seconds"], about["seed"]) == (12.3, 56.8, 3)
