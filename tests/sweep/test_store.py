import numpy as np
import pytest
from sweep_scenes import BOUNCE, FLIGHT, observed_run, scene_of

from mpm_ref.sweep import store as store_module
from mpm_ref.sweep.observation import FINISHED, STOPPED, RunCost, RunObservation
from mpm_ref.sweep.store import RunStore, key_of, packed, read

RUN = observed_run(scene_of(FLIGHT))


def observation(outcome=FINISHED, cpu=1.0):
    return RunObservation({"positions": np.arange(6.0).reshape(3, 2)}, RunCost(cpu, 2.0, 3, 4, 5),
                          outcome, "message", 0.5)


def equal(a, b):
    return (a.cost == b.cost and (a.outcome, a.message, a.until) == (b.outcome, b.message, b.until)
            and all((a.values[key] == b.values[key]).all() for key in a.values))


def test_what_is_put_is_got_by_another_store(tmp_path):
    RunStore(tmp_path / "runs").put(RUN, observation())
    assert equal(RunStore(tmp_path / "runs").get(RUN), observation())
    assert RunStore(tmp_path / "other").get(RUN) is None
    assert RunStore().get(RUN) is None


def test_a_store_without_folder_is_in_memory():
    store = RunStore()
    store.put(RUN, observation())
    assert equal(store.get(RUN), observation())


@pytest.mark.parametrize("change", [
    {"digest": "another"}, {"quantities": ("kinetic",)}, {"times": (0.0, 1.0)}, {"seed": 1},
    {"probes": (("disk", np.zeros((1, 2))),)}])
def test_the_key_depends_on_what_determines_a_run(change):
    assert key_of(RUN._replace(**change)) != key_of(RUN)


def test_the_key_does_not_depend_on_the_budget():
    assert key_of(RUN._replace(most_cpu=1.0)) == key_of(RUN)
    assert key_of(observed_run(scene_of(BOUNCE))) != key_of(RUN)


def test_the_key_depends_on_the_source(monkeypatch):
    before = key_of(RUN)
    monkeypatch.setattr(store_module, "source_hash", lambda: "another source")
    assert key_of(RUN) != before


def test_a_stopped_run_counts_until_more_time_is_allowed():
    store = RunStore()
    store.put(RUN._replace(most_cpu=1.0), observation(STOPPED))
    assert store.get(RUN._replace(most_cpu=1.0)) is not None
    assert store.get(RUN._replace(most_cpu=5.0)) is None


@pytest.mark.parametrize("damage", [b"", b"PK", None])
def test_a_damaged_file_counts_as_absent(tmp_path, damage):
    file = tmp_path / "run.npz"
    content = packed(observation())
    file.write_bytes(content[:len(content) // 2] if damage is None else damage)
    assert read(file) is None
    assert read(tmp_path / "absent.npz") is None


def test_a_file_with_any_byte_changed_counts_as_absent_or_is_the_same(tmp_path):
    content = packed(observation())
    path = tmp_path / "run.npz"
    for k in range(len(content)):
        path.write_bytes(content[:k] + bytes([content[k] ^ 0x41]) + content[k + 1:])
        stored = read(path)
        assert stored is None or equal(stored, observation())


@pytest.mark.parametrize("facts", ["[1]", "3", '"text"', "{}", '{"cost": 3}'])
def test_facts_of_another_kind_count_as_absent(tmp_path, facts):
    np.savez(tmp_path / "run.npz", facts=np.array(facts))
    assert read(tmp_path / "run.npz") is None
