import io
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.store import atomic
from mpm_ref.store.atomic import NotWritten, replacing, require_space, size_text
from mpm_ref.store.journal import PAGE, Damaged, JournaledFile, journal_of, new_hdf5, recover

ROOT = Path(__file__).resolve().parents[2]
writes = st.tuples(st.integers(0, 3 * PAGE), st.binary(min_size=1, max_size=2 * PAGE))
steps = st.lists(st.one_of(writes, st.just("commit")), max_size=12)


def put(image, at, data):
    image.extend(bytes(max(at + len(data) - len(image), 0)))
    image[at:at + len(data)] = data


@given(steps)
def test_only_what_was_committed_stands(tmp_path_factory, steps):
    path = tmp_path_factory.mktemp("journal") / "file"
    now, committed = bytearray(), b""
    file = JournaledFile(path, new=True)
    for step in steps:
        if step == "commit":
            file.commit()
            committed = bytes(now)
        else:
            at, data = step
            file.seek(at)
            file.write(data)
            put(now, at, data)
        file.seek(0)
        assert file.read(len(now)) == now
        assert path.read_bytes()[:len(committed)] == committed
    file.close()
    again = JournaledFile(path)
    assert again.read(len(committed)) == committed
    again.close()


# A run of h5py on our file object, killed at the k-th call of the system, for every k. Children are
# forked by a fresh interpreter, which has no threads.
KILLED = """
import os, sys
from pathlib import Path
import h5py, numpy as np
from mpm_ref.store import atomic, checksums, journal
path, checked = Path(sys.argv[1]), sys.argv[2] == "checked"

def new():
    file = journal.JournaledFile(path, new=True, checked=checked)
    with h5py.File(file, "w", libver=journal.LIBVER, userblock_size=512 * checked) as h5:
        h5.create_dataset("x", (0, 3000), "f8", maxshape=(None, 3000), chunks=(1, 1000),
                          fletcher32=True)
    file.commit()
    file.close()

class Mortal:
    def __init__(self, k):
        self.left = k
    def __getattr__(self, name):
        real = getattr(os, name)
        if name not in ("pwrite", "fsync", "replace", "ftruncate", "open"):
            return real
        def call(*arguments):
            self.left -= 1
            if self.left < 0:
                if name == "pwrite":        # half of the bytes are there
                    real(arguments[0], arguments[1][:len(arguments[1]) // 2], arguments[2])
                os._exit(9)
            return real(*arguments)
        return call

def write(frames):
    file = journal.JournaledFile(path, checked=checked)
    h5 = h5py.File(file, "r+", libver=journal.LIBVER)
    for k in range(frames):
        h5["x"].resize(k + 1, axis=0)
        h5["x"][k] = np.full(3000, float(k))
        h5.flush()
        file.commit()
        path.with_suffix(".count").write_text(str(k + 1))

seen = set()
for k in range(10_000):
    new()
    path.with_suffix(".count").write_text("0")
    child = os.fork()
    if child == 0:
        atomic.os = journal.os = Mortal(k)
        write(3)
        os._exit(0)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    kept = int(path.with_suffix(".count").read_text())
    journal.recover(path)
    if checked:
        checksums.require_intact(open(path, "rb", buffering=0))
    with h5py.File(path) as h5:
        x = h5["x"][()]
    assert len(x) in (kept, kept + 1), (k, len(x), kept)
    assert (x == np.arange(len(x))[:, None]).all(), k
    assert not journal.journal_of(path).exists()
    seen.add((len(x), len(x) - kept))
    if status == 0:
        break
print(k, sorted(seen))
"""


