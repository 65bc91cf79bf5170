"""`mpm-ref oracle record`: what it warns of and what it refuses."""

import h5py
import pytest
from command_line import SCENE, assert_told, mpm_ref


@pytest.fixture
def implicit(scene):
    """File of the small scene with implicit steps, which gravity alone moves."""
    scene.write_text('integrator = "hot"\n' + SCENE)
    return scene


def record(scene, tmp_path, *options):
    return mpm_ref("oracle", "record", scene, "-o", tmp_path / "golden.h5", *options)


def test_steps_with_nothing_to_solve_are_warned_of(implicit, tmp_path):
    assert record(implicit, tmp_path, "--steps", 2).stderr == ""
    implicit.write_text(implicit.read_text().replace("-9.8", "0.0"))
    for steps, which in ((2, "steps 0, 1"), (1, "step 0")):
        done = record(implicit, tmp_path, "--steps", steps, "--overwrite")
        assert_told(done, 0, f"mpm-ref: warning: nothing to solve in {which}: dv is 0", "--begin")


def test_an_explicit_step_at_rest_is_not_warned_of(scene, tmp_path):
    scene.write_text(SCENE.replace("-9.8", "0.0"))
    done = record(scene, tmp_path, "--steps", 1)
    assert (done.exit_code, done.stderr) == (0, "")


@pytest.mark.parametrize("head", ["", 'integrator = "hot"\n'])
@pytest.mark.parametrize(("length", "begin", "words"), [
    ("steps = 40", 38, "steps = 3: the run ends 2 steps after the 38 before them"),
    ("end = 0.04", 39, "steps = 3: the run ends 1 step after the 39 before them"),
    ("steps = 40", 40, "begin after 40 steps: the run ends after 40"),
])
def test_steps_past_the_end_of_the_run_are_refused(scene, tmp_path, head, length, begin, words):
    scene.write_text(head + SCENE.replace("steps = 40", length))
    assert_told(record(scene, tmp_path, "--begin", begin, "--steps", 3), 2, words)
    if begin == 38:
        assert record(scene, tmp_path, "--begin", begin, "--steps", 2).exit_code == 0


@pytest.mark.parametrize("eps", ["0", "-1e-9", "nan", "inf"])
def test_a_tolerance_that_is_none_is_told(implicit, tmp_path, eps):
    assert_told(record(implicit, tmp_path, "--eps", eps), 2, f"--eps {float(eps)}: expected")


def test_gradients_are_recorded_when_asked_for(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    done = record(scene, tmp_path, "--begin", 2, "--steps", 1, "--adjoint")
    assert (done.exit_code, done.stderr) == (0, "")
    with h5py.File(golden) as f:
        assert {"gravity_grad", "velocity_bc_grad"} < set(f["steps/0"])
    done = mpm_ref("oracle", "check", golden, golden)
    assert (done.exit_code, done.stdout[:7]) == (0, "agrees:")
    assert_told(record(scene, tmp_path, "--adjoint", "--steps", 3), 2, "exists: add --overwrite")


def test_what_has_no_gradients_is_told(implicit, scene, tmp_path):
    assert_told(record(implicit, tmp_path, "--adjoint"), 2, "is implicit: expected an explicit St")
    assert_told(record(scene, tmp_path, "--adjoint", "--eps", "1e-9"), 2,
                "--adjoint with --eps 1e-09: implicit steps have no adjoint")
