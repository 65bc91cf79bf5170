"""Golden files: what they record, who agrees with them, and the bundled one."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from goldens import ON_NODES, STEPS, alone, kernel_arrays, stretched
from problems import DX, JELLY, ball

from mpm_ref import oracle, scene
from mpm_ref.explicit import Scheme
from mpm_ref.materials import Fluid, NoFlow
from mpm_ref.oracle import comparison, kernel_stages, recording
from mpm_ref.oracle.plain_twin import Twin, align
from mpm_ref.oracle.schema import ARRAYS
from mpm_ref.problem import Clock, Problem
from mpm_ref.sampling.arrays import read_arrays

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def theirs():
    return kernel_arrays(stretched())


# what is recorded

def test_every_array_comes_with_its_error_and_tolerances(golden):
    with h5py.File(golden) as f:
        recorded = set()
        for name in [n for n in names_in(f["steps/0"]) if not n.startswith("scale/")]:
            if name.split("/")[-1] in ("nodes", "base"):
                continue
            data, scale = f["steps/0"][name], f[f"steps/0/scale/{name}"]
            recorded.add(name.split("/")[-1])
            units = data.attrs["error_in_units"]
            assert data.attrs["tolerance_f64"] == 8 * max(units, 1) * 2.0**-52
            assert data.attrs["tolerance_f32"] == 8 * max(units, 1) * 2.0**-23
            assert 0 < data.attrs["error_twin"] < 1e-9
            assert scale.shape == data.shape[: scale.ndim]
        assert recorded == {a.name for a in ARRAYS}
        assert f.attrs["transfer"] == "mls"
        assert json.loads(f["bodies/jelly"].attrs["law_parameters"]) == JELLY._asdict()


def names_in(group):
    found = []
    group.visititems(lambda n, item: found.append(n) if isinstance(item, h5py.Dataset) else None)
    return found


def test_scales_bound_the_errors(golden):
    """Every own error is below one unit: eps times the scale says how much round-off to expect."""
    with h5py.File(golden) as f:
        units = [f["steps"][n].attrs["error_in_units"] for n in names_in(f["steps"])
                 if "error_in_units" in f["steps"][n].attrs]
    assert len(units) == STEPS * 24
    assert 0.0 < max(units) < 1.0


def test_recording_leaves_the_problem_alone():
    problem, same = stretched(), stretched()
    list(recording.record_steps(problem, 1))
    for a, b in zip(problem.bodies, same.bodies):
        assert all(np.array_equal(c, d) for c, d in zip(a.particles, b.particles))


COUNT = len(ball("", (0.0, 0.0), JELLY, NoFlow()).id)       # of particles of `alone`


def fluid():
    return alone(Scheme(), Fluid(1e4), F=np.full(COUNT, 0.98), tau=np.zeros(COUNT))


def flip():
    """With body forces, as in the other tests that compile its kernels."""
    return alone(Scheme(3, "flip", flip=0.9), b=np.sin(np.arange(2.0 * COUNT)).reshape(-1, 2))


@pytest.mark.parametrize("problem", [
    flip(), alone(Scheme(2, "apic", rpic=0.1)), fluid(),
], ids=["flip", "apic", "fluid"])
def test_other_schemes_and_states(problem, tmp_path):
    oracle.record(problem, tmp_path / "golden.h5", STEPS)
    oracle.write(tmp_path / "other.h5", kernel_arrays(problem, order=-1))
    report = oracle.check(tmp_path / "golden.h5", tmp_path / "other.h5")
    assert report.agrees, str(report)
    assert not report.missing


def test_the_step_that_a_run_would_take_is_recorded():
    problem = stretched()
    adaptive = Problem(problem.bodies, DX, Clock(cfl=0.4, steps=1), problem.gravity)
    done, = recording.record_steps(adaptive, 1)
    assert 1e-4 < done.dt < 1e-2
    clipped = Problem(problem.bodies, DX, problem.clock, problem.gravity,
                      clip=(np.array([0.25, 0.1]), np.array([0.4, 0.4])))
    done, = recording.record_steps(clipped, 1)
    assert done.arrays["metal/x"].value.max() == 0.4
    assert done.arrays["jelly/x"].error < 1.0


def test_what_cannot_be_recorded_is_refused(tmp_path):
    problem = stretched()
    path = tmp_path / "golden.h5"
    with pytest.raises(ValueError, match="with an explicit integrator, which solves nothing"):
        oracle.record(problem, path, 1, eps=1e-9)
    with pytest.raises(ValueError, match=r"steps = 0, begin = 0: expected at least one"):
        oracle.record(problem, path, 0)
    for name, message in (("a/b", "without a slash"), ("metal", "different name"),
                          ("mass", "an array")):
        jelly, metal = problem.bodies
        same = Problem((jelly._replace(name=name), metal), DX, problem.clock, problem.gravity)
        with pytest.raises(ValueError, match=message):
            oracle.record(same, path, 1)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("own", [1e-3, np.nan])
def test_a_reference_that_is_not_sure_is_refused(own):
    arrays = {"mass": recording.GoldenArray(np.ones(3), np.ones(3), own, 0.0, 1.0)}
    with pytest.raises(ValueError, match=r"at a largest entry of 1\.0e.*, too much"):
        recording.require_small_error(arrays, 0)


# who agrees

def test_the_same_code_agrees(checked, theirs):
    report = checked(theirs)
    assert report.agrees
    assert report.compared == STEPS * 24
    assert report.nearest == 0.0
    assert report.missing == report.unknown == ()
    assert str(report).startswith("agrees: 48 arrays at f64 tolerance")


def test_particles_in_another_order_agree(checked):
    report = checked(kernel_arrays(stretched(), order=-1))
    assert report.agrees
    assert 0.0 < report.nearest < 0.5


def test_particles_in_another_order_without_numbers_depart(checked):
    steps = [{k: a for k, a in s.items() if not k.endswith("/id")}
             for s in kernel_arrays(stretched(), order=-1)]
    assert checked(steps).first.stage == "weights"


def twin_steps(real):
    problem, dt = stretched(), 1e-3
    twin, ours = Twin(problem, real), recording.copy_problem(problem, 1)
    stepper, out = recording.start_stepper(ours), []
    for k in range(STEPS):
        seen, contacts = kernel_stages.step(ours, ours.bodies, stepper, k * dt, dt)
        out.append(twin.step(dt, seen["nodes"], contacts).arrays | {"nodes": seen["nodes"]})
    return out


def test_single_precision_agrees_at_its_own_tolerance(checked):
    steps = twin_steps(np.float32)
    report = checked(steps)
    assert report.precision == "f32"
    assert report.agrees, str(report)
    assert not checked(steps, precision="f64").agrees


def test_the_plain_twin_in_double_agrees(checked):
    report = checked(twin_steps(np.float64))
    assert report.precision == "f64"
    assert report.agrees, str(report)


def test_whole_grids_agree(checked, theirs):
    for seen in theirs:
        nodes = seen.pop("nodes")
        origin = nodes.min(axis=0) - 2
        for name in ON_NODES:
            grid = np.zeros((*(np.ptp(nodes, axis=0) + 6), *seen[name].shape[1:]))
            grid[tuple((nodes - origin).T)] = seen[name]
            seen[name] = grid
        seen["origin"] = origin
    assert checked(theirs).agrees


def test_nodes_in_another_order_and_empty_ones_agree(checked, theirs):
    for seen in theirs:
        extra = seen["nodes"][:3] + 100
        seen["nodes"] = np.concatenate([seen["nodes"], extra])[::-1]
        for name in ON_NODES:
            seen[name] = np.concatenate([seen[name], 0.0 * seen[name][:3]])[::-1]
    assert checked(theirs).agrees


def test_weights_about_another_base_node_are_compared_by_node(checked, theirs):
    """A weight is compared node by node: another base is as good, if what falls off is zero."""
    for seen in theirs:
        seen["jelly/base"], seen["jelly/weights"] = shifted(seen["jelly/base"],
                                                            seen["jelly/weights"])
    report = checked(theirs)
    assert report.first.array == "jelly/weights"        # the row that fell off was not zero
    assert report.first.where.startswith("particle 0, node")


def shifted(base, w):
    """Particle 0 with a base node one higher on the first axis."""
    base, rows = base.copy(), w.reshape(-1, 3, 3).copy()
    base[0] += (1, 0)
    rows[0] = np.concatenate([rows[0, 1:], np.zeros((1, 3))])
    return base, rows.reshape(w.shape)


def test_a_base_node_that_round_off_moves_agrees(rng):
    """A particle on a face: its first row of weights is zero, or it has another base node."""
    base, w = np.array([[3, 4], [7, 7]]), rng.random((2, 3, 3))
    w[0, 0] = 0.0
    group = {"b/base": base, "b/weights": w.reshape(2, 9)}
    other = dict(zip(group, shifted(base, group["b/weights"])))
    found = comparison.by_pair(group, other, "b", other["b/weights"], group["b/weights"])
    assert np.array_equal(found.value, group["b/weights"])
    assert not found.extra.any()
    w[0, 0] = 0.5
    assert not np.array_equal(found.value, w.reshape(2, 9))


def test_what_is_not_given_is_listed(checked, theirs):
    for seen in theirs:
        for name in ("force", "jelly/weights", "metal/y"):
            del seen[name]
    report = checked(theirs)
    assert report.agrees
    assert report.missing == ("force", "jelly/weights", "metal/y")
    assert "not given: force, jelly/weights, metal/y" in str(report)
    report = checked(theirs[:1])
    assert report.agrees
    assert "step 1" in report.missing
    assert not checked([None, None]).agrees


# the bundled file

def test_the_bundled_golden_file_is_what_we_compute(tmp_path):
    problem = scene.build(scene.load(ROOT / "examples/golden.toml"))
    oracle.write(tmp_path / "other.h5", kernel_arrays(problem, steps=3))
    report = oracle.check(ROOT / "examples/golden.h5", tmp_path / "other.h5")
    assert report.agrees, str(report)
    assert not report.missing
    with h5py.File(ROOT / "examples/golden.h5") as f:
        assert f.attrs["scene"] == problem.source


def test_the_example_in_single_precision(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "examples")
    from other_code import step
    path = ROOT / "examples/golden.h5"
    with h5py.File(path) as f:
        state = {n: a[()].astype(np.float32) for n, a in f["bodies/disk"].items()}
    oracle.write(tmp_path / "other.h5", [step(state, 0.1, 2e-3) for _ in range(3)])
    report = oracle.check(path, tmp_path / "other.h5")
    assert report.precision == "f32"
    assert report.agrees, str(report)


@pytest.mark.parametrize("name", ["hello", "incline"])
def test_bundled_scenes_with_particles_half_way_between_nodes_are_recorded(tmp_path, name):
    """There the twin's stencils begin at another node than ours, in extended precision."""
    problem = scene.build(scene.load(ROOT / f"scenes/{name}.toml"))
    oracle.record(problem, tmp_path / "golden.h5", steps=1)
    with h5py.File(tmp_path / "golden.h5") as f:
        assert len(f["steps"]) == 1


def test_weights_move_to_another_first_node():
    w = np.arange(1.0, 10.0).reshape(1, 9)
    shifted = align(w, np.array([[5, 5]]), np.array([[6, 4]]))
    assert shifted.reshape(3, 3).tolist() == [[0.0, 4.0, 5.0], [0.0, 7.0, 8.0], [0.0, 0.0, 0.0]]
    assert np.array_equal(align(w, np.array([[5, 5]]), np.array([[5, 5]])), w)


def test_a_scene_reads_the_bodies_of_a_golden_file(golden):
    """As particles of its own, with nothing to ignore; fluids have F where a scene takes J."""
    with h5py.File(golden) as f:
        for name, group in f["bodies"].items():
            arrays = read_arrays(golden, 2, f"/bodies/{name}")
            assert set(arrays) == set(group)
            for key, a in arrays.items():
                np.testing.assert_array_equal(a, group[key][()])
