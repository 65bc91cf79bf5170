import json
import os
import pty
import re
import runpy
import signal
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import pytest
from command_line import SCENE, assert_told, mpm_ref
from small_runs import colliding

from mpm_ref import __version__
from mpm_ref.cli import terminal
from mpm_ref.cli.run import Bar, Request
from mpm_ref.core import kernel_cache
from mpm_ref.simulate import State, start
from mpm_ref.store import atomic
from mpm_ref.store.checkpoint import BadCheckpoint, summary
from mpm_ref.store.results import Results
from mpm_ref.store.running import checkpoint_of

ROOT = Path(__file__).resolve().parents[2]
MAIN = "from mpm_ref.cli import main; main()"


def test_run_says_what_is_run_and_how_it_ended(scene, tmp_path):
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5")
    assert done.exit_code == 0
    for words in ("Disk: 2D, 52 particles", "dx = 0.05 m", "wave speed 11.6 m/s",
                  "40 steps, fixed dt = 0.001 s, bound at the start 0.00361 s (",
                  "elastic 0.00431 s", "single particle", "memory: particles",
                  "finished: step 40, t = 0.04 s, 5 frames"):
        assert words in done.stdout
    assert "inf" not in done.stdout        # terms that bound nothing are left out
    with Results(tmp_path / "run.h5") as results:
        assert results.step.tolist() == [0, 10, 20, 30, 40]
        assert results.manifest["seed"] == 5
        assert json.loads(results.manifest["scene"])["dx"] == 0.05


def test_the_package_is_the_command(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["mpm_ref", "--version"])
    monkeypatch.setattr(terminal.Telling, "active", False)      # the program tells its progress
    monkeypatch.setattr(kernel_cache, "compilations", [])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("mpm_ref", run_name="__main__")
    assert ended.value.code == 0
    assert __version__ in capsys.readouterr().out


def test_an_adaptive_step_is_said(scene):
    scene.write_text(SCENE.replace("dt = 0.001", "cfl = 0.3"))
    assert "40 steps, dt adaptive, cfl 0.3, bound at the start 0.00361 s (" in mpm_ref(
        "info", scene).stdout


def test_run_for_machines(scene, tmp_path):
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--json", "--steps", 7,
                   "--threads", 1, "--fields", "x,v", "--gzip", 1)
    answer = json.loads(done.stdout)
    assert (answer["why"], answer["step"], answer["frames"]) == ("step limit", 7, 2)
    assert answer["problem"]["bodies"] == {"disk": 52}
    assert set(answer["problem"]["bounds"]) == {"advective", "elastic", "single_particle"}
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


@pytest.mark.parametrize(("options", "words"), [
    (["--fields", "x"], "begun with the fields x,v and gzip 1, not with x and gzip 0"),
    (["--fields", "x,v", "--gzip", 2], "begun with the fields x,v and gzip 1, not with x,v"),
    (["--gzip", 1], "not with x,v,F,tau and gzip 1"),
])
def test_a_run_that_goes_on_stores_what_it_began_with(scene, tmp_path, options, words):
    command = "run", scene, "--out", tmp_path / "run.h5", "--resume"
    assert mpm_ref(*command, "--fields", "x,v", "--gzip", 1, "--steps", 2).exit_code == 0
    assert_told(mpm_ref(*command, *options), 2, words, "leave fields and gzip out")
    assert mpm_ref(*command, "--fields", "v,x", "--gzip", 1, "--steps", 3).exit_code == 0
    assert mpm_ref(*command).exit_code == 0
    with Results(tmp_path / "run.h5") as results:
        assert results.fields("disk") == ["x", "v"]
    assert_told(mpm_ref(*command, *options), 2, words)         # also where nothing is left to do


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


MESH = SCENE.replace("dim = 2", "dim = 3").replace("gravity = [0.0, -9.8]", "").replace(
    'type = "sphere", center = [0.5, 0.3], radius = 0.1', 'type = "mesh", file = "none.stl"')
ARRAYS = "\n".join(line for line in SCENE.replace("shape = ", "particles = ").replace(
    'type = "sphere", center = [0.5, 0.3], radius = 0.1', 'file = "none.npz"').splitlines()
    if not line.startswith("sampling"))


@pytest.mark.parametrize(("text", "words"), [
    (SCENE.replace("dt = 0.001", "dt = 0.1"), "dt = 0.1 s is past the stable time step"),
    (MESH, "none.stl': no such file"),
    (ARRAYS, "none.npz': no such file"),
    (SCENE.replace("radius = 0.1", "radius = 1e-4"), "no sample point is inside"),
], ids=["dt", "mesh", "arrays", "sampling"])
def test_what_is_wrong_with_a_scene_begins_with_its_file(scene, tmp_path, text, words):
    scene.write_text(text)
    commands = [["run", scene, "--out", tmp_path / "run.h5"]]
    if "past" not in words:
        commands += [["info", scene], ["oracle", "record", scene, "-o", tmp_path / "golden.h5"]]
    for command in commands:
        done = mpm_ref(*command)
        assert_told(done, 2, words)
        assert done.stderr.startswith(f"mpm-ref: {scene}: ")
        assert done.stderr.count(str(scene)) == 1


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
    assert_told(mpm_ref("run", tmp_path / "none.toml"), 2, "no such file", "bundled scenes")


