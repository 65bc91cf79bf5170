"""What the command line says of files that are something else, and of keys that do not fit."""

import json
from math import inf, nan
from pathlib import Path

import pytest
from command_line import SCENE, assert_told, mpm_ref

from mpm_ref.cli.run import Bar, Request
from mpm_ref.energy import Energy
from mpm_ref.store.running import checkpoint_of

HOT = 'integrator = "hot"\n' + SCENE.replace("dt = 0.001", "dt = 0.01")
FLOOR = """
[[collider]]
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }

[[collider]]
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }
kind = "slip"
friction = 0.3
"""


# files that are something else

def test_a_cut_checkpoint_is_told_as_one(finished, tmp_path):
    whole = checkpoint_of(finished).read_bytes()
    for size in (4000, len(whole) - 1):
        cut = tmp_path / "cut.checkpoint.h5"
        cut.write_bytes(whole[:size])
        assert_told(mpm_ref("info", cut), 2, f"{cut} is cut short or is not a checkpoint")


def test_a_checkpoint_is_no_results_file(finished):
    for command in ("plot", "export"):
        assert_told(mpm_ref(command, checkpoint_of(finished)), 2, "is a checkpoint, from which",
                    "but not a results file")


def test_a_golden_file_is_no_results_file(golden):
    for command in ("info", "plot"):
        assert_told(mpm_ref(command, golden), 2, f"{golden} is a golden file, for `mpm-ref oracle")


def test_a_folder_is_told_as_one(golden, tmp_path):
    for command in (["info"], ["run"], ["oracle", "record"], ["plot"], ["oracle", "check", golden]):
        out = ["-o", tmp_path / "out.png"] if command == ["plot"] else []
        assert_told(mpm_ref(*command, tmp_path, *out), 2, f"{tmp_path}: this is a folder")


@pytest.mark.parametrize("name", ["run.toml", "run.TOML", "run.json"])
def test_results_are_not_named_like_scenes(scene, tmp_path, name):
    for command in (["run", "--overwrite"], ["oracle", "record"]):
        done = mpm_ref(*command, scene, "--out", tmp_path / name)
        assert_told(done, 2, f"--out {tmp_path / name}: scenes have such names")
    assert not (tmp_path / name).exists()


# the bar

@pytest.mark.parametrize(("energy", "said"), [
    (Energy(2.0, 1.0, -0.5), ", E_kin 2, E 2.5 J"), (Energy(2.0, nan, -0.5), ", E_kin 2 J"),
    (Energy(inf, nan, -0.5), "")], ids=["known", "law without energy", "none"])
def test_energies_that_are_not_finite_are_left_out_of_the_bar(energy, said):
    bar = Bar(Request("disk", Path("run.h5")))
    bar.frame(None, energy)
    assert bar.energies == said


# one of a thing, and what broke

def test_one_is_said_as_one(scene, tmp_path):
    scene.write_text(SCENE.replace("steps = 40", "steps = 1"))
    assert "\n1 step, fixed dt" in mpm_ref("run", scene, "--out", tmp_path / "run.h5").stdout
    assert "2 frames, t = 0 to 0.001 s, 1 step; at" in mpm_ref("info", tmp_path / "run.h5").stdout
    out = tmp_path / "none.h5"
    scene.write_text(SCENE)
    done = mpm_ref("run", scene, "--out", out, "--steps", 1)
    assert "2 frames in" in done.stdout
    assert "after 1 frame;" in mpm_ref("info", checkpoint_of(out)).stdout


def test_why_a_part_broke_comes_last(scene, tmp_path):
    text = SCENE.replace("dt = 0.001", 'dt = 0.02\nunstable = "allow"').replace("= 40", "= 4000")
    scene.write_text(text.replace("nu = 0.3 }", "nu = 0.3 }\nvelocity = { angular = 9.0 }"))
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5").exit_code == 3
    part, = (line for line in mpm_ref("info", tmp_path / "run.h5").stdout.splitlines()
             if line.startswith("part: "))
    facts, _, why = part.partition(": Unstable: unstable at step ")
    assert facts.rpartition(", ")[2].startswith("state sha256 ")
    assert why.endswith("take a smaller dt, or look at the last checkpoint")


# what bounds the step

@pytest.mark.parametrize(("longest", "said"), [
    ("longest = 0.002\n", "dt adaptive, cfl 0.5, longest 0.002 s, "),
    ("", "dt adaptive, cfl 0.5, "),
])
def test_the_longest_step_is_said(scene, longest, said):
    for head, rest in (("", "bound at the start 0.00361 s ("),
                       ('integrator = "hot"\n', "no particle bounds it at the start")):
        scene.write_text(head + longest + SCENE.replace("dt = 0.001\n", "").replace(
            "-9.8", "0.0" if head else "-9.8"))
        facts = json.loads(mpm_ref("info", scene, "--json").stdout)
        assert facts["longest"] == (0.002 if longest else None)
        assert f"40 steps, {said}{rest}" in mpm_ref("info", scene).stdout


# keys that do not fit

def test_a_solver_without_a_method_says_what_to_do(scene):
    for head in ("", 'integrator = "explicit"\n'):
        scene.write_text(head + SCENE + "\n[solver]\neps = 1e-9\n")
        assert_told(mpm_ref("info", scene), 2, f'{scene}: solver: given, but the integrator is "ex',
                    'add integrator = "hot"', "or remove this table")


def test_friction_is_for_all_methods_but_admm(scene):
    scene.write_text(HOT + FLOOR)
    assert mpm_ref("info", scene).exit_code == 0
    scene.write_text(HOT.replace('"hot"', '"admm"') + FLOOR)
    assert_told(mpm_ref("info", scene), 2, f"{scene}: integrator: friction with the method 'admm'")
    plastic = HOT + '\n[solver]\nreturn_map = "implicit"\n'
    snow = 'nu = 0.3, flow = { type = "snow_clamp", s_min = 0.9, s_max = 1.1 } }'
    scene.write_text(plastic.replace("nu = 0.3 }", snow))
    assert_told(mpm_ref("info", scene), 2, f"{scene}: body[0].material.flow: body ",
                "with return_map = 'implicit'")


@pytest.mark.parametrize(("solver", "key"), [
    ("max_iterations = 1, eps = 1e-30", "max_iterations"), ("eps = 1e-30", "eps"),
    ("displacement_tolerance = 1e-30", "displacement_tolerance"),
    ("max_iterations = 1, displacement_tolerance = 1e-30", "max_iterations"),
])
def test_a_step_that_is_not_solved_names_the_key(scene, tmp_path, solver, key):
    walls = 'walls = { low = ["open", 3] }\n'
    scene.write_text(f"solver = {{ {solver} }}\n{walls}{HOT}")
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5")
    assert_told(done, 3, "the implicit step was not solved",
                f"give the solver a larger `{key}`, or take a smaller dt.")
