import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from small_runs import ENERGY, block, colliding, frame_of, state_of

from mpm_ref.store import atomic, writer
from mpm_ref.store.atomic import NotWritten
from mpm_ref.store.manifest import RunPart, manifest, scene_hash, source_hash
from mpm_ref.store.results import SCALARS, UNITS, BadResults, Results
from mpm_ref.store.writer import StoredFields, create, reopen


def written(path, problem, states, fields=None):
    writer = create(path, problem, fields or StoredFields(), {"made": "here"})
    for k, state in enumerate(states):
        writer.append(frame_of(state, k), ENERGY)
    writer.close()
    return path


@pytest.fixture
def problem():
    return colliding()


@pytest.fixture
def results(tmp_path, problem):
    return written(tmp_path / "run.h5", problem, [state_of(problem, k) for k in range(3)])


# Results.

def test_frames_come_back_in_the_order_of_sampling(tmp_path, problem):
    states = [state_of(problem, k) for k in range(3)]
    path = written(tmp_path / "run.h5", problem, states, StoredFields(tuple(UNITS)))
    with Results(path) as results:
        assert len(results) == 3
        assert results.bodies == ["left", "right"]
        assert results.fields("left") == ["x", "v", "C", "L", "F", "tau"]
        np.testing.assert_array_equal(results.energy, [ENERGY] * 3)
        np.testing.assert_array_equal(results.time, [s.t for s in states])
        np.testing.assert_array_equal(results.step, [s.step for s in states])
        for k, state in enumerate(states):
            for body in state.bodies:
                for name in results.fields(body.name):
                    stored = results.field(body.name, name, k)
                    np.testing.assert_array_equal(stored[body.id], getattr(body.particles, name))


def test_what_does_not_change_is_stored_once(results, problem):
    with Results(results) as r:
        assert (r.title, r.dim, r.dx, r.degree) == ("two blocks", 2, problem.dx, 2)
        np.testing.assert_array_equal(r.gravity, problem.gravity)
        np.testing.assert_array_equal(r.field("left", "m"), problem.bodies[0].particles.m)
        law = json.loads(r.h5["bodies/left"].attrs["law"])
        assert law == {"type": "FixedCorotated", **problem.bodies[0].law._asdict()}


def test_a_fluid_stores_its_volume_ratio(tmp_path, problem):
    fluid = replace(problem, bodies=(block("water", (0.0, 0.0), (0.0, 0.0), fluid=True),))
    state = state_of(fluid)
    with Results(written(tmp_path / "run.h5", fluid, [state])) as r:
        assert r.fields("water") == ["x", "v", "J", "tau"]
        q, id = state.bodies[0].particles, state.bodies[0].id
        np.testing.assert_array_equal(r.scalar("water", "J", 0)[id], q.F)
        np.testing.assert_array_equal(r.scalar("water", "tau", 0)[id], np.sqrt(2.0) * q.tau)
        np.testing.assert_array_equal(r.scalar("water", "pressure", 0)[id], -q.tau / q.F)


def test_scalars(results, problem):
    with Results(results) as r:
        q, id = state_of(problem, 2).bodies[1].particles, state_of(problem, 2).bodies[1].id
        expected = {
            "speed": np.hypot(*q.v.T),
            "J": q.F[:, 0, 0] * q.F[:, 1, 1] - q.F[:, 0, 1] * q.F[:, 1, 0],
            "tau": np.sqrt((q.tau**2).sum(axis=(1, 2))),
            "pressure": -0.5 * (q.tau[:, 0, 0] + q.tau[:, 1, 1]) / np.linalg.det(q.F),
            "body": np.ones(len(id)),
        }
        for name, value in expected.items():
            np.testing.assert_allclose(r.scalar("right", name, -1)[id], value, rtol=1e-12)
        assert [name for name in SCALARS if r.offers(name)] == list(expected)
        with pytest.raises(BadResults, match="y of body 'right' is not stored; stored are"):
            r.scalar("right", "y", 0)
        with pytest.raises(BadResults, match="expected one of speed, J"):
            r.scalar("right", "colour", 0)
        with pytest.raises(BadResults, match="there is no frame 3; it has 3"):
            r.scalar("right", "J", 3)


def test_compression_changes_no_value(tmp_path, problem):
    states = [state_of(problem)]
    plain = written(tmp_path / "plain.h5", problem, states)
    small = written(tmp_path / "small.h5", problem, states, StoredFields(gzip=4))
    with Results(plain) as a, Results(small) as b:
        assert b.h5["bodies/left/x"].compression == "gzip"
        np.testing.assert_array_equal(a.field("left", "tau", 0), b.field("left", "tau", 0))


