"""A file of another program that makes HDF5 hang, crash or ask for memory is told, status 2."""

import json
import os
import random
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from goldens import kernel_arrays, stretched

from mpm_ref import oracle
from mpm_ref.store import foreign


@pytest.fixture
def mine(tmp_path):
    """The other code's arrays in a file that h5py wrote, without our checksum."""
    oracle.write(tmp_path / "sealed.h5", kernel_arrays(stretched()))
    with h5py.File(tmp_path / "sealed.h5") as sealed, h5py.File(tmp_path / "mine.h5", "w") as f:
        sealed.copy("steps", f)
    return tmp_path / "mine.h5"


def test_a_file_of_another_program_is_compared(golden, mine):
    assert oracle.check(golden, mine).agrees
    with h5py.File(mine, "r+") as f:
        f["steps/0/mass"][0] *= 2.0
    assert oracle.check(golden, mine).first.array == "mass"


@pytest.mark.parametrize("soft", [True, False], ids=["soft", "hard"])
def test_links_inside_a_file_are_followed_under_each_name(golden, mine, soft):
    """A wrong array that stands under another name too is compared, not left out."""
    with h5py.File(mine, "r+") as f:
        f["elsewhere"] = 2.0 * f["steps/0/mass"][()]
        del f["steps/0/mass"]
        f["steps/0/mass"] = h5py.SoftLink("/elsewhere") if soft else f["elsewhere"]
        f["steps/0/again"] = f["elsewhere"]
    assert oracle.check(golden, mine).first.array == "mass"


def test_a_group_within_itself_and_a_link_to_another_file(golden, mine, tmp_path):
    with h5py.File(mine, "r+") as f:
        f["steps/0/self"] = f["steps"]
    assert oracle.check(golden, mine).agrees
    with h5py.File(mine, "r+") as f:
        f["steps/0/other"] = h5py.ExternalLink(str(tmp_path / "sealed.h5"), "/steps")
    assert_told(mpm_ref("oracle", "check", golden, mine), 2, "0/other lies in another file")


def test_entries_that_were_never_written_and_a_lower_limit_of_memory(mine, tmp_path):
    with h5py.File(tmp_path / "small.h5", "w") as f:
        f.create_dataset("steps/0/sparse", (2_000_000,), "f8", chunks=(100_000,))
    with foreign.copied(tmp_path / "small.h5", "steps") as copy, h5py.File(copy) as f:
        assert not f["steps/0/sparse"][()].any()
    command = f"ulimit -v 1900000; exec {sys.executable} -m mpm_ref.store.foreign " \
              f"{mine} steps {tmp_path / 'copy.h5'} 20"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_array_in_a_pipe_is_not_waited_for(golden, mine, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(mine, "r+") as f:
        del f["steps/0/mass"]
        f.create_dataset("steps/0/mass", (8,), "f8", external=[(str(tmp_path / "pipe"), 0, 64)])
    assert_told(mpm_ref("oracle", "check", golden, mine), 2, "mass lies in other files")


def test_an_array_larger_than_the_file_is_told(golden, mine):
    with h5py.File(mine, "r+") as f:
        del f["steps/0/mass"]
        f.create_dataset("steps/0/mass", (1 << 40,), "f8", chunks=(8,))
    assert_told(mpm_ref("oracle", "check", golden, mine), 2,
                "mass has the shape (1099511627776,), more than a file of this size holds")


def test_text_in_place_of_numbers_is_told(golden, mine):
    with h5py.File(mine, "r+") as f:
        del f["steps/0/mass"]
        f["steps/0/mass"] = ["a", "b"]
    assert_told(mpm_ref("oracle", "check", golden, mine), 2, "'mass' has the type object")


@pytest.mark.parametrize(("body", "words"), [
    ("os.kill(os.getpid(), 11)", "HDF5 breaks down on it (SIGSEGV)"),
    ("while True: pass", "HDF5 does not come to an end with it"),
    ("bytearray(1 << 44)", "HDF5 asks for more memory"),
    ("raise RuntimeError('two\\nlines')", "two lines"),
], ids=["crash", "hang", "memory", "error"])
def test_what_becomes_of_the_process_is_told(golden, mine, tmp_path, monkeypatch, body, words):
    """HDF5 in the other process is made to misbehave; no file that does so is certain to."""
    (tmp_path / "python").write_text(
        f"#!{sys.executable}\nimport os, sys\nfrom mpm_ref.store import foreign\n\n"
        f"def misbehave(*_):\n    {body}\n\nforeign.copy_arrays = misbehave\n"
        "sys.exit(foreign.main(*sys.argv[4:7], int(sys.argv[7])))\n")
    (tmp_path / "python").chmod(0o755)
    monkeypatch.setattr(foreign.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(foreign, "SECONDS", 1)
    assert_told(mpm_ref("oracle", "check", golden, mine), 2, "mine.h5 cannot be read", words)


def test_a_process_that_waits_is_ended(mine, tmp_path, monkeypatch):
    (tmp_path / "python").write_text("#!/bin/sh\nexec sleep 100\n")
    (tmp_path / "python").chmod(0o755)
    monkeypatch.setattr(foreign.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(foreign, "SECONDS", 1)
    monkeypatch.setattr(foreign, "WAIT", 0.5)
    with (pytest.raises(foreign.Unreadable, match="does not come to an end"),
          foreign.copied(mine, "steps")):
        pass


FLIPS = """
import json, os, sys
from pathlib import Path
from mpm_ref.store import foreign
path, out = Path(sys.argv[1]), Path(sys.argv[1] + ".copy")
content, endings = path.read_bytes(), []
for at, bit in json.loads(sys.argv[2]):
    bad = bytearray(content)
    bad[at] ^= 1 << bit
    path.write_bytes(bad)
    out.unlink(missing_ok=True)
    if not (child := os.fork()):
        sys.stdout = open(os.devnull, "w")
        os._exit(foreign.main(str(path), "steps", str(out), 5))
    endings.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
print(json.dumps(endings))
"""


def test_flipped_bits_of_the_tables_end_the_process(mine):
    """A sentence, a copy or a signal that the parent tells: nothing else, and never no end."""
    rng, ends = random.Random(0), (0, foreign.REFUSED, -signal.SIGSEGV, -signal.SIGXCPU,
                                   -signal.SIGABRT, -signal.SIGKILL)
    flips = [(rng.randrange(8000), rng.randrange(8)) for _ in range(200)]
    done = subprocess.run([sys.executable, "-c", FLIPS, mine, json.dumps(flips)], check=True,
                          capture_output=True)
    endings = json.loads(done.stdout)
    assert len(endings) == len(flips)
    assert set(endings) <= set(ends)
    assert np.mean([end == foreign.REFUSED for end in endings]) > 0.02


FULL_DISK = """
import resource, signal, sys
from mpm_ref.store import foreign
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    with foreign.copied(sys.argv[1], "steps"):
        pass
except foreign.Unreadable as fault:
    print(fault)
"""


def test_a_full_temporary_folder_is_not_the_fault_of_the_file(mine):
    done = subprocess.run([sys.executable, "-c", FULL_DISK, mine], capture_output=True, text=True,
                          check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "no copy fits in" in done.stdout
    assert "File too large; set TMPDIR to a folder with room" in done.stdout
