"""Snapshots that are larger than memory lie in files, and nothing is told apart by that."""

import errno
import os
import re
import tempfile

import numpy as np
import pytest
from field_toys import histories

from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.store import memmap

SHAPE = 3, 5
SIZES = Sizes(r=1, modes=2, tau=1, C=2)


@pytest.fixture
def small(monkeypatch):
    """All arrays count as large."""
    monkeypatch.setattr(memmap, "LARGEST", 0)


def in_file(a):
    """Whether an array's values lie in a file."""
    while a is not None and not isinstance(a, np.memmap):
        a = a.base
    return a is not None


def test_small_arrays_are_in_memory():
    a = memmap.empty(SHAPE, np.float32)
    assert (a.shape, a.dtype, in_file(a)) == (SHAPE, np.float32, False)


def test_the_size_counts_in_bytes(monkeypatch):
    monkeypatch.setattr(memmap, "LARGEST", 60)
    assert not in_file(memmap.empty(SHAPE, np.float32))
    assert in_file(memmap.empty(SHAPE, np.float64))


@pytest.mark.usefixtures("small")
def test_large_ones_are_arrays_as_others_are():
    a = memmap.empty(SHAPE, np.float32)
    assert in_file(a)
    assert type(a) is np.ndarray
    a[:] = np.arange(15.0).reshape(SHAPE)
    assert np.array_equal(a.sum(axis=0), [15.0, 18.0, 21.0, 24.0, 27.0])


@pytest.mark.usefixtures("small")
def test_no_file_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    a = memmap.empty(SHAPE, np.float32)
    a[:] = 1.0
    del a
    assert not [*tmp_path.iterdir()]


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", ["reserve", "TemporaryFile"])
def test_a_full_disk_is_told_before_anything_is_written(monkeypatch, tmp_path, name):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(memmap, name, full)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(OSError, match=r"no file for 5.59e-08 GiB of snapshots \(No space left on "
                                      r"device\): expected as much room in "
                                      + re.escape(str(tmp_path)) + "; set TMPDIR"):
        memmap.empty(SHAPE, np.float32)


def test_room_is_taken_on_the_disk():
    if not hasattr(os, "posix_fallocate"):
        pytest.skip("the system reserves no room")
    with tempfile.TemporaryFile() as file:
        memmap.reserve(file, 2**20)
        assert os.fstat(file.fileno()).st_size == 2**20
        assert os.fstat(file.fileno()).st_blocks * 512 >= 2**20


@pytest.mark.parametrize(("number", "known"), [(errno.EOPNOTSUPP, True), (errno.ENOSPC, False)])
def test_disks_that_cannot_reserve_are_tried(monkeypatch, number, known):
    def broken(*_):
        raise OSError(number, "no")

    monkeypatch.setattr(os, "posix_fallocate", broken, raising=False)
    with tempfile.TemporaryFile() as file:
        if known:
            memmap.reserve(file, 100)
            assert os.fstat(file.fileno()).st_size == 100
        else:
            with pytest.raises(OSError, match="no"):
                memmap.reserve(file, 100)


def test_fields_of_them_are_the_same(monkeypatch):
    runs = [histories(runs=1)._replace(mu=np.array([[mu]]), v=np.full((1, 12, 2), mu))
            for mu in (1.0, 2.0, 3.0)]
    runs = [run._replace(x=run.x * run.mu[0], tau=run.tau * run.mu[0]) for run in runs]
    known = join_histories(runs)
    fields, xhat = fit_pod_fields(known, SIZES, 0.3)
    monkeypatch.setattr(memmap, "LARGEST", 0)
    far = join_histories(iter(runs), 3)
    for name in ("v", "mu"):
        assert np.array_equal(getattr(far, name), [getattr(run, name)[0] for run in runs])
    for name in ("x", "tau", "C"):
        assert in_file(getattr(far, name))
        assert np.array_equal(getattr(far, name), getattr(known, name))
    again, at = fit_pod_fields(far, SIZES, 0.3)
    assert np.array_equal(at, xhat)
    assert np.array_equal(again.U, fields.U)
    assert np.array_equal(again.tau.modes, fields.tau.modes)


@pytest.mark.parametrize(("count", "words"), [(2, "more than 2 runs: expected so many"),
                                              (4, "3 runs: expected 4")])
def test_another_number_of_runs_than_was_said_is_refused(count, words):
    with pytest.raises(ValueError, match=words):
        join_histories(iter([histories(runs=1)] * 3), count)


def test_no_runs_are_refused():
    with pytest.raises(ValueError, match="0 runs: expected some"):
        join_histories([])


@pytest.mark.parametrize(("other", "words"), [
    (histories(runs=2), r"v of run 1: float64 of shape \(2, 12, 2\); expected float64 of shape "
                        r"\(1, 12, 2\), as in the first"),
    (histories(runs=1, steps=3), r"x of run 1: .* \(1, 4, 12, 2\); expected .* \(1, 5, 12, 2\)"),
    (histories(runs=1)._replace(tau=np.ones((1, 5, 12, 3), np.float32)),
     "tau of run 1: float32 .* expected float64")])
def test_runs_that_do_not_fit_each_other_are_refused(other, words):
    with pytest.raises(ValueError, match=words):
        join_histories([histories(runs=1), other])
