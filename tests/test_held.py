"""Snapshots that are larger than memory lie in files, and nothing is told apart by that."""

import errno
import re
import tempfile

import numpy as np
import pytest
from field_toys import histories

from mpm_ref import held
from mpm_ref.rom.histories import joined
from mpm_ref.rom.spanned import Sizes, spanned

SHAPE = 3, 5
SIZES = Sizes(r=1, modes=2, tau=1, C=2)


@pytest.fixture
def small(monkeypatch):
    """All arrays count as large."""
    monkeypatch.setattr(held, "LARGEST", 0)


def mapped(a):
    """Whether an array's values lie in a file."""
    while a is not None and not isinstance(a, np.memmap):
        a = a.base
    return a is not None


def test_small_arrays_are_in_memory():
    a = held.empty(SHAPE, np.float32)
    assert (a.shape, a.dtype, mapped(a)) == (SHAPE, np.float32, False)


def test_the_size_counts_in_bytes(monkeypatch):
    monkeypatch.setattr(held, "LARGEST", 60)
    assert not mapped(held.empty(SHAPE, np.float32))
    assert mapped(held.empty(SHAPE, np.float64))


@pytest.mark.usefixtures("small")
def test_large_ones_are_arrays_as_others_are():
    a = held.empty(SHAPE, np.float32)
    assert mapped(a)
    assert type(a) is np.ndarray
    a[:] = np.arange(15.0).reshape(SHAPE)
    assert np.array_equal(a.sum(axis=0), [15.0, 18.0, 21.0, 24.0, 27.0])


@pytest.mark.usefixtures("small")
def test_no_file_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    a = held.empty(SHAPE, np.float32)
    a[:] = 1.0
    del a
    assert not [*tmp_path.iterdir()]


@pytest.mark.usefixtures("small")
def test_a_full_disk_is_told_before_anything_is_written(monkeypatch, tmp_path):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(held, "reserve", full)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(OSError, match=r"no room for 5.59e-08 GiB of snapshots in "
                                      + re.escape(str(tmp_path))
                                      + r" \(No space left on device\).* set TMPDIR"):
        held.empty(SHAPE, np.float32)


def test_fields_of_them_are_the_same(monkeypatch):
    runs = [histories(runs=1)._replace(mu=np.array([[mu]]), v=np.full((1, 12, 2), mu))
            for mu in (1.0, 2.0, 3.0)]
    runs = [run._replace(x=run.x * run.mu[0], tau=run.tau * run.mu[0]) for run in runs]
    known = joined(runs)
    fields, xhat = spanned(known, SIZES, 0.3)
    monkeypatch.setattr(held, "LARGEST", 0)
    far = joined(iter(runs), 3)
    for name in ("v", "mu"):
        assert np.array_equal(getattr(far, name), [getattr(run, name)[0] for run in runs])
    for name in ("x", "tau", "C"):
        assert mapped(getattr(far, name))
        assert np.array_equal(getattr(far, name), getattr(known, name))
    again, at = spanned(far, SIZES, 0.3)
    assert np.array_equal(at, xhat)
    assert np.array_equal(again.U, fields.U)
    assert np.array_equal(again.tau.modes, fields.tau.modes)


@pytest.mark.parametrize("count", [2, 4])
def test_another_number_of_runs_than_was_said_is_refused(count):
    with pytest.raises(ValueError, match="zip"):
        joined(iter([histories(runs=1)] * 3), count)
