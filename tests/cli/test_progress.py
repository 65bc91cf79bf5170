"""Where there is no terminal, the program tells of compilation and of long waits in lines."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import SCENE
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.cli import terminal
from mpm_ref.cli.sweep_options import SweepRequest, open_runs
from mpm_ref.core import kernel_cache
from mpm_ref.sweep.runs import RunRequest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def telling(monkeypatch):
    monkeypatch.setattr(terminal.Telling, "active", True)
    monkeypatch.setattr(terminal.Telling, "compiling", False)


def program(*arguments, **environment):
    return subprocess.run([sys.executable, "-m", "mpm_ref", *map(str, arguments)], check=False,
                          env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
                          capture_output=True, text=True, timeout=300)


def test_a_first_run_tells_that_it_compiles_and_a_second_does_not(tmp_path):
    scene = tmp_path / "disk.toml"
    scene.write_text(SCENE)
    for lines in (1, 0):
        done = program("info", scene, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
        assert done.returncode == 0
        assert done.stderr == lines * f"mpm-ref: {terminal.COMPILING}\n"


def test_a_long_wait_is_told_of_after_some_seconds(telling, capsys, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(terminal, "monotonic", lambda: clock[0])
    with terminal.passing(total=9, unit="run", desc="study") as bar:
        for clock[0] in (1.0, 11.0, 30.0, 75.0):
            bar.update(2)
        assert bar.n == 8
    assert capsys.readouterr().err == ("mpm-ref: study: run 4 of 9\nmpm-ref: study: run 8 of 9\n")
    clock[0] = 0.0
    for clock[0] in terminal.passing(iterable=[5.0, 20.0, 21.0], unit="run"):
        continue
    assert capsys.readouterr().err == "mpm-ref: run 2 of 3\n"


def test_a_wait_of_seconds_is_told_with_its_remark(telling, capsys, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(terminal, "monotonic", lambda: clock[0])
    with terminal.passing(total=60.0, unit="s", desc="flight") as bar:
        clock[0] = 11.0
        bar.update(15.24)
        bar.set_postfix_str("3 runs, 28 s left, last: dx x 2: finished")
        clock[0] = 75.0
        bar.update(16.76)
    assert capsys.readouterr().err.splitlines() == [
        "mpm-ref: flight: 15 s of 60 s",
        "mpm-ref: flight: 32 s of 60 s, 3 runs, 28 s left, last: dx x 2: finished"]


def test_runs_of_a_sweep_are_told_of_as_they_end(telling, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(terminal, "FIRST", -1.0)
    monkeypatch.setattr(terminal, "EVERY", -1.0)
    request = SweepRequest("flight.toml", 0.01, 60.0, (), 1, None, tmp_path, False)
    scene = scene_of(FLIGHT)
    with open_runs(request, observed_run(scene)) as runs:
        runs.observe({"as given": RunRequest(scene)})
    line, = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"mpm-ref: flight: \d+ s of 60 s, 1 run, \d+ s left, last: as given: "
                        "finished", line)


def test_a_quiet_command_and_one_that_is_tested_tell_nothing(telling, capsys, monkeypatch):
    monkeypatch.setattr(terminal, "FIRST", -1.0)
    with terminal.passing(quiet=True, total=3) as bar:
        bar.update()
    with terminal.compiling(quiet=True):
        terminal.announce_compilation()
    monkeypatch.setattr(terminal.Telling, "active", False)
    monkeypatch.setattr(terminal.Telling, "compiling", False)
    with terminal.passing(total=3) as bar:
        bar.update()
    terminal.announce_compilation()
    assert capsys.readouterr().err == ""


def test_processes_that_will_compile_are_told_of(telling, capsys, monkeypatch, tmp_path):
    (tmp_path / "f.kernel").write_text("")
    monkeypatch.setattr(terminal.jit, "CACHE_DIR", str(tmp_path))
    terminal.announce_compilation_of_workers()
    assert capsys.readouterr().err == ""
    (tmp_path / "f.kernel").unlink()
    terminal.announce_compilation_of_workers()
    assert capsys.readouterr().err == f"mpm-ref: {terminal.COMPILING}\n"


def test_only_the_program_listens_to_compilations(monkeypatch):
    monkeypatch.setattr(kernel_cache, "compilations", [])
    monkeypatch.setattr(terminal.Telling, "active", False)
    terminal.tell_progress()
    assert kernel_cache.compilations == [terminal.announce_compilation]


def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path):
    (tmp_path / "h5py.py").write_text("raise KeyboardInterrupt")
    done = program("scenes", PYTHONPATH=os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert (done.returncode, done.stderr) == (130, "mpm-ref: interrupted\n")
