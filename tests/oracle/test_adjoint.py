"""Golden files with adjoints: what they record, who agrees with them, and what is refused."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from adjoint_runs import dive, impact
from goldens import checker, stretched
from goldens_adjoint import (
    STATES,
    STEPS,
    agreement,
    differences_from_step_adjoint,
    kernel_arrays,
    recorded,
    twin_steps,
)
from problems import DX, run_python

from mpm_ref import oracle
from mpm_ref.explicit import Scheme
from mpm_ref.oracle import adjoint_recording
from mpm_ref.oracle.schema import ADJOINT, LOCATION, key
from mpm_ref.problem import Problem

ROOT = Path(__file__).resolve().parents[2]
CHANGE = 1.0 + 1e-6
HERE = [array for array in ADJOINT if array.name not in ("velocity_old_grad", "b_grad")]


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    return recorded(stretched(), tmp_path_factory.mktemp("golden") / "golden.h5")


@pytest.fixture(scope="module")
def written():
    return kernel_arrays(stretched())


@pytest.fixture
def theirs(written):
    return [{name: a.copy() for name, a in seen.items()} for seen in written]


@pytest.fixture
def checked(golden, tmp_path):
    return checker(golden, tmp_path / "other.h5")


# what is recorded

@pytest.mark.slow
@pytest.mark.parametrize("run", [impact, dive])
def test_the_stages_end_in_the_adjoint_of_the_step_to_the_bit(run):
    assert not differences_from_step_adjoint(run())


def test_every_gradient_comes_with_its_error(golden):
    with h5py.File(golden) as f:
        for step in f["steps"].values():
            units = []
            for array in HERE:
                for body in ("metal", "jelly")[:1 + (array.location != "nodes")]:
                    name = key(array, body)
                    if name not in ("jelly/y_grad", "jelly/flow_grad"):
                        data, scale = step[name], step[f"scale/{name}"]
                        units.append(data.attrs["error_in_units"])
                        assert data.attrs["stage"] == array.stage
                        assert scale.shape == data.shape[:scale.ndim]
                        assert abs(data[()]).max() > 0.0
            assert 0.0 < max(units) < 1.0
        assert set(f["steps/0/metal"]) >= {f"{name}_seed" for name in ("x", "v", "C", "F", "y")}


def test_steps_are_recorded_as_without(golden, tmp_path):
    oracle.record(stretched(), tmp_path / "forwards.h5", STEPS)
    report = oracle.check(golden, tmp_path / "forwards.h5")
    assert (report.agrees, report.nearest, report.compared) == (True, 0.0, 48)
    assert report.missing == tuple(sorted(report.missing))
    assert {name.split("/")[-1] for name in report.missing} == {a.name for a in HERE}


# What is compiled costs seconds: states with kernels that no other test here needs run without.
COMPILED = "flip 3"
UNCOMPILED = """
import json
from adjoint_runs import splash
from goldens_adjoint import STATES, agreement, differences_from_step_adjoint, refusal_on_a_kink
print(json.dumps({state: agreement(state) for state in STATES if state != "flip 3"}
                 | {"differences": differences_from_step_adjoint(splash()),
                    "kink": refusal_on_a_kink()}))
