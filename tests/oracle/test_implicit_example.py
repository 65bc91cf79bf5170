"""The shipped golden file of implicit steps, and the example that is checked against it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from mpm_ref import oracle, scene

ROOT = Path(__file__).resolve().parents[2]
STEPS = 2


def test_the_example_is_a_code_of_its_own(tmp_path):
    """It knows neither the kernels nor the twin, and agrees."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples",
                    ignore=shutil.ignore_patterns("__pycache__"))
    done = subprocess.run(
        [sys.executable, "-B", tmp_path / "examples/check_my_implicit_backend.py"], cwd=tmp_path,
        text=True, check=False, capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("agrees: 42 arrays at f64 tolerance")
    assert "not given: coarse2, cycle, direction, disk/F_trial, disk/L" in done.stdout


def test_the_shipped_file_is_what_the_kernels_compute(tmp_path):
    file = ROOT / "examples/golden_implicit.toml"
    oracle.record(scene.build(scene.load(file)), tmp_path / "golden.h5", STEPS)
    assert oracle.check(ROOT / "examples/golden_implicit.h5", tmp_path / "golden.h5").agrees
