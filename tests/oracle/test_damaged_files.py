"""A damaged golden file is told in one sentence, before HDF5 reads it; it never departs."""

import shutil

import h5py
import numpy as np
import pytest
from command_line import SCENE, assert_told, mpm_ref
from goldens import kernel_arrays, stretched

from mpm_ref import oracle
from mpm_ref.store import seal


@pytest.fixture
def other(tmp_path):
    oracle.write(tmp_path / "other.h5", kernel_arrays(stretched()))
    return tmp_path / "other.h5"


def test_every_flipped_bit_is_told(golden, other, tmp_path):
    bad, content = tmp_path / "bad.h5", golden.read_bytes()
    rng = np.random.default_rng(0)
    for at in (0, 3792, len(content) - 1, *rng.integers(len(content), size=40)):
        bad.write_bytes(content[:at] + bytes([content[at] ^ 1 << rng.integers(8)])
                        + content[at + 1:])
        with pytest.raises(oracle.NotComparable,
                           match=r"is damaged: its bytes|it is cut short, or|be read as HDF5"):
            oracle.check(bad, other)


def test_every_cut_is_told(golden, other, tmp_path):
    bad, content = tmp_path / "bad.h5", golden.read_bytes()
    for share in (0.0, 1e-3, 0.5, 0.99):
        bad.write_bytes(content[:int(share * len(content))])
        with pytest.raises(oracle.NotComparable, match=r"cut short, or no golden|it is empty"):
            oracle.check(bad, other)


def test_damage_of_the_other_file_is_told_where_it_has_a_checksum(golden, other):
    content = bytearray(other.read_bytes())
    content[len(content) // 2] ^= 1
    other.write_bytes(content)
    with pytest.raises(oracle.NotComparable, match=r"other.h5 is damaged"):
        oracle.check(golden, other)


def test_a_file_that_other_tools_write_or_change_needs_none(golden, other):
    with h5py.File(other, "r+") as f:
        f["steps/0/mass"][0] *= 2.0
    assert seal.verify(other, seal.GOLDEN) == seal.UNSEALED
    assert oracle.check(golden, other).first.array == "mass"


def test_damage_without_a_checksum_is_told(golden, other):
    """Of the header of an array, which HDF5 itself notices when the array is opened."""
    with h5py.File(other, "r+") as f:
        f["steps/0/mass"][0] *= 1.0
        at = h5py.h5o.get_info(f["steps/0/mass"].id).addr
    content = bytearray(other.read_bytes())
    assert content[at:at + 4] == b"OHDR"
    content[at + 9] ^= 1
    other.write_bytes(content)
    with pytest.raises(oracle.NotComparable, match=r"other\.h5 cannot be read .*; expected"):
        oracle.check(golden, other)


def test_the_command_ends_with_2_and_replaces_no_damaged_file(golden, other, scene, tmp_path):
    bad = tmp_path / "bad.h5"
    shutil.copy(golden, bad)
    content = bytearray(bad.read_bytes())
    content[3792] ^= 16
    bad.write_bytes(content)
    assert_told(mpm_ref("oracle", "check", bad, other), 2, "bad.h5 is damaged")
    scene.write_text(SCENE)
    done = mpm_ref("oracle", "record", scene, "-o", bad, "--overwrite")
    assert_told(done, 2, "is not a golden file, or a damaged one")
    assert bad.read_bytes() == bytes(content)