@pytest.mark.parametrize("kind", ["plain", "checked"])
def test_killed_at_any_call_every_committed_frame_stands(tmp_path, kind):
    done = subprocess.run([sys.executable, "-c", KILLED, tmp_path / "x.h5", kind], cwd=ROOT,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    calls, seen = done.stdout.split(" ", 1)
    assert int(calls) > 30
    # Killed in a frame it is lost, or, once its journal stood, kept.
    assert seen.strip() == "[(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (3, 0), (3, 1)]"


# The system refuses to let files grow: h5py itself would end in a segmentation fault.
REFUSED = """
import resource, sys
import h5py, numpy as np
from mpm_ref.store import journal
from mpm_ref.store.atomic import NotWritten
path = sys.argv[1]
with journal.new_hdf5(path) as h5:
    h5["kept"] = np.arange(10.0)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
file = journal.JournaledFile(path)
h5 = h5py.File(file, "r+")
h5["lost"] = np.zeros(100_000)
try:
    h5.flush()
    file.commit()
except NotWritten as fault:
    print(fault)
h5.close()
file.close()
with h5py.File(path) as h5:
    print(list(h5), h5["kept"][()].sum())
"""


def test_refused_write_leaves_the_last_commit(tmp_path):
    done = subprocess.run([sys.executable, "-c", REFUSED, tmp_path / "x.h5"], cwd=ROOT,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said, held = done.stdout.splitlines()
    assert "could not be written: File too large" in said
    assert held == "['kept'] 45.0"


def test_one_writer_at_a_time(tmp_path):
    path = tmp_path / "x.h5"
    with new_hdf5(path) as h5:
        h5["x"] = 1
    code = f"from mpm_ref.store.journal import *; JournaledFile({str(path)!r})"
    file = JournaledFile(path)
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert "is being written by another process" in done.stderr
    file.close()
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_damaged_journal_is_told(tmp_path):
    path = tmp_path / "x.h5"
    path.write_bytes(b"whole")
    journal_of(path).write_bytes(b"not a journal")
    with pytest.raises(Damaged, match="remove the journal"):
        recover(path)
    assert path.read_bytes() == b"whole"


def test_file_object_behaves_like_a_file(tmp_path):
    with JournaledFile(tmp_path / "x", new=True) as file:
        assert all((file.readable(), file.writable(), file.seekable()))
        file.write(b"abc")
        file.truncate(5)
        assert file.seek(0, io.SEEK_END) == 5
        assert file.seek(-4, io.SEEK_CUR) == file.tell() == 1
        assert file.read() == b"bc\0\0"
        file.commit()
    assert (tmp_path / "x").read_bytes() == b"abc\0\0"


def test_missing_file_is_told(tmp_path):
    with pytest.raises(NotWritten, match="No such file"):
        JournaledFile(tmp_path / "none.h5")


def test_replacing_keeps_the_old_file_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "a.png"
    path.write_text("old")

    def half_write():
        with replacing(path) as part:
            assert part.suffix == ".png"
            part.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        half_write()
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]
    with open(path) as reader:
        with replacing(path) as part:
            part.write_text("new")
            assert path.read_text() == "old"
        assert reader.read() == "old"           # a new file, not new content of the old one
    assert [file.read_text() for file in tmp_path.iterdir()] == ["new"]


def test_replacing_tells_what_the_system_refuses(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(NotWritten, match="No space left"), replacing(tmp_path / "a") as part:
        part.write_text("new")
    assert not list(tmp_path.iterdir())


def test_space_is_asked_for_first(tmp_path, monkeypatch):
    require_space(tmp_path / "a", 10)
    with pytest.raises(NotWritten, match="no folder"):
        require_space(tmp_path / "none" / "a", 10)
    free = type("Usage", (), {"free": 5_000_000})
    monkeypatch.setattr(atomic.shutil, "disk_usage", lambda _: free)
    with pytest.raises(NotWritten, match=r"4 GB needed, 5 MB free"):
        require_space(tmp_path / "a", 4_000_000_000)


@pytest.mark.parametrize(("size", "words"), [(12, "12 B"), (1.5e9, "1.5 GB"), (2e15, "2e+03 TB")])
def test_sizes_as_text(size, words):
    assert size_text(size) == words


def test_plain_tools_read_while_a_writer_works(tmp_path):
    path = tmp_path / "x.h5"
    with new_hdf5(path) as h5:
        h5.create_dataset("x", (0, 500), "f8", maxshape=(None, 500), chunks=(1, 500))
    file = JournaledFile(path)
    h5 = h5py.File(file, "r+")
    for k in range(40):
        h5["x"].resize(k + 1, axis=0)
        h5["x"][k] = np.full(500, float(k))
        h5.flush()                              # everything but the commit
        with h5py.File(path) as seen:
            assert len(seen["x"]) == k
        file.commit()
        with h5py.File(path) as seen:
            assert (seen["x"][k] == k).all()
    h5.close()
    file.close()
