"""`mpm-ref law evaluate`: runs by other laws beside the true ones."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_laws import DT, DX, EVERY, FLOWING, STEPS, E, identified, saved, write_scene

from mpm_ref.body import restore_order
from mpm_ref.cli import law
from mpm_ref.scene import build, load
from mpm_ref.simulate import simulate

FRAMES = 1 + STEPS // EVERY
SCENES = Path(__file__).parents[2] / "scenes"
NETS = Path(__file__).parents[2] / "validation" / "nclaw" / "weights"
STIFF = 3e7             # [Pa] too stiff for the step


def evaluate(folder, laws, *options, edits=()):
    return mpm_ref("law", "evaluate", saved(folder, laws), write_scene(folder, *edits), *options)


def told(*arguments, **how):
    done = evaluate(*arguments, "--json", **how)
    return done, json.loads(done.stdout)


def run_of(folder, *edits):
    """Positions (frames, n, 3) of the scene, run by itself."""
    bodies = (frame.state.bodies[0] for frame in
              simulate(build(load(write_scene(folder, *edits, name="alone.toml")))))
    return np.array([restore_order(body.particles.x, body.id) for body in bodies])


def test_the_true_laws_are_not_off(tmp_path):
    done, found = told(tmp_path, identified())
    assert done.exit_code == 0
    assert (found["error"], found["frames"], found["steps"]) == (0.0, FRAMES, STEPS)
    assert found["broken"] is None


def test_errors_are_those_of_two_runs_by_themselves(tmp_path):
    """NCLAW-eval: means over points and axes, then over frames, the first included."""
    softer = f"E = {E}", f"E = {0.5 * E}"
    expected = np.mean((run_of(tmp_path, softer) - run_of(tmp_path)) ** 2, axis=(1, 2))
    done, found = told(tmp_path, identified(0.5 * E), "--out", tmp_path / "errors.csv")
    assert done.exit_code == 0
    assert 0.0 < expected[1] < expected[-1]
    assert found["error"] == pytest.approx(expected.mean(), rel=1e-9)
    assert found["sound"]["last"] == pytest.approx(expected[-1], rel=1e-9)
    assert found["largest"]["frame"] == int(expected.argmax())
    with open(tmp_path / "errors.csv") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == [EVERY * k for k in range(FRAMES)]
    assert [float(row["t"]) for row in rows] == pytest.approx(DT * EVERY * np.arange(FRAMES))
    assert [float(row["error"]) for row in rows] == pytest.approx(expected, rel=1e-9)


def test_words_are_those_numbers(tmp_path):
    done = evaluate(tmp_path, identified(0.5 * E), "--steps", 10)
    assert done.exit_code == 0
    found = told(tmp_path, identified(0.5 * E), "--steps", 10)[1]
    what, mean, last = done.stdout.splitlines()
    assert what == "Cube: 27 particles, 10 steps of 0.0005 s, 3 frames"
    assert f"over 3 frames: {found['error']:.4g} m^2" in mean
    assert f"root {found['error'] ** 0.5 / DX:.3g} dx" in mean
    assert f"{found['sound']['last']:.3g} m^2; at most {found['largest']['error']:.3g}" in last


def test_a_run_that_breaks_down_says_where(tmp_path):
    done, found = told(tmp_path, identified(STIFF), "--out", tmp_path / "errors.csv")
    assert done.exit_code == 3
    assert found["error"] is None
    assert EVERY < found["broken"]["step"] <= STEPS
    assert "position" in found["broken"]["why"]
    rows = (tmp_path / "errors.csv").read_text().splitlines()[1:]
    endless = [row.endswith(",inf") for row in rows]
    assert endless == [EVERY * k >= found["broken"]["step"] for k in range(FRAMES)]
    said = evaluate(tmp_path, identified(STIFF)).stdout
    assert f"the learned laws broke down in step {found['broken']['step']}: " in said
    assert f"over {endless.count(False)} frames, the frames before: " in said


def test_true_laws_that_break_down_are_told(tmp_path):
    stiff = ("E = 100000.0", "E = 1e12"), ("dim = 3", 'dim = 3\nunstable = "allow"')
    assert_told(evaluate(tmp_path, identified(), edits=stiff), 3, "its own laws break down in step")


def test_frames_are_all_steps_where_the_scene_shows_none(tmp_path):
    found = told(tmp_path, identified(), edits=[(f"every = {EVERY}\n", "")])[1]
    assert found["frames"] == STEPS + 1


def test_steps_of_another_length_than_in_training_are_warned_of(tmp_path):
    laws = identified()
    assert evaluate(tmp_path, laws._replace(about={"dt": DT})).stderr == ""
    assert_told(evaluate(tmp_path, laws._replace(about={"dt": 2.0 * DT})), 0,
                "trained in steps of 0.001 s, the scene has dt = 0.0005 s")


@pytest.mark.parametrize(("edits", "words"), [
    ([(f"dt = {DT}", "cfl = 0.5")], "a fixed `dt`"),
    ([(f"every = {EVERY}", "interval = 0.001")], "expected frames by `every`"),
    ([("dim = 3", "dim = 3\nx = 1")], "unknown key"),
])
def test_scenes_that_cannot_be_compared_are_refused(tmp_path, edits, words):
    assert_told(evaluate(tmp_path, identified(), edits=edits), 2, "cube.toml", words)


def test_several_materials_are_refused(tmp_path):
    body = write_scene(tmp_path, FLOWING).read_text().partition("[[body]]")[2]
    scene = write_scene(tmp_path)
    scene.write_text(f"{scene.read_text()}[[body]]{body.replace('cube', 'other')}")
    done = mpm_ref("law", "evaluate", saved(tmp_path, identified()), scene)
    assert_told(done, 2, "its bodies are of several materials, expected one")


def test_a_scene_in_2d_is_refused(tmp_path, scene):
    done = mpm_ref("law", "evaluate", saved(tmp_path, identified()), scene)
    assert_told(done, 2, "its laws are for 3 dimensions, but ", "has dim = 2; name another scene")


@pytest.mark.parametrize(("weights", "options", "status", "words"), [
    ("none.npz", (), 2, "none.npz cannot be read: No such file"),
    ("cube.toml", (), 2, "cube.toml is not an npz file"),
    ("laws.npz", ("--out", "errors.txt"), 2, "ends in .csv"),
    ("laws.npz", ("--out", "none/errors.csv"), 4, "there is no folder"),
])
def test_what_an_evaluation_needs_is_said_first(
        tmp_path, monkeypatch, weights, options, status, words):
    monkeypatch.setattr(law, "compare_with_progress", None)
    saved(tmp_path, identified())
    write_scene(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert_told(mpm_ref("law", "evaluate", weights, "cube.toml", *options), status, words)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cube.toml", "laws.npz"]


def test_a_scene_that_does_not_exist_is_told_with_those_that_do(tmp_path):
    done = mpm_ref("law", "evaluate", saved(tmp_path, identified()), "none")
    assert_told(done, 2, "nor a bundled scene of that name", "nclaw_jelly")


NARROW = {"low": [0.999] * 4, "high": [1.001] * 4}
WIDE = {"low": [0.0] * 4, "high": [9.0] * 4}


@pytest.mark.parametrize(("seen", "times"), [(NARROW, 1), (WIDE, 0), (None, 0)],
                         ids=["narrow", "wide", "unknown"])
def test_strains_that_were_never_met_are_told_once(tmp_path, seen, times):
    laws = identified()
    about = laws.about if seen is None else laws.about | {"seen": seen}
    done = evaluate(tmp_path, laws._replace(about=about))
    words = " ".join(done.stderr.split())
    assert words.count("are outside what its learned law has seen in training") == times
    assert done.exit_code == 0


def test_two_learned_laws_are_told(tmp_path):
    text, weights = (SCENES / "nclaw_jelly.toml").read_text(), NETS / "jelly.npz"
    true = 'law = "fixed_corotated", E = 1e5, nu = 0.2'
    assert true in text
    (tmp_path / "own.toml").write_text(text.replace(true, f'law = "neural", weights = "{weights}"'))
    done = mpm_ref("law", "evaluate", weights, tmp_path / "own.toml", "--steps", 5)
    assert "this compares two learned laws; name the scene" in " ".join(done.stderr.split())
    assert done.exit_code == 0
