"""A check finds and locates an error of a millionth in any stage, and whatever does not match."""

import json
import shutil

import h5py
import numpy as np
import pytest
from goldens import ON_NODES, kernel_arrays, stretched

from mpm_ref import explicit, oracle
from mpm_ref.core.boundary import Conditions
from mpm_ref.oracle import kernel_stages
from mpm_ref.oracle.schema import ARRAYS
from mpm_ref.store.seal import GOLDEN, seal

CHANGE = 1.0 + 1e-6


@pytest.fixture
def theirs():
    return kernel_arrays(stretched())


# mutations: one stage, one part in a million

def scaled(module, name, change):
    """Replace a function by one that lets `change(arguments, result)` act on what it has done."""
    def replaced(monkeypatch):
        real = getattr(module, name)

        def run(*arguments):
            result = real(*arguments)
            changed = change(arguments, result)
            return result if changed is None else changed
        monkeypatch.setattr(module, name, run)
    return replaced


def times(a):
    a *= CHANGE


def harder(monkeypatch):
    """Stress enters the scatter larger than it is."""
    real = explicit.p2g
    monkeypatch.setattr(explicit, "p2g", lambda q, *rest: real(
        q._replace(tau=CHANGE * q.tau), *rest))


MUTATIONS = {
    "weights": ("weights", scaled(kernel_stages, "stencil_weights",
                                  lambda _, r: (r[0], CHANGE * r[1]))),
    "mass": ("mass", scaled(explicit, "p2g", lambda a, _: times(a[1].m))),
    "momentum": ("momentum", scaled(explicit, "p2g", lambda a, _: times(a[1].v))),
    "force": ("force", harder),
    "grid update": ("velocity", scaled(explicit, "update", lambda a, _: times(a[0].v))),
    "boundaries": ("velocity_bc", scaled(Conditions, "apply", lambda a, _: times(a[1].v))),
    "g2p v": ("v", scaled(explicit, "g2p", lambda a, _: times(a[0].v))),
    "g2p x": ("x", scaled(explicit, "g2p", lambda a, _: times(a[0].x))),
    "g2p C": ("C", scaled(explicit, "g2p", lambda a, _: times(a[0].C))),
    "F trial": ("F_trial", scaled(kernel_stages, "trial_deformation", lambda _, r: CHANGE * r)),
    "return map": ("F", scaled(explicit, "deform_body", lambda a, _: times(a[0].particles.F))),
    "history": ("y", scaled(explicit, "deform_body", lambda a, _: times(a[0].particles.y))),
    "stress": ("tau", scaled(explicit, "deform_body", lambda a, _: times(a[0].particles.tau))),
    "energy": ("energy", scaled(kernel_stages, "energy", lambda _, r: CHANGE * np.array(r))),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_millionth_in_any_kernel_is_caught_and_located(mutation, checked, monkeypatch):
    array, mutate = MUTATIONS[mutation]
    mutate(monkeypatch)
    report = checked(kernel_arrays(stretched()))
    assert not report.agrees
    assert report.first.array.split("/")[-1] == array
    assert report.first.step == 0
    assert report.first.difference > 100 * report.first.tolerance


@pytest.mark.parametrize("name", [a.name for a in ARRAYS])
def test_a_millionth_in_one_entry_is_caught_and_located(name, checked, theirs):
    key = name if name in ON_NODES else f"metal/{name}"
    a = theirs[1][key]
    i = np.unravel_index(np.argmax(abs(a)), a.shape)
    a[i] *= CHANGE
    report = checked(theirs)
    first, = report.departures
    assert (first.step, first.array) == (1, key)
    assert first.other == a[i]
    if name in ON_NODES:
        assert f"node {tuple(theirs[1]['nodes'][i[0]].tolist())}" in first.where
    elif name != "energy":
        assert f"particle {i[0]}" in first.where


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("key", ["mass", "velocity_bc", "jelly/weights", "metal/F", "jelly/energy"])
def test_what_is_not_finite_departs(key, value, checked, theirs):
    theirs[0][key].flat[-1] = value
    report = checked(theirs)
    assert report.first.array == key
    assert "is not finite" in str(report)
    json.loads(report.json)


def test_a_golden_file_that_is_not_finite_fails(golden, theirs, tmp_path):
    bad = tmp_path / "bad.h5"
    shutil.copy(golden, bad)
    with h5py.File(bad, "r+") as f:
        f["steps/0/velocity"][0, 0] = np.nan
    seal(bad, GOLDEN)
    oracle.write(tmp_path / "other.h5", theirs)
    report = oracle.check(bad, tmp_path / "other.h5")
    assert report.first.array == "velocity"
    assert "golden file holds numbers that are not finite" in str(report)


# what does not match as a whole

def lose_a_node(seen):
    k = np.argmax(seen["mass"])
    seen["nodes"] = np.delete(seen["nodes"], k, axis=0)
    for name in ON_NODES:
        seen[name] = np.delete(seen[name], k, axis=0)


def lose_a_node_without_mass(seen):
    lose_a_node(seen)
    for name in ("mass", "momentum", "force"):
        del seen[name]


def add_a_node(seen):
    seen["nodes"] = np.concatenate([seen["nodes"], [[99, 99]]])
    for name in ON_NODES:
        seen[name] = np.concatenate([seen[name], seen[name][:1]])
    seen["mass"][-1] = 1e-6


def repeat_a_node(seen):
    seen["nodes"][1] = seen["nodes"][0]


def lose_a_particle(seen):
    seen["jelly/x"] = seen["jelly/x"][1:]


def misnumber(seen):
    seen["jelly/id"][0] = 1


@pytest.mark.parametrize(("damage", "array", "message"), [
    (lose_a_node, "mass", "is 0, but"),
    (lose_a_node_without_mass, "velocity", "is not given"),
    (add_a_node, "mass", "where the golden file has 0"),
    (repeat_a_node, "mass", "1 of its nodes are listed twice"),
    (lose_a_particle, "jelly/x", "does not number"),
    (misnumber, "jelly/weights", "does not number its"),
])
def test_nodes_and_particles_must_match(damage, array, message, checked, theirs):
    damage(theirs[0])
    report = checked(theirs)
    assert report.first.array == array
    assert message in str(report)


def test_another_shape_departs(checked, theirs):
    theirs[0]["jelly/F"] = theirs[0]["jelly/F"][:, 0]
    assert "expected" in checked(theirs).first.what


def test_misuse_is_one_sentence(golden, checked, theirs, tmp_path):
    no_nodes = [{"mass": theirs[0]["mass"]}]
    with pytest.raises(oracle.NotComparable, match="mass is given without `nodes`"):
        checked(no_nodes)
    with pytest.raises(ValueError, match=r"steps\[0\]: mass has the shape \(4, 4\) without `or"):
        checked([{"mass": np.ones((4, 4))}])
    with pytest.raises(oracle.NotComparable, match="expected 'f64', 'f32' or 'auto'"):
        checked(theirs, precision="f16")
    with pytest.raises(ValueError, match="array 'jelly/speed': expected one of weights, mass"):
        checked([{"jelly/speed": np.ones(3)}])
    with pytest.raises(ValueError, match=r"steps\[0\]: origin without mass: .* are origin, vel"):
        checked([{"origin": (0, 0), "velocity": np.ones((3, 3, 2))}])
    grids = {"origin": (0, 0), "mass": np.ones((3, 3)), "velocity": np.ones((2, 3, 2))}
    with pytest.raises(ValueError, match=r"steps\[1\]: array 'velocity' has the shape \(2, 3, 2\): "
                                         r"expected that of mass, \(3, 3\), in its first 2 axes"):
        checked([None, grids])
    with pytest.raises(ValueError, match=r"mass has the shape \(9,\): expected 2 axes"):
        checked([grids | {"mass": np.ones(9)}])
    assert checked(theirs).agrees
    with pytest.raises(oracle.NotComparable, match="not a golden file"):
        oracle.check(tmp_path / "other.h5", golden)
    with h5py.File(tmp_path / "empty.h5", "w"):
        pass
    with pytest.raises(oracle.NotComparable, match="no group 'steps'"):
        oracle.check(golden, tmp_path / "empty.h5")
    cut = tmp_path / "cut.h5"
    cut.write_bytes(golden.read_bytes()[:5000])
    with pytest.raises(oracle.NotComparable, match="it is cut short, or no golden"):
        oracle.check(cut, golden)


def test_unknown_bodies_are_listed(checked, theirs):
    theirs[0]["jello/x"] = theirs[0]["jelly/x"]
    assert checked(theirs).unknown == ("jello/x",)


def test_the_report_for_machines(checked, theirs):
    theirs[0]["jelly/F"][7, 0, 1] += 1.0
    found = json.loads(checked(theirs).json)
    assert found["agrees"] is False
    first = found["departures"][0]
    assert first["array"] == "jelly/F"
    assert first["where"] == "particle 7 component 0, 1"
    assert found["sentence"].startswith("departs first at step 0, stage return map, array jelly/F")
