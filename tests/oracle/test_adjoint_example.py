"""The bundled golden file with gradients, and the examples that are checked against it."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from goldens import run_example

from mpm_ref import oracle, scene

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "examples/golden_adjoint.h5"
STEPS = 2


@pytest.fixture
def other(monkeypatch):
    """The other code as a module."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    import other_gradients
    return other_gradients


def test_the_example_is_a_code_of_its_own(tmp_path):
    """It knows neither the kernels nor the twin, and agrees."""
    output = run_example("check_my_gradients.py", tmp_path)
    assert output.startswith("agrees: 38 arrays at f64 tolerance")
    assert "_grad" not in output.partition("not given:")[2]


def test_the_bundled_file_is_what_the_kernels_compute(tmp_path):
    problem = scene.build(scene.load(ROOT / "examples/golden.toml"))
    oracle.record_adjoint(problem, tmp_path / "golden.h5", STEPS)
    report = oracle.check(GOLDEN, tmp_path / "golden.h5")
    assert report.agrees, str(report)
    assert not report.missing


def theirs(other):
    with h5py.File(GOLDEN) as f:
        state = {name: a[()] for name, a in f["bodies/disk"].items()}
        now = f["steps/0"]
        seed = {name: now[f"disk/{name}_seed"][()] for name in "xvCF"}
        return other.pull_back(state, seed, f.attrs["dx"], now.attrs["dt"])


def test_a_term_that_is_forgotten_is_found(other, monkeypatch, tmp_path):
    """A usual one: the weights of the nodes change as a particle moves."""
    monkeypatch.setattr(other, "slopes", lambda f: np.zeros((len(f), 9, 2)))
    oracle.write(tmp_path / "other.h5", [theirs(other)])
    first = oracle.check(GOLDEN, tmp_path / "other.h5").first
    assert (first.stage, first.array) == ("g2p adjoint", "disk/x_g2p_grad")
