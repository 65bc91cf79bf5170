"""What golden files of implicit steps say of the solver, and recordings that are refused."""

import json
from dataclasses import replace

import h5py
import pytest
from goldens_hot import EPS, problem_of

from mpm_ref import oracle
from mpm_ref.hot.methods import printed
from mpm_ref.oracle.schema import LEVELS


@pytest.fixture(scope="module")
def problem():
    return problem_of(2)


def test_options_are_named_in_the_file(problem, tmp_path):
    oracle.record(problem, tmp_path / "golden.h5", 1, eps=EPS)
    with h5py.File(tmp_path / "golden.h5") as f:
        options = json.loads(f.attrs["options"])
        assert f.attrs["displacement_tolerance"] == 0.0
    assert options["cycle"]["smoother"] == "gauss-seidel"
    assert options["search"]["shrink"] == 0.5


def test_more_levels_than_are_recorded_are_refused(problem, tmp_path):
    many = replace(problem, solver=printed("hot", levels=LEVELS + 1))
    with pytest.raises(ValueError, match=f"levels = {LEVELS + 1}: expected at most {LEVELS}"):
        oracle.record(many, tmp_path / "golden.h5", 1, eps=EPS)


def test_a_start_past_the_end_of_the_run_is_refused(problem, tmp_path):
    short = replace(problem, clock=replace(problem.clock, steps=2, end=None))
    with pytest.raises(ValueError, match="begin after 3 steps: the run ends after 2"):
        oracle.record(short, tmp_path / "golden.h5", 1, eps=EPS, begin=3)
