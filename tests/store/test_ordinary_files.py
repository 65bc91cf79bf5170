"""Weights that are a pipe, a device or an archive that grows are refused before they are read."""

import os
import zipfile

import numpy as np
import pytest

from mpm_ref.store import weights_file
from mpm_ref.store.weights_file import load_arrays, pack, read_checkpoint


@pytest.mark.parametrize("read", [load_arrays, read_checkpoint])
def test_a_pipe_and_a_device_are_refused(tmp_path, read):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "zero.npz").symlink_to("/dev/zero")
    for name in ("pipe.npz", "zero.npz"):
        with pytest.raises(ValueError, match="it is no ordinary file; name another one"):
            read(tmp_path / name)
    with pytest.raises(ValueError, match="No such file"):
        read(tmp_path / "none.npz")


def test_a_file_beyond_the_memory_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    path.write_bytes(pack({"a": np.zeros(100)}))
    monkeypatch.setattr("os.sysconf", lambda _: 10)
    with pytest.raises(ValueError, match="and this machine 100 B of memory"):
        load_arrays(path)


def test_a_compressed_archive_is_refused_before_it_grows(tmp_path, monkeypatch):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, a=np.zeros(1_000_000))
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = bytes(weights_file.SEAL)
    content = path.read_bytes()[:-weights_file.SEAL]
    path.write_bytes(content + weights_file.checksum(content))
    monkeypatch.setattr(weights_file.np, "load", lambda *_, **__: 1 / 0)
    with pytest.raises(ValueError, match="its arrays are compressed, which no file of ours is"):
        load_arrays(path)
