"""A run that needs no further step, resumed: what it says of its results, and what it refuses."""

import shutil

import pytest
from command_line import SCENE, assert_told, mpm_ref

from mpm_ref.store.running import checkpoint_of


@pytest.fixture
def over(scene, tmp_path):
    """Arguments of a run that has ended."""
    command = "run", scene, "--out", tmp_path / "run.h5"
    assert mpm_ref(*command).exit_code == 0
    return command


def test_results_of_another_scene_are_refused(over, tmp_path):
    (tmp_path / "other.toml").write_text(SCENE.replace("Disk", "Other"))
    other = tmp_path / "other.h5"
    assert mpm_ref("run", tmp_path / "other.toml", "--out", other).exit_code == 0
    shutil.copy(checkpoint_of(over[-1]), checkpoint_of(other))
    assert_told(mpm_ref("run", over[1], "--out", other, "--resume"), 2,
                f"{other} holds results of another scene")


def test_results_with_fewer_frames_are_refused(over, tmp_path):
    short = tmp_path / "short.h5"
    assert mpm_ref("run", over[1], "--out", short, "--steps", 1).exit_code == 0
    shutil.copy(checkpoint_of(over[-1]), checkpoint_of(short))
    assert_told(mpm_ref("run", over[1], "--out", short, "--resume"), 2,
                f"{short} holds 2 frames, but the checkpoint comes after 5")


def test_frames_are_those_of_the_file(scene, tmp_path):
    command = "run", scene, "--out", tmp_path / "run.h5"
    assert "2 frames in" in mpm_ref(*command, "--steps", 8).stdout
    done = mpm_ref(*command, "--steps", 6, "--resume")
    assert "step limit: step 8, t = 0.008 s, 2 frames in" in done.stdout