@pytest.mark.parametrize("fields", [{"names": ("v",)}, {"names": ("x", "colour")}, {"gzip": 10}])
def test_fields_are_checked(fields):
    with pytest.raises(ValueError, match="expected"):
        StoredFields(**fields)


@pytest.mark.parametrize("name", ["", ".", "a/b", "right"])
def test_names_of_bodies_are_checked(tmp_path, problem, name):
    bodies = (problem.bodies[0]._replace(name=name), problem.bodies[1])
    with pytest.raises(ValueError, match="names that differ"):
        create(tmp_path / "run.h5", replace(problem, bodies=bodies), StoredFields(), {})


def test_everything_is_checksummed(results):
    checked = []
    with h5py.File(results) as h5:
        h5.visititems(lambda name, item: checked.append((name, item.fletcher32))
                      if isinstance(item, h5py.Dataset) and name != "manifest" else None)
    assert len(checked) == 4 + 2 * 6
    assert all(has for _, has in checked)


@pytest.mark.parametrize(("content", "words"), [
    (b"", r"cannot be read as HDF5 .* and whole\?"),
    (b"junk" * 1000, r"cannot be read as HDF5 .* and whole\?"),
    (None, "is damaged .it is cut short, or its checksums are damaged.; take a copy"),
], ids=["empty", "junk", "cut short"])
def test_unreadable_files_are_told(results, content, words):
    results.write_bytes(results.read_bytes()[:5000] if content is None else content)
    with pytest.raises(BadResults, match=words):
        Results(results)


def test_foreign_files_are_told(tmp_path):
    with pytest.raises(BadResults, match="no such file"):
        Results(tmp_path / "none.h5")
    with h5py.File(tmp_path / "other.h5", "w") as h5:
        h5["x"] = 1
    with pytest.raises(BadResults, match="not a results file of mpm_ref"):
        Results(tmp_path / "other.h5")


def test_results_go_on_after_a_frame(results, problem):
    writer = reopen(results, problem, 2)
    assert len(writer) == 2
    writer.append(frame_of(state_of(problem, 7), 2), ENERGY)
    writer.put_manifest({"parts": [1]})
    assert writer.manifest == {"parts": [1]}
    writer.close()
    with Results(results) as r:
        assert len(r) == 3
        assert r.manifest == {"parts": [1]}
        for k, seed in enumerate((0, 1, 7)):
            body = state_of(problem, seed).bodies[0]
            np.testing.assert_array_equal(r.field("left", "F", k)[body.id], body.particles.F)


def test_results_of_another_run_do_not_go_on(results, problem):
    with pytest.raises(BadResults, match="results of another scene"):
        reopen(results, replace(problem, source="other"), 2)
    with pytest.raises(BadResults, match="holds 3 frames, but the checkpoint comes after 5"):
        reopen(results, problem, 5)
    reopen(results, problem, 3).close()


def test_a_full_disk_keeps_the_frames_before(results, problem, monkeypatch):
    writer = reopen(results, problem, 3)
    monkeypatch.setattr(atomic.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1000}))
    with pytest.raises(NotWritten, match="needed, 1 kB free"):
        writer.append(frame_of(state_of(problem)), ENERGY)
    writer.close()
    with Results(results) as r:
        assert len(r) == 3


def test_nothing_is_left_of_a_file_that_could_not_begin(tmp_path, problem, monkeypatch):
    monkeypatch.setattr(writer, "_lay_out", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        create(tmp_path / "run.h5", problem, StoredFields(), {})
    assert not list(tmp_path.iterdir())


# Manifest.

def test_manifest_says_what_made_the_run(problem):
    facts = json.loads(json.dumps(manifest(problem, seed=3)))
    assert facts["scene"] == problem.source
    assert facts["scene_sha256"] == scene_hash(problem)
    assert facts["source_sha256"] == source_hash()
    assert facts["seed"] == 3
    assert {"mpm_ref", "python", "numpy", "numba", "h5py"} <= set(facts["versions"])
    assert {"cpu", "cores", "threads", "threading_layer", "pools"} <= set(facts["machine"])


def test_a_part_says_what_it_took(problem):
    part = RunPart(first_step=10)
    sum(range(200_000))
    entry = part.ended("finished", state_of(problem), "abc")
    assert entry["wall_s"] > 0.0
    assert entry["cpu_s"] > 0.0
    assert entry["peak_bytes"] > 10e6
    assert entry["began"] <= entry["ended"]
    assert (entry["why"], entry["first_step"], entry["state_sha256"]) == ("finished", 10, "abc")


def test_problems_built_in_code_are_told_apart():
    hashes = {scene_hash(colliding(source=source)) for source in ("", "text")}
    hashes.add(scene_hash(replace(colliding(source=""), dx=0.1)))
    assert len(hashes) == 3
    assert scene_hash(colliding(source="")) in hashes
