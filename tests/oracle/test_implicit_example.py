"""The bundled golden file of implicit steps, and the example that is checked against it."""

from pathlib import Path

from goldens import run_example

from mpm_ref import oracle, scene

ROOT = Path(__file__).resolve().parents[2]
STEPS = 2


def test_the_example_is_a_code_of_its_own(tmp_path):
    """It knows neither the kernels nor the twin, and agrees."""
    output = run_example("check_my_implicit_backend.py", tmp_path)
    assert output.startswith("agrees: 42 arrays at f64 tolerance")
    assert "not given: coarse2, cycle, direction, disk/F_trial, disk/L" in output


def test_the_bundled_file_is_what_the_kernels_compute(tmp_path):
    file = ROOT / "examples/golden_implicit.toml"
    oracle.record(scene.build(scene.load(file)), tmp_path / "golden.h5", STEPS)
    assert oracle.check(ROOT / "examples/golden_implicit.h5", tmp_path / "golden.h5").agrees
