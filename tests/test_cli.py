import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import SCENE, assert_told, mpm_ref

from mpm_ref.store import atomic
from mpm_ref.store.checkpoint import summary
from mpm_ref.store.results import Results
from mpm_ref.store.session import checkpoint_of

ROOT = Path(__file__).resolve().parents[1]
MAIN = "from mpm_ref.cli import main; main()"


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "disk.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    (folder / "disk.toml").write_text(SCENE)
    done = mpm_ref("run", folder / "disk.toml", "--out", folder / "run.h5", "--quiet")
    assert done.exit_code == 0, done.output
    return folder / "run.h5"


def test_run_says_what_is_run_and_how_it_ended(scene, tmp_path):
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5")
    assert done.exit_code == 0
    for words in ("Disk: 2D, 52 particles", "dx = 0.05 m", "wave speed 11.6 m/s",
                  "dt = 0.001 s, 40 steps",
                  "elastic 0.00431 s", "single particle", "memory: particles",
                  "finished: step 40, t = 0.04 s, 5 frames"):
        assert words in done.stdout
    with Results(tmp_path / "run.h5") as results:
        assert results.step.tolist() == [0, 10, 20, 30, 40]
        assert results.manifest["seed"] == 5
        assert json.loads(results.manifest["scene"])["dx"] == 0.05


def test_run_for_machines(scene, tmp_path):
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--json", "--steps", 7,
                   "--threads", 1, "--fields", "x,v", "--gzip", 1)
    answer = json.loads(done.stdout)
    assert (answer["why"], answer["step"], answer["frames"]) == ("step limit", 7, 2)
    assert answer["problem"]["bodies"] == {"disk": 52}
    assert answer["problem"]["bounds"]["viscous"] is None         # infinite
    assert "to go on: mpm-ref run" in done.stderr
    with Results(tmp_path / "run.h5") as results:
        assert results.fields("disk") == ["x", "v"]
        assert results.manifest["machine"]["threads"] == 1
    again = json.loads(mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--json",
                               "--resume").stdout)
    assert (again["why"], again["frames"]) == ("finished", 5)


def test_run_in_pieces_ends_like_the_run(scene, tmp_path, finished):
    out = tmp_path / "run.h5"
    for steps in (13, 20):
        mpm_ref("run", scene, "--out", out, "--resume", "--steps", steps)
    done = mpm_ref("run", scene, "--out", out, "--resume", "--json")
    parts = json.loads(mpm_ref("info", finished, "--json").stdout)["manifest"]["parts"]
    assert json.loads(done.stdout)["state_sha256"] == parts[-1]["state_sha256"]


def test_run_refuses_to_destroy_results(scene, finished):
    assert_told(mpm_ref("run", scene, "--out", finished), 2, "exists", "--overwrite", "--resume")


@pytest.mark.parametrize(("before", "after", "words"), [
    ("dx = 0.05", "dx = -1.0", "dx"),
    ("dim = 2", "dimension = 2", "dimension"),
    ("nu = 0.3", "nu = 0.6", "nu = 0.6"),
    ("dt = 0.001", "dt = 0.1", "past the stable time step"),
    ("dim = 2", "dim = ", "not valid TOML"),
])
def test_bad_scenes_are_told(scene, tmp_path, before, after, words):
    scene.write_text(SCENE.replace(before, after))
    assert_told(mpm_ref("run", scene, "--out", tmp_path / "run.h5"), 2, words)
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize(("options", "words"), [
    (["--steps", 0], "steps = 0"),
    (["--checkpoint-every", -3], "checkpoint_every = -3"),
    (["--fields", "v"], "expected x"),
    (["--gzip", 11], "gzip = 11"),
    (["--threads", 100_000], "threads = 100000"),
    (["--resume", "--overwrite"], "at most one"),
])
def test_bad_options_are_told(scene, tmp_path, options, words):
    assert_told(mpm_ref("run", scene, "--out", tmp_path / "run.h5", *options), 2, words)


def test_a_name_that_is_no_scene_is_told(tmp_path):
    assert_told(mpm_ref("run", tmp_path / "none.toml"), 2, "no such file", "shipped scenes")
    assert_told(mpm_ref("info", tmp_path / "none.h5"), 2, "no such file")


def test_an_unstable_run_is_told(scene, tmp_path):
    text = SCENE.replace("dt = 0.001", 'dt = 0.02\nunstable = "allow"').replace(
        "nu = 0.3 }", "nu = 0.3 }\nvelocity = { linear = [0.0, 1.0], angular = 9.0 }")
    scene.write_text(text.replace("steps = 40", "steps = 4000"))
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--checkpoint-every", 1)
    assert_told(done, 3, "unstable at step", "CFL number", "Last good checkpoint", "--overwrite")
    assert f"step {summary(checkpoint_of(tmp_path / 'run.h5'))['step']}," in done.stderr


def test_a_full_disk_is_told(scene, tmp_path, monkeypatch):
    free = [10_000_000] * 8
    usage = type("Usage", (), {"free": property(lambda self: free.pop() if free else 0)})
    monkeypatch.setattr(atomic.shutil, "disk_usage", lambda _: usage())
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--checkpoint-every", 5)
    assert_told(done, 4, "needed, 0 B free", "Last good checkpoint", "--resume")
    monkeypatch.undo()
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--resume").exit_code == 0


def test_ctrl_c_on_a_terminal(scene, tmp_path):
    scene.write_text(SCENE.replace("steps = 40", "steps = 1000000"))
    out = tmp_path / "run.h5"
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "run", scene, "--out", out, "--checkpoint-every", "10"],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=theirs, text=True,
        env={**os.environ, "COLUMNS": "200"})
    os.close(theirs)
    saved = checkpoint_of(out)
    while process.poll() is None and not (saved.exists() and summary(saved)["step"] >= 10):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    shown = os.read(ours, 1_000_000).decode()
    os.close(ours)
    assert process.returncode == 130
    assert "interrupted: step" in said
    assert "to go on: mpm-ref run" in shown
    assert "/1e+06 steps" in shown
    for words in ("t = ", "dt = 0.001 s", "energy [J] kinetic"):
        assert words in shown
    done = mpm_ref("run", scene, "--out", out, "--resume", "--json", "--steps", 1)
    assert json.loads(done.stdout)["why"] == "step limit"
    assert json.loads(done.stdout)["step"] >= 10


def test_version_and_help():
    assert mpm_ref("--version").stdout.startswith("mpm-ref ")
    for command in ("run", "info", "plot", "animate", "export", "scenes", "oracle"):
        assert mpm_ref(command, "--help").exit_code == 0
        assert command in mpm_ref("--help").stdout
