"""Several writers begin the same file at once: one of them wins, and nothing of it is lost."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_runs import colliding

from mpm_ref.store import atomic, journal, running
from mpm_ref.store.journal import InUse, JournaledFile
from mpm_ref.store.results import Results
from mpm_ref.store.running import Refused, run
from mpm_ref.store.writer import StoredFields, create

ROOT = Path(__file__).resolve().parents[2]

# A run that stands still while it lays out its results, until it is told to go on.
SLOW = """
import sys, time
from pathlib import Path
sys.path.insert(0, "tests/support")
from small_runs import colliding
from mpm_ref.store import writer
from mpm_ref.store.running import run
out, lay_out = Path(sys.argv[1]), writer._lay_out
def slow(*arguments):
    lay_out(*arguments)
    out.with_suffix(".began").touch()
    while not out.with_suffix(".go").exists():
        time.sleep(0.01)
writer._lay_out = slow
print(run(colliding(), out).frames)
"""


def wait_for(path, process):
    while process.poll() is None and not path.exists():
        time.sleep(0.01)
    assert path.exists(), process.communicate()[1]


def test_the_first_of_two_writers_of_a_new_file_wins(tmp_path):
    out = tmp_path / "run.h5"
    first = subprocess.Popen([sys.executable, "-c", SLOW, out], cwd=ROOT, text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_for(tmp_path / "run.began", first)
    with pytest.raises(InUse, match=f"{out} is being written by another process"):
        create(out, colliding(), StoredFields(), {"made": "second"})
    (tmp_path / "run.go").touch()
    said, faults = first.communicate(timeout=60)
    assert (first.returncode, said) == (0, "6\n"), faults
    with Results(out) as results:
        assert results.step[-1] == 100
        assert results.manifest["parts"][0]["why"] == "finished"


def test_a_run_that_another_overtook_does_not_replace_it(tmp_path, monkeypatch):
    out, start = tmp_path / "run.h5", running.start

    def overtaken(problem, stepper):
        monkeypatch.setattr(running, "start", start)
        run(colliding(), out)
        return start(problem, stepper)

    monkeypatch.setattr(running, "start", overtaken)
    with pytest.raises(Refused, match="exists: add --resume"):
        run(colliding(source="other"), out)
    with Results(out) as results:
        assert results.manifest["scene"] == "colliding"


def test_a_file_moved_before_it_is_locked_is_left_alone(tmp_path, monkeypatch):
    """Another writer's new file, opened here before it took its place, is not emptied."""
    path, part, lock = tmp_path / "run.h5", tmp_path / ".run.part.h5", journal._lock
    part.write_bytes(b"theirs")

    def late(file, name):
        monkeypatch.setattr(journal, "_lock", lock)
        part.rename(path)
        lock(file, name)

    monkeypatch.setattr(journal, "_lock", late)
    with JournaledFile(part, new=True) as file:
        file.write(b"ours")
        file.commit()
    assert (path.read_bytes(), part.read_bytes()) == (b"theirs", b"ours")
    assert atomic.part_of(path) == part
