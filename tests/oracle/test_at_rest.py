"""A golden step of a body at rest: arrays that are 0 everywhere allow no difference at all."""

import h5py
import numpy as np
import pytest
from goldens import ON_NODES
from problems import DX, FREE, JELLY, ball

from mpm_ref import oracle
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow
from mpm_ref.oracle.schema import ARRAYS
from mpm_ref.problem import Clock, Problem

NAMES = [a.name for a in ARRAYS if a.name != "y"]      # a jelly has no history


def at_rest():
    """One disk that nothing moves but, where it is not 0, gravity."""
    body = ball("jelly", (0.31, 0.13), JELLY, NoFlow())
    return Problem((body,), DX, Clock(dt=1e-3, steps=9), np.array([0.0, -9.8]), Scheme(), FREE)


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    path = tmp_path_factory.mktemp("golden") / "golden.h5"
    oracle.record(at_rest(), path, 1)
    return path


@pytest.fixture
def theirs(golden):
    with h5py.File(golden) as f:
        step = f["steps/0"]
        return {"nodes": step["nodes"][()], **{key_of(name): step[key_of(name)][()]
                                               for name in NAMES}}


def key_of(name):
    return name if name in ON_NODES else f"jelly/{name}"


def test_momentum_is_zero_and_may_be_nothing_else(golden, checked, theirs):
    with h5py.File(golden) as f:
        assert not f["steps/0/scale/momentum"][()].any()
    report = checked([theirs])
    assert report.agrees
    assert report.nearest == 0.0
    theirs["momentum"][3, 1] = 1000.0
    first = checked([theirs]).first
    assert (first.array, first.golden, first.other, first.tolerance) == ("momentum", 0, 1000.0, 0)
    assert first.sentence.endswith("the difference 1e+03 is more than its tolerance, 0")


@pytest.mark.parametrize("change", [1000.0, 1e-300, 1e300, np.nan, -np.inf])
@pytest.mark.parametrize("name", NAMES)
def test_a_change_of_any_entry_is_caught(name, change, checked, theirs):
    """One of 1e-300 only where the tolerance is 0: elsewhere it is less than round-off."""
    key = key_of(name)
    a = theirs[key]
    a.flat[-1] += change
    report = checked([theirs])
    with_room = change == 1e-300 and name not in ("momentum",)
    assert report.agrees is with_room
    if not with_room:
        assert [d.array for d in report.departures] == [key]
        assert str(report)
        assert report.json


@pytest.mark.parametrize("change", [1000.0, 1e-300])
def test_what_is_not_zero_at_a_node_without_mass_is_caught(change, checked, theirs):
    theirs["nodes"] = np.concatenate([theirs["nodes"], [[99, 99]]])
    for name in ON_NODES:
        theirs[name] = np.concatenate([theirs[name], 0.0 * theirs[name][:1]])
    assert checked([theirs]).agrees
    theirs["momentum"][-1, 0] = change
    first, = checked([theirs]).departures
    assert first.array == "momentum"
    assert "at a node where the golden file has 0" in first.what
