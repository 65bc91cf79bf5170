"""What the command line refuses leaves every file as it was, and is said in one sentence."""

import shutil

import numpy as np
import pytest
from command_line import SCENE, assert_told, mpm_ref

from mpm_ref import oracle

SECOND = """
[[body]]
name = "far"
density = 1000.0
shape = { type = "sphere", center = [1e5, 1e5], radius = 0.1 }
sampling = { type = "regular", per_cell = 2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
"""
FAR = 'integrator = "hot"\n' + SCENE + SECOND       # its grid is dense
TOO_LARGE = SCENE.replace("dt = 0.001", "dt = 0.1")
STATE = SCENE.replace('shape = { type = "sphere", center = [0.5, 0.3], radius = 0.1 }',
                      'particles = { file = "state.npz" }').replace(
    'sampling = { type = "regular", per_cell = 2 }\n', "")


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    folder = tmp_path_factory.mktemp("earlier")
    (folder / "disk.toml").write_text(SCENE)
    done = mpm_ref("run", folder / "disk.toml", "--out", folder / "run.h5", "--steps", 2)
    assert done.exit_code == 0, done.output
    return folder


def contents(folder):
    """{path: bytes} of all files below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def write_state(path, stretch):
    """A file of two particles with F = stretch I."""
    np.savez(path, x=[[0.5, 0.3], [0.52, 0.3]], v=np.zeros((2, 2)), V0=np.full(2, 6e-4),
             F=np.tile(stretch * np.eye(2), (2, 1, 1)))


# a scene that is refused

@pytest.mark.parametrize("options", [[], ["--overwrite"], ["--resume"]])
@pytest.mark.parametrize(("text", "told"), [
    (FAR, (2, "need a grid of")),
    (TOO_LARGE, (2, "past the stable time step")),
    (STATE, (3, "unstable at step 0")),
], ids=["grid", "dt", "state"])
def test_a_scene_that_cannot_begin_changes_nothing(scene, tmp_path, earlier, options, text, told):
    out = tmp_path / "run.h5"
    if options == ["--overwrite"]:
        for name in ("run.h5", "run.checkpoint.h5"):
            shutil.copy(earlier / name, tmp_path / name)
    scene.write_text(text)
    write_state(tmp_path / "state.npz", 40.0)
    before = contents(tmp_path)
    done = mpm_ref("run", scene, "--out", out, *options)
    assert_told(done, *told)
    assert done.stderr.startswith(f"mpm-ref: {scene}: ")
    assert contents(tmp_path) == before


def test_a_state_that_can_begin_does(scene, tmp_path):
    scene.write_text(STATE)
    write_state(tmp_path / "state.npz", 1.01)
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--steps", 1).exit_code == 0


def test_bodies_far_apart_run_explicitly(scene, tmp_path):
    scene.write_text(SCENE + SECOND)
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--steps", 1).exit_code == 0


def test_info_of_a_scene_without_a_grid_begins_with_its_name(scene):
    scene.write_text(FAR)
    done = mpm_ref("info", scene)
    assert_told(done, 2, "need a grid of")
    assert done.stderr.startswith(f"mpm-ref: {scene}: ")


# files that are not to be replaced

@pytest.mark.parametrize("options", [[], ["--overwrite"], ["--resume"]])
def test_a_scene_is_not_replaced_by_its_results(scene, tmp_path, options):
    link = tmp_path / "link.toml"
    link.symlink_to(scene)
    for out in (scene, link):
        assert_told(mpm_ref("run", scene, "--out", out, *options), 2, "the scene itself")
        assert_told(mpm_ref("oracle", "record", scene, "-o", out), 2, "the scene itself")
    assert scene.read_text() == SCENE


def test_results_are_not_replaced_by_an_export(tmp_path, earlier):
    for command in ("export", "plot"):
        results = tmp_path / f"run.{'hdf' if command == 'export' else 'png'}"
        shutil.copy(earlier / "run.h5", results)
        assert_told(mpm_ref(command, results, "-o", results), 2, "the results file itself")
        assert results.read_bytes() == (earlier / "run.h5").read_bytes()


@pytest.mark.parametrize("content", ["theirs", "golden", "checkpoint", ""])
def test_only_results_are_overwritten(scene, tmp_path, earlier, content):
    out = tmp_path / "run.h5"
    out.write_text(content)
    if content == "golden":
        out.unlink()
        assert mpm_ref("oracle", "record", scene, "-o", out, "--steps", 1).exit_code == 0
    elif content == "checkpoint":
        shutil.copy(earlier / "run.checkpoint.h5", out)
    before = contents(tmp_path)
    assert_told(mpm_ref("run", scene, "--out", out, "--overwrite"), 2, str(out),
                "is not a results file", "name another file")
    assert_told(mpm_ref("run", scene, "--out", out, "--resume"), 2, str(out),
                "expected a results file" if content in ("theirs", "") else "not a results file")
    assert contents(tmp_path) == before


def test_results_are_overwritten_when_asked(scene, tmp_path, earlier):
    shutil.copy(earlier / "run.h5", tmp_path / "run.h5")
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--overwrite", "--steps",
                   1).exit_code == 0


def test_a_golden_file_is_replaced_when_asked(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    command = "oracle", "record", scene, "-o", golden, "--steps", 1
    assert mpm_ref(*command).exit_code == 0
    before = contents(tmp_path)
    assert_told(mpm_ref(*command), 2, f"{golden} exists", "--overwrite")
    assert contents(tmp_path) == before
    scene.write_text(SCENE.replace('title = "Disk"', 'title = "Other"'))
    assert mpm_ref(*command, "--overwrite").exit_code == 0
    assert golden.read_bytes() != before[golden]


@pytest.mark.parametrize("theirs", ["run.h5", "other.h5", "notes.txt"])
def test_only_golden_files_are_replaced(scene, tmp_path, earlier, theirs):
    out = tmp_path / theirs
    if theirs == "run.h5":
        shutil.copy(earlier / "run.h5", out)
    elif theirs == "other.h5":
        oracle.write(out, [{}])
    else:
        out.write_text("mine")
    before = contents(tmp_path)
    assert_told(mpm_ref("oracle", "record", scene, "-o", out, "--steps", 1, "--overwrite"), 2,
                f"{out} is not a golden file", "name another file")
    assert contents(tmp_path) == before


# places where nothing can be written

def commands(scene, results, out):
    """Every command that writes a file, asked to write `out` with its suffix."""
    return [
        ["run", scene, "--out", out.with_suffix(".h5")],
        ["run", scene, "--out", out.with_suffix(".h5"), "--overwrite"],
        ["oracle", "record", scene, "-o", out.with_suffix(".h5"), "--steps", 1],
        ["plot", results, "-o", out.with_suffix(".png")],
        ["animate", results, "-o", out.with_suffix(".gif")],
        ["export", results, "-o", out.with_suffix(".vtkhdf")],
        ["export", results, "--grid", "-o", out.with_suffix(".vtkhdf")],
    ]


def test_a_missing_folder_is_told(scene, tmp_path, earlier):
    for command in commands(scene, earlier / "run.h5", tmp_path / "none" / "out"):
        done = mpm_ref(*command)
        assert_told(done, 4, f"there is no folder {tmp_path / 'none'}; create it")
        assert "disk full" not in done.stderr


def test_a_folder_in_place_of_the_file_is_told(scene, tmp_path, earlier):
    for suffix in (".h5", ".png", ".gif", ".vtkhdf"):
        (tmp_path / "out").with_suffix(suffix).mkdir()
    for command in commands(scene, earlier / "run.h5", tmp_path / "out"):
        assert_told(mpm_ref(*command), 4, "is a folder; name a file")


# what else is said

def test_help_says_what_is_the_default():
    said = " ".join(mpm_ref("run", "--help").stdout.replace("│", " ").split())
    for words in ("Number of threads (default: all).", "Level of compression, 1 to 9"):
        assert words in said
    assert "Run scenes with the material point method" in mpm_ref("--help").stdout
