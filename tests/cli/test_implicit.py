"""The command line on implicit scenes: what it says before, during and after a run."""

import json
import re

import pytest
from command_line import SCENE, mpm_ref

from mpm_ref.cli.catalogue import bundled_scenes
from mpm_ref.cli.info import of_problem, problem_lines
from mpm_ref.scene import build, load
from mpm_ref.simulate import simulate
from mpm_ref.store.results import Results


def implicit(tmp_path, solver=""):
    """File of the small scene with an implicit integrator and the given line about its solver."""
    path = tmp_path / "disk.toml"
    path.write_text('integrator = "hot"\nscheme = { transfer = "apic" }\n' + solver + SCENE)
    return path


@pytest.mark.parametrize(("solver", "said", "tolerance"), [
    ("", "implicit: hot, eps 1e-07\n", 0.0),
    ("solver = { displacement_tolerance = 1e-3 }\n",
     "implicit: hot, eps 1e-07, displacements to 0.001 dx\n", 1e-3),
])
def test_info_names_the_method_and_its_tolerances(tmp_path, solver, said, tolerance):
    scene = implicit(tmp_path, solver)
    assert said in mpm_ref("info", scene).stdout
    facts = json.loads(mpm_ref("info", scene, "--json").stdout)
    assert facts["solver"] == {"method": "hot", "eps": 1e-7,
                               "displacement_tolerance": tolerance}


def test_run_and_what_it_leaves(tmp_path):
    scene, out = implicit(tmp_path), tmp_path / "run.h5"
    done = mpm_ref("run", scene, "--out", out)
    assert done.exit_code == 0, done.output
    assert "implicit: hot, eps 1e-07" in done.output
    assert json.loads(mpm_ref("info", out, "--json").stdout)["frames"] == 5


ALLOWED = """unstable = "allow"
solver = {{ max_iterations = {iterations} }}
walls = {{ low = ["open", 3] }}
"""


def unsolved_of(scene):
    """How many steps of a scene's run are not solved."""
    solved = []
    list(simulate(build(load(scene)), on_step=lambda state, dt: solved.append(
        state.solve.converged)))
    return solved.count(False)


@pytest.mark.parametrize(("iterations", "all_solved"), [(2, False), (100, True)])
def test_steps_that_were_not_solved_are_told(tmp_path, iterations, all_solved):
    scene, out = implicit(tmp_path, ALLOWED.format(iterations=iterations)), tmp_path / "run.h5"
    scene.write_text(scene.read_text().replace("dt = 0.001", "dt = 0.01"))
    n = unsolved_of(scene)
    assert (n == 0) is all_solved
    said = "" if all_solved else f"mpm-ref: warning: {n} implicit steps of the run did not meet"
    run = "run", scene, "--out", out, "--json"
    for command in (run, ("info", out), (*run, "--resume"), ("info", out, "--json")):
        done = mpm_ref(*command)
        assert done.exit_code == 0
        assert done.stderr[:len(said) or None] == said
        assert "run" not in command or json.loads(done.stdout)["unsolved"] == n
    facts = json.loads(done.stdout)
    assert facts["manifest"]["parts"][0]["unsolved"] == n
    assert len(facts["warnings"]) == (not all_solved)


PRINTED = 'solver = { start = "zero", balance = "none" }\n'


@pytest.mark.parametrize(("solver", "n"), [(PRINTED, 40), ("", 0)], ids=["printed", "default"])
def test_a_stiff_body_that_hovers_is_told(tmp_path, solver, n):
    scene, out = implicit(tmp_path, solver), tmp_path / "run.h5"
    scene.write_text(scene.read_text().replace("E = 1e5", "E = 6.9e10"))
    run = "run", scene, "--out", out, "--json"
    for command in (run, ("info", out), (*run, "--resume"), ("info", out, "--json")):
        done = mpm_ref(*command)
        assert done.exit_code == 0
        told = f"warning: {n} implicit steps of the run ended at its start" in done.stderr
        assert told is (n > 0)
        assert "run" not in command or json.loads(done.stdout)["stalled"] == n
    facts = json.loads(done.stdout)
    assert (facts["stalled"], len(facts["warnings"])) == (n, n > 0)
    v = -9.8 * 0.04 if n == 0 else 0.0
    with Results(out) as results:
        assert results.field("disk", "v", -1)[:, 1] == pytest.approx(v, abs=1e-12)


def test_rejected_steps_are_told(tmp_path):
    scene, out = implicit(tmp_path, "solver = { max_iterations = 2 }\n"), tmp_path / "run.h5"
    scene.write_text(scene.read_text().replace("dt = 0.001", "dt = 0.01").replace(
        "[[body]]", 'walls = { low = ["open", 3] }\n[[body]]', 1))
    told = r"[1-9]\d* rejected steps?, tried again with half of dt\n"
    for command in (("run", scene, "--out", out), ("info", out)):
        done = mpm_ref(*command)
        assert done.exit_code == 0, done.output
        assert re.search(told, done.stdout)
    n = json.loads(mpm_ref("info", out, "--json").stdout)["rejected"]
    assert n == json.loads(mpm_ref("run", scene, "--out", out, "--resume", "--json").stdout)[
        "rejected"] > 0


@pytest.mark.parametrize("name", sorted(bundled_scenes()))
def test_opening_lines_of_every_bundled_scene(name):
    problem = build(load(bundled_scenes()[name]))
    lines = problem_lines(of_problem(problem))
    assert f"{sum(len(body.id) for body in problem.bodies)} particles" in lines[0]
    second = next(line for line in lines[1:] if not line.startswith("source "))
    assert ("implicit: hot" if problem.integrator == "implicit" else "wave speed") in second
