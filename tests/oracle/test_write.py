"""What is no list of steps with arrays of numbers is refused in one sentence, where it is written
and where it is read.
"""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from goldens import kernel_arrays, stretched

from mpm_ref import oracle


@pytest.mark.parametrize(("steps", "message"), [
    ({"mass": np.ones(3)}, "steps is a dict: expected a list with a dictionary of arrays"),
    (np.ones(3), "steps is a ndarray"),
    ([[np.ones(3)]], r"steps\[0\] is a list: expected a dictionary of arrays"),
    ([{"mass": "heavy"}], "array 'mass' has the type <U5: expected real numbers"),
    ([None, {"jelly/x": [1j]}], "array 'jelly/x' has the type complex128: expected real numbers"),
    ([{"nodes": np.ones((3, 2))}], "array 'nodes' has the type float64: expected whole numbers"),
    ([{"jelly/id": np.ones(3)}], "array 'jelly/id' has the type float64: expected whole numbers"),
])
def test_what_is_no_array_of_numbers_is_not_written(steps, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        oracle.write(tmp_path / "other.h5", steps)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "value", "message"), [
    ("mass", "heavy", "array 'mass' has the type object: expected real numbers"),
    ("nodes", [1, 2, 3], r"nodes has shape \(3,\): expected \(M, 2\) integer coordinates"),
    ("nodes", 1.0, "array 'nodes' has the type float64: expected whole numbers"),
])
def test_nor_read(golden, name, value, message, tmp_path):
    other = tmp_path / "other.h5"
    oracle.write(other, kernel_arrays(stretched()))
    with h5py.File(other, "r+") as f:
        del f[f"steps/0/{name}"]
        f[f"steps/0/{name}"] = value
    with pytest.raises(oracle.NotComparable, match=message):
        oracle.check(golden, other)


def test_an_id_that_is_one_number_departs(golden, checked):
    theirs = kernel_arrays(stretched())
    theirs[0]["jelly/id"] = 1
    assert "jelly/id does not number its" in checked(theirs).first.what


def test_steps_that_are_no_group_are_told(golden, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as f:
        f["steps"] = np.ones(3)
    with pytest.raises(oracle.NotComparable, match="no group 'steps'"):
        oracle.check(golden, tmp_path / "other.h5")


FULL_DISK = """
import resource, signal, sys
sys.path[:0] = [{support!r}]
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from goldens import kernel_arrays, stretched
from mpm_ref import oracle
from mpm_ref.store.atomic import NotWritten
arrays = kernel_arrays(stretched(), 1)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    oracle.write(sys.argv[1], arrays)
except NotWritten as fault:
    print(fault)
"""


def test_a_full_disk_is_told(tmp_path):
    """In a process of its own, which HDF5 crashed when a file could not grow."""
    support = str(Path(__file__).parents[1] / "support")
    done = subprocess.run([sys.executable, "-c", FULL_DISK.format(support=support),
                           tmp_path / "other.h5"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "other.h5 could not be written: File too large" in done.stdout
    assert not list(tmp_path.iterdir())