@pytest.mark.parametrize(("content", "what"), [
    (None, "there is no such file"), (b"", "empty"), (b"dim = 2", "HDF5"),
], ids=["missing", "empty", "text"])
def test_a_file_that_is_no_hdf5_is_told(finished, tmp_path, content, what):
    file = tmp_path / "some.h5"
    if content is not None:
        file.write_bytes(content)
    for command in ("run", "info"):
        assert_told(mpm_ref(command, file), 2, f"{file}: ", what, "expected a scene",
                    "what `mpm-ref run` wrote")
    assert_told(mpm_ref("plot", file), 2, str(file), what, "expected a results file")
    assert_told(mpm_ref("oracle", "check", file, finished), 2, f"{file}: ", what,
                "expected a golden file", "mpm-ref oracle record SCENE")


def test_results_are_no_scene(finished):
    assert_told(mpm_ref("run", finished), 2, "an HDF5 file is no scene")


FLOOR = """
[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.25], normal = [0.0, 1.0] }
"""


def test_particles_in_a_collider_are_warned_of_once(scene, tmp_path):
    scene.write_text(SCENE + FLOOR)
    command = "run", scene, "--out", tmp_path / "run.h5"
    warning = ("mpm-ref: warning: 10 of the 52 particles of body 'disk' start inside collider[0] "
               "'floor', up to 0.0375 m deep (0.75 dx)")
    done = mpm_ref(*command, "--steps", 2, "--json")
    assert done.exit_code == 0
    assert done.stderr.startswith(warning)
    assert done.stderr.count("warning") == 1
    assert json.loads(done.stdout)["problem"]["warnings"][0] in done.stderr
    assert "warning" not in mpm_ref(*command, "--resume", "--steps", 3).stderr
    assert_told(mpm_ref("info", scene), 0, warning)
    scene.write_text(SCENE)
    assert mpm_ref("info", scene).stderr == ""


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


def on_terminal(*arguments, columns=100):
    """(process, file of what its terminal shows) of the command line on a terminal of its own."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=theirs,
        text=True, env={**os.environ, "COLUMNS": str(columns)})
    os.close(theirs)
    return process, ours


def reached(saved, step):
    """Whether a checkpoint is there, of that step or a later one; not one that is just replaced."""
    try:
        return summary(saved)["step"] >= step
    except BadCheckpoint:
        return False


def test_ctrl_c_on_a_terminal(scene, tmp_path):
    scene.write_text(SCENE.replace("steps = 40", "steps = 1000000"))
    out = tmp_path / "run.h5"
    process, ours = on_terminal("run", scene, "--out", out, "--checkpoint-every", "10")
    saved = checkpoint_of(out)
    while process.poll() is None and not reached(saved, 10):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    shown = os.read(ours, 1_000_000).decode()
    os.close(ours)
    assert process.returncode == 130
    assert "interrupted: step" in said
    assert "to go on: mpm-ref run" in shown
    lines = [line for line in re.split(r"[\r\n]+", shown) if "/1e+06 steps [" in line]
    assert max(map(len, lines)) <= 100
    assert re.fullmatch(r".*\|.*\| \d+/1e\+06 steps \[[\d:]+<[\d:?]+, t [\d.e-]+, dt 0.001 s, "
                        r"E_kin [\d.e-]+, E [\d.e+]+ J\]", lines[-1])
    done = mpm_ref("run", scene, "--out", out, "--resume", "--json", "--steps", 1)
    assert json.loads(done.stdout)["why"] == "step limit"
    assert json.loads(done.stdout)["step"] >= 10


@pytest.mark.parametrize(("command", "words"), [
    (["info"], "52 particles"), (["oracle", "record", "--steps", "1"], "1 step of Disk"),
], ids=["info", "record"])
def test_compilation_is_said_on_a_terminal_alone(scene, tmp_path, command, words):
    if "record" in command:
        command = [*command, "-o", tmp_path / "golden.h5"]
    process, ours = on_terminal(*command, scene)
    said, _ = process.communicate(timeout=60)
    shown = os.read(ours, 1_000_000).decode()
    os.close(ours)
    assert words in said
    assert shown.startswith("\rcompiling kernels")
    assert shown.rsplit("\r", 2)[1].strip() == ""       # wiped in the end
    assert mpm_ref("info", scene).stderr == ""


class Terminal(StringIO):
    def isatty(self):
        return True


def test_time_left_is_counted_from_the_first_step(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    problem = colliding()
    with Bar(Request("two blocks", Path("run.h5"))) as watch:
        watch.begin(problem, start(problem, problem.stepper()))
        watch.bar.start_t -= 1000.0                     # as if kernels had compiled for so long
        watch.step(State(problem.bodies, step=1, t=5e-4), 5e-4)
        assert watch.bar.format_dict["elapsed"] < 100.0
        assert (watch.bar.n, watch.bar.initial) == (1, 1)


def test_version_and_help():
    assert mpm_ref("--version").stdout.startswith("mpm-ref ")
    for command in ("run", "info", "plot", "animate", "export", "scenes", "oracle"):
        assert mpm_ref(command, "--help").exit_code == 0
        assert command in mpm_ref("--help").stdout
