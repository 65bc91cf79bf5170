"""The command line on implicit scenes: what it says before, during and after a run."""

import json

import pytest
from command_line import SCENE, mpm_ref

from mpm_ref.cli.info import of_problem, problem_lines
from mpm_ref.cli.shipped import shipped_scenes
from mpm_ref.scene import build, load


def implicit(tmp_path, solver=""):
    """File of the small scene with an implicit integrator and the given line about its solver."""
    path = tmp_path / "disk.toml"
    path.write_text('integrator = "hot"\nscheme = { transfer = "apic" }\n' + solver + SCENE)
    return path


@pytest.mark.parametrize(("solver", "said", "cells"), [
    ("", "implicit: hot, eps 1e-07\n", 0.0),
    ("solver = { cells = 1e-3 }\n", "implicit: hot, eps 1e-07, to hold 0.001 dx\n", 1e-3),
])
def test_info_names_the_method_and_its_tolerances(tmp_path, solver, said, cells):
    scene = implicit(tmp_path, solver)
    assert said in mpm_ref("info", scene).stdout
    facts = json.loads(mpm_ref("info", scene, "--json").stdout)
    assert facts["solver"] == {"method": "hot", "eps": 1e-7, "cells": cells}


def test_run_and_what_it_leaves(tmp_path):
    scene, out = implicit(tmp_path), tmp_path / "run.h5"
    done = mpm_ref("run", scene, "--out", out)
    assert done.exit_code == 0, done.output
    assert "implicit: hot, eps 1e-07" in done.output
    assert json.loads(mpm_ref("info", out, "--json").stdout)["frames"] == 5


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_opening_lines_of_every_shipped_scene(name):
    problem = build(load(shipped_scenes()[name]))
    lines = problem_lines(of_problem(problem))
    assert f"{sum(len(body.id) for body in problem.bodies)} particles" in lines[0]
    assert ("implicit: hot" if problem.integrator == "implicit" else "wave speed") in lines[1]
