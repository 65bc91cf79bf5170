import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from mpm_ref import atomic, oracle, plotting
from mpm_ref.checkpoint import summary
from mpm_ref.cli import app
from mpm_ref.results import Results
from mpm_ref.session import checkpoint_of
from mpm_ref.shipped import find_scene, shipped_scenes

ROOT = Path(__file__).resolve().parents[1]
SCENE = """
title = "Disk"
dim = 2
dx = 0.05
dt = 0.001
steps = 40
every = 10
gravity = [0.0, -9.8]
seed = 5

[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.3], radius = 0.1 }
sampling = { type = "regular", per_cell = 2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
"""


MAIN = "from mpm_ref.cli import main; main()"


def mpm_ref(*arguments):
    """What the command line answers: exit code, output, errors."""
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


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


def assert_told(done, code, *words):
    """One sentence on the error channel, and no traceback."""
    assert done.exit_code == code
    assert done.stderr.startswith("mpm-ref: ")
    assert done.stderr.count("\n") == 1
    for word in words:
        assert word in done.stderr


# run

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
    assert_told(done, 3, "unstable at step", "CFL number", "Last good checkpoint", "--resume")
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
    process = subprocess.Popen([sys.executable, "-c", MAIN, "run", scene, "--out", out], cwd=ROOT,
                               stdout=subprocess.PIPE, stderr=theirs, text=True,
                               env={**os.environ, "COLUMNS": "200"})
    os.close(theirs)
    while process.poll() is None and not checkpoint_of(out).exists():
        time.sleep(0.05)
    time.sleep(0.5)
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
    assert json.loads(done.stdout)["step"] > 1


# info, scenes, oracle

def test_info_of_results(finished):
    done = mpm_ref("info", finished)
    for words in ("Disk: 2D", "disk 52 (x v F tau)", "5 frames, t = 0 to 0.04 s", "finished",
                  "state sha256", "run.checkpoint.h5"):
        assert words in done.stdout
    facts = json.loads(mpm_ref("info", finished, "--json").stdout)
    assert (facts["frames"], facts["steps"], facts["time"]) == (5, 40, [0.0, 0.04])


def test_info_of_a_checkpoint_and_of_a_scene(finished, scene):
    checkpoint = checkpoint_of(finished)
    assert "step 40, t = 0.04 s, after 5 frames" in mpm_ref("info", checkpoint).stdout
    assert json.loads(mpm_ref("info", checkpoint, "--json").stdout)["step"] == 40
    assert "52 particles" in mpm_ref("info", scene).stdout
    assert json.loads(mpm_ref("info", scene, "--json").stdout)["nodes"] > 0


def test_info_of_damaged_files(finished, tmp_path):
    for name, source in (("cut.h5", finished), ("cut.checkpoint.h5", checkpoint_of(finished))):
        (tmp_path / name).write_bytes(source.read_bytes()[:4000])
        assert_told(mpm_ref("info", tmp_path / name), 2, name)


def test_scenes_are_listed():
    done = mpm_ref("scenes")
    assert done.exit_code == 0
    assert set(json.loads(mpm_ref("scenes", "--json").stdout)) == set(shipped_scenes())
    for name in shipped_scenes():
        assert name in done.stdout
        assert find_scene(name) == ROOT / "scenes" / f"{name}.toml"


def test_oracle(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    done = mpm_ref("oracle", "record", scene, "-o", golden, "--steps", 1)
    assert (done.exit_code, done.stdout) == (0, f"{golden}: 1 steps of Disk\n")
    with h5py.File(golden) as h5:
        nodes, mass = h5["steps/0/nodes"][()], h5["steps/0/mass"][()]
    for factor, code, words in ((1.0, 0, "agrees"), (1.0 + 1e-6, 1, "array mass")):
        oracle.write(tmp_path / "other.h5", [{"nodes": nodes, "mass": factor * mass}])
        done = mpm_ref("oracle", "check", golden, tmp_path / "other.h5")
        assert done.exit_code == code
        assert words in done.stdout
        done = mpm_ref("oracle", "check", golden, tmp_path / "other.h5", "--json")
        assert json.loads(done.stdout)["agrees"] is (code == 0)


def test_bad_requests_to_the_oracle_are_told(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    assert_told(mpm_ref("oracle", "record", scene, "-o", golden, "--steps", 0), 2, "steps = 0")
    assert_told(mpm_ref("oracle", "check", scene, scene), 2, "cannot be read as HDF5")


# plot, animate, export

@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_plot(finished, tmp_path, suffix):
    out = tmp_path / f"disk.{suffix}"
    done = mpm_ref("plot", finished, "--frame", 2, "--field", "pressure", "-o", out)
    assert (done.exit_code, done.stdout.strip()) == (0, str(out))
    assert out.read_bytes()[:4] in (b"\x89PNG", b"%PDF", b"<?xm")


def test_plot_draws_the_particles(finished):
    with Results(finished) as results:
        figure = plotting.draw(results, frame=1, field="speed")
        points = figure.axes[0].collections[0]
        np.testing.assert_array_equal(points.get_offsets(), results.field("disk", "x", 1))
        np.testing.assert_array_equal(points.get_array(), results.scalar("disk", "speed", 1))
        assert figure.axes[0].get_ylabel() == "y [m]"
        assert "t = 0.01 s" in figure.axes[0].get_title()


def test_view_has_gravity_pointing_down():
    def view(*gravity):
        return plotting.view_of(type("Some", (), {"gravity": np.array(gravity)}))

    assert [view(0.0, -9.8), view(-9.8, 0.0), view(0.0, 0.0)] == [(0, 1), (1, 0), (0, 1)]
    assert [view(0.0, 0.0, -9.8), view(0.0, -9.8, 0.0)] == [(0, 2), (0, 1)]


def test_animate(finished, tmp_path):
    out = tmp_path / "disk.gif"
    assert mpm_ref("animate", finished, "--field", "tau", "-o", out).exit_code == 0
    with Image.open(out) as film:
        assert film.n_frames == 5


def test_export(finished, tmp_path):
    for options in ([], ["--grid"]):
        out = tmp_path / f"disk{len(options)}.vtkhdf"
        assert mpm_ref("export", finished, *options, "-o", out).exit_code == 0
        assert out.read_bytes()[1:4] == b"HDF"


@pytest.mark.parametrize(("command", "words"), [
    (["plot", "--field", "colour"], "expected one of speed"),
    (["plot", "--frame", 9], "no frame 9"),
    (["plot", "--view", "xx"], "two different axes"),
    (["plot", "-o", "a.jpg"], "ends in .png"),
    (["animate", "-o", "a.mp4"], "ends in .gif"),
    (["export", "-o", "a.vtk"], "ends in .vtkhdf"),
])
def test_bad_requests_are_told(finished, command, words):
    assert_told(mpm_ref(command[0], finished, *command[1:]), 2, words)


def test_version_and_help():
    assert mpm_ref("--version").stdout.startswith("mpm-ref ")
    for command in ("run", "info", "plot", "animate", "export", "scenes", "oracle"):
        assert mpm_ref(command, "--help").exit_code == 0
        assert command in mpm_ref("--help").stdout
