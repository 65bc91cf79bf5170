"""Snapshots of studies with model = "nsf" that do not fit into memory, or onto the disk."""

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_nsf_studies import modelled

from mpm_ref.rom.study import dataset
from mpm_ref.rom.study.study import load
from mpm_ref.store import memmap


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its fields."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_snapshots_without_room_end_the_command(made, tmp_path, monkeypatch, command):
    def full(*_):
        raise OSError("no file for 9 GiB of snapshots")

    monkeypatch.setattr(dataset, "empty", full)
    given = ("--map", made / "fields.npz") if command == "evaluate" else ()
    done = mpm_ref("rom", command, made / "pairs.toml", "--data", made / "data", *given, "--out",
                   tmp_path / ("e.png" if given else "e.npz"))
    assert_told(done, 4, "no file for 9 GiB of snapshots")
    assert not [*tmp_path.iterdir()]


def test_snapshots_may_lie_in_files(made, monkeypatch):
    pairs = load(made / "pairs.toml")
    known = dataset.load_histories(pairs, made / "data", pairs.train)
    monkeypatch.setattr(memmap, "LARGEST", 0)
    far = dataset.load_histories(pairs, made / "data", pairs.train)
    for name in ("x", "tau", "C"):
        assert isinstance(getattr(far, name).base, np.memmap)
        assert np.array_equal(getattr(far, name), getattr(known, name))