"""


@pytest.fixture(scope="module")
def uncompiled():
    return run_python(UNCOMPILED, NUMBA_DISABLE_JIT="1")


@pytest.mark.parametrize("state", STATES)
def test_other_schemes_and_materials(state, uncompiled):
    result = agreement(state) if state == COMPILED else uncompiled[state]
    assert result["agrees"], result["text"]
    assert not result["missing"]
    assert result["units"] < 1.0


def test_the_stages_of_a_fluid_in_3d_end_in_the_adjoint_of_the_step(uncompiled):
    assert not uncompiled["differences"]


# who agrees

def test_particles_in_another_order_agree(checked):
    report = checked(kernel_arrays(stretched(), order=-1))
    assert report.agrees, str(report)
    assert 0.0 < report.nearest < 0.5
    assert report.missing == report.unknown == ()


@pytest.mark.parametrize(("real", "precision"), [(np.float64, "f64"), (np.float32, "f32")])
def test_the_plain_twin_agrees_at_the_tolerance_of_its_precision(real, precision, checked):
    report = checked(twin_steps(stretched(), real))
    assert (report.agrees, report.precision) == (True, precision), str(report)
    assert report.nearest > 1e-4


@pytest.mark.parametrize("name", [array.name for array in HERE])
def test_a_millionth_in_one_entry_is_caught_and_located(name, checked, theirs):
    location = LOCATION[name]
    of = name if location in ("nodes", "step") else f"metal/{name}"
    a = theirs[1][of]
    i = np.unravel_index(np.argmax(abs(a)), a.shape)
    a[i] *= CHANGE
    first, = checked(theirs).departures
    assert (first.step, first.array, first.other) == (1, of, a[i])
    assert first.where.startswith(entry_words(location, name, i[0], theirs[1]["nodes"]))
    assert first.difference > 10 * first.tolerance


def entry_words(where, name, i, nodes):
    """The words for the entry i of an array."""
    if where == "nodes":
        return f"node {tuple(nodes[i].tolist())}"
    if where == "parameters":
        metal = stretched().bodies[1]
        return f"parameter {(metal.law if name == 'law_grad' else metal.flow)._fields[i]}"
    return f"{'particle' if where == 'particles' else 'component'} {i}"


def times(a):
    a *= CHANGE


# Each: (the first array that departs, the function, what is changed of its arguments after it ran).
MUTATIONS = {
    "return map": ("F_trial_grad", "deform_body_adjoint", lambda a: times(a[2].F)),
    "strain": ("L_grad", "deform_body_adjoint", lambda a: times(a[2].L)),
    "g2p": ("velocity_bc_grad", "g2p_adjoint", lambda a: times(a[3].v)),
    "g2p x": ("x_g2p_grad", "g2p_adjoint", lambda a: times(a[2].x)),
    "boundaries": ("velocity_grad", "solve_adjoint", lambda a: times(a[2].v)),
    "mass": ("mass_grad", "update_adjoint", lambda a: times(a[1].m)),
    "update": ("momentum_grad", "update_adjoint", lambda a: times(a[1].v)),
    "p2g x": ("x_grad", "p2g_adjoint", lambda a: times(a[2].x)),
    "p2g C": ("C_grad", "p2g_adjoint", lambda a: times(a[2].C)),
    "p2g tau": ("tau_grad", "p2g_adjoint", lambda a: times(a[2].tau)),
    "stress": ("F_grad", "initial_stress_adjoint", lambda a: times(a[1].F)),
    "moduli": ("law_grad", "initial_stress_adjoint", lambda a: times(a[2])),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_millionth_in_any_kernel_is_caught_and_located(mutation, checked, monkeypatch):
    array, name, change = MUTATIONS[mutation]
    real = getattr(adjoint_recording, name)

    def run(*arguments):
        result = real(*arguments)
        change(arguments)
        return result

    monkeypatch.setattr(adjoint_recording, name, run)
    first = checked(kernel_arrays(stretched())).first
    assert (first.step, first.array.split("/")[-1]) == (0, array)
    assert first.difference > 10 * first.tolerance


def test_a_kernel_that_is_wrong_is_not_recorded(monkeypatch, tmp_path):
    real = adjoint_recording.p2g_adjoint
    monkeypatch.setattr(adjoint_recording, "p2g_adjoint", lambda *a: (real(*a), times(a[2].v))[0])
    with pytest.raises(ValueError, match="jelly/v_grad in step 0: kernels and plain twin differ"):
        oracle.record_adjoint(stretched(), tmp_path / "golden.h5", 1)
    assert not list(tmp_path.iterdir())


def test_a_coordinate_that_the_clip_holds_takes_no_seed_on(tmp_path):
    problem = stretched()
    high = np.array([0.4, 0.5])
    oracle.record_adjoint(with_(problem, clip=(np.zeros(2), high)), tmp_path / "golden.h5", 1)
    with h5py.File(tmp_path / "golden.h5") as f:
        x, back, seed = (f[f"steps/0/metal/{name}"][()] for name in ("x", "x_g2p_grad", "x_seed"))
        far, _ = (back - seed)[x[:, 0] == 0.4].T
        assert len(far) > 0
        assert np.all(abs(far) > 0.5 * abs(seed[x[:, 0] == 0.4, 0]))
        assert np.all(abs(back - seed)[x < high] < 0.5 * abs(seed).max())


# what has no adjoint

class Shaken:
    """Conditions that only know how to change a grid."""

    def apply(self, grid, t, dt):
        """Nothing."""


def with_(problem, **changes):
    fields = {"bodies": problem.bodies, "dx": DX, "clock": problem.clock,
              "gravity": problem.gravity, "scheme": problem.scheme,
              "conditions": problem.conditions}
    return Problem(**(fields | changes))


@pytest.mark.parametrize(("changes", "message"), [
    ({"conditions": Shaken()}, "conditions of type Shaken have no adjoint"),
    ({"integrator": "implicit", "scheme": Scheme(transfer="apic")}, "is implicit: expected an"),
    ({"scheme": Scheme(relaxation=1e-3)}, r"relaxation = 0\.001: the plain twin has no adjoint"),
])
def test_what_has_no_adjoint_is_refused(changes, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        oracle.record_adjoint(with_(stretched(), **changes), tmp_path / "golden.h5", 1)
    assert not list(tmp_path.iterdir())


def test_a_state_on_a_kink_is_refused(uncompiled):
    """Sand at rest stands on the tip of its cone: any strain decides what it does."""
    message, files = uncompiled["kink"]
    assert "times what round-off explains. The state stands on a kink" in message
    assert not files


def test_a_law_without_adjoint_is_refused(tmp_path):
    body = stretched().bodies[0]._replace(law=(1.0, 2.0))
    with pytest.raises(ValueError, match="body 'jelly': tuple is not known to the plain twin"):
        oracle.record_adjoint(with_(stretched(), bodies=(body,)), tmp_path / "golden.h5", 1)
    assert not list(tmp_path.iterdir())
