"""What the README prints is run as it is printed."""

import re
import shlex
from pathlib import Path

import pytest
from command_line import mpm_ref

README = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
WRITTEN = {"mine.h5": "golden.h5"}  # by the code of a user: a file that it should equal


def section(title):
    """Text of a section of the README."""
    return README.split(f"\n## {title}\n")[1].split("\n## ")[0]


def commands(text):
    """Command lines in a text: those that it prints in lines of their own, and in quotes."""
    found = re.findall(r"^    (mpm-ref .*)|`(mpm-ref [^`]*)`", text, flags=re.MULTILINE)
    return [line or quoted for line, quoted in found]


def answers(command):
    """Lines that a command prints."""
    done = mpm_ref(*(WRITTEN.get(word, word) for word in shlex.split(command)[1:]))
    assert done.exit_code == 0, done.stderr
    return done.stdout.splitlines()


def test_python_example_runs(capsys):
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) == 1
    exec(compile(blocks[0], "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 11
    assert lines[-1].startswith("t = 0.50 s Energy(kinetic=")


def test_the_first_run_answers_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, *drawn = [line for line in commands(section("A first run")) if "my_scene" not in line]
    text, = re.findall(r"```\n(.*?)```", section("A first run"), flags=re.DOTALL)
    assert answers(first) == text.splitlines()
    for line in drawn:
        answers(line)
    assert {path.name for path in tmp_path.iterdir()} == {
        "hello.h5", "hello.checkpoint.h5", "hello.png", "hello.gif", "hello.vtkhdf"}


def test_a_backend_is_checked_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record, check = commands(section("Checking your own backend"))
    answers(record)
    assert answers(check)[0].startswith("agrees:")


@pytest.mark.parametrize("command", ["trade", "limits", "needs"])
def test_commands_for_a_scene_of_your_own_have_help(command):
    assert any(f"mpm-ref {command} my_scene.toml" in line for line in README.splitlines())
    assert answers(f"mpm-ref {command} --help")
