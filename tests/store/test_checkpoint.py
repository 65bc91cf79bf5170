from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_runs import ENERGY, colliding, state_of

from mpm_ref.core.state import NONE
from mpm_ref.monitor import Account
from mpm_ref.store import atomic, checkpoint
from mpm_ref.store.atomic import NotWritten
from mpm_ref.store.checkpoint import BadCheckpoint, digest, load, save
from mpm_ref.store.manifest import scene_hash, source_hash


@pytest.fixture
def problem():
    return colliding()


def variant(problem, kind):
    """States that carry different fields."""
    state = state_of(problem)
    body = state.bodies[0]
    q = body.particles
    if kind == "apic":
        q = q._replace(C=q.L + 1.0)
    if kind == "pic":
        q = q._replace(C=NONE)
    if kind == "history":
        q = q._replace(y=np.random.default_rng(1).random(len(q.x)), b=q.v + 1.0)
    if kind == "fluid":
        q = q._replace(F=q.F[:, 0, 0].copy(), tau=q.tau[:, 0, 0].copy())
    account = None if kind == "moving" else state.account
    bound = np.inf if kind == "unbounded" else state.bound
    return replace(state, bodies=(body._replace(particles=q), state.bodies[1]),
                   account=account, bound=bound)


@pytest.mark.parametrize("kind", ["mls", "apic", "pic", "history", "fluid", "moving", "unbounded"])
def test_a_checkpoint_holds_the_whole_state(tmp_path, problem, kind):
    state = variant(problem, kind)
    save(tmp_path / "run.checkpoint.h5", state, problem)
    again, same_code = load(tmp_path / "run.checkpoint.h5", problem)
    assert same_code
    assert digest(again) == digest(state)
    assert (again.step, again.t, again.frame, again.bound) == (
        state.step, state.t, state.frame, state.bound)
    assert again.account == state.account
    for a, b in zip(again.bodies, state.bodies, strict=True):
        assert (a.particles.C is a.particles.L) == (b.particles.C is b.particles.L)
        assert (a.law, a.flow, a.name) == (b.law, b.flow, b.name)
        for x, y in zip((*a.particles, a.id), (*b.particles, b.id), strict=True):
            assert x.dtype == y.dtype
            np.testing.assert_array_equal(x, y)


def test_the_digest_sees_every_part_of_a_state(problem):
    state = state_of(problem)
    changes = [{"step": 1}, {"t": np.nextafter(state.t, 1.0)}, {"frame": 4}, {"bound": np.inf},
               {"account": None}, {"account": Account(ENERGY, 0.0)}]
    seen = [digest(state), *(digest(replace(state, **change)) for change in changes)]
    for a in (*state.bodies[1].particles, state.bodies[1].id):
        if a.size:
            a.reshape(-1)[-1] += 1
            seen.append(digest(state))
    assert len(seen) == len(set(seen)) == 1 + 6 + 9


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "run.checkpoint.h5"
    save(path, state_of(colliding()), colliding())
    return path


@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_any_flipped_bit_is_told(saved, place, bit):
    damaged = bytearray(saved.read_bytes())
    damaged[int(place * len(damaged))] ^= 1 << bit
    copy = saved.with_name("damaged.h5")
    copy.write_bytes(damaged)
    with pytest.raises(BadCheckpoint, match=r"is damaged|cut short or is not"):
        load(copy, colliding())


@given(st.floats(0, 1, exclude_max=True))
def test_any_cut_is_told(saved, share):
    content = saved.read_bytes()
    copy = saved.with_name("cut.h5")
    copy.write_bytes(content[:int(share * len(content))])
    with pytest.raises(BadCheckpoint, match="cut short or is not a checkpoint"):
        load(copy, colliding())


def test_foreign_checkpoints_are_told(saved, tmp_path, problem):
    with pytest.raises(BadCheckpoint, match="no such checkpoint"):
        load(tmp_path / "none.h5", problem)
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as h5:
        h5["x"] = 1
    with pytest.raises(BadCheckpoint, match="not a checkpoint"):
        load(other, problem)
    with pytest.raises(BadCheckpoint, match="belongs to another scene"):
        load(saved, replace(problem, source="other"))
    with pytest.raises(BadCheckpoint, match="other bodies"):
        load(saved, replace(problem, bodies=problem.bodies[:1]))
    assert checkpoint.is_checkpoint(saved)
    assert not checkpoint.is_checkpoint(other)


def test_a_checkpoint_of_other_code_says_so(saved, problem, monkeypatch):
    monkeypatch.setattr(checkpoint, "source_hash", lambda: "other")
    assert not load(saved, problem)[1]


def test_a_checkpoint_is_plain_hdf5(saved):
    with h5py.File(saved) as h5:
        assert h5["bodies/0/x"].fletcher32
        assert h5.attrs["scene_sha256"] == scene_hash(colliding())
        assert h5.attrs["source_sha256"] == source_hash()


@pytest.mark.parametrize("full", ["before", "while"])
def test_a_full_disk_keeps_the_checkpoint_before(tmp_path, problem, monkeypatch, full):
    path = tmp_path / "run.checkpoint.h5"
    save(path, state_of(problem, 0), problem)

    def refuse(*_):
        raise OSError(28, "No space left on device")

    if full == "before":
        usage = type("Usage", (), {"free": 1000})
        monkeypatch.setattr(atomic.shutil, "disk_usage", lambda _: usage)
    else:
        monkeypatch.setattr("mpm_ref.store.journal.os.pwrite", refuse)
    with pytest.raises(NotWritten, match=r"1 kB free|No space left"):
        save(path, state_of(problem, 1), problem)
    monkeypatch.undo()
    assert digest(load(path, problem)[0]) == digest(state_of(problem, 0))
    assert list(tmp_path.iterdir()) == [path]
