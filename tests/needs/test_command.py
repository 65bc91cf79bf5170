"""The command writes the answer and the lean scene, and says in one line what it cannot do."""

import json
from dataclasses import replace

import msgspec
import pytest
from command_line import assert_told, mpm_ref
from needs_toys import DROP, SCENE, variant_of
from offline_page import assert_holds, facts_of

import mpm_ref.cli.needs as command
from mpm_ref.needs.answer import lean_text, percent
from mpm_ref.needs.removal import RemovalStudy
from mpm_ref.scene import digest, load, loads
from mpm_ref.sweep.observation import (
    CRASHED,
    REFUSED,
    STOPPED,
    UNSTABLE,
    RunCost,
    RunObservation,
)


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    """The folder of a drop after the command, and what the command printed."""
    folder = tmp_path_factory.mktemp("needs")
    (folder / "drop.toml").write_text(DROP)
    done = mpm_ref("needs", folder / "drop.toml", "--budget", "5min", "--workers", "1", "--out",
                   folder, "--quiet")
    assert done.exit_code == 0, done.output
    return folder, done.stdout


def test_lines_of_the_answer(drop):
    lines = drop[1].splitlines()
    assert lines[0].startswith("warning: the scene as given: 1 of the 16 particles of body 'drop'")
    assert lines[1].startswith("warning: the scene as given: dissipation: ")
    assert lines[2].startswith("Drop: 16 particles, 50 steps, ")
    assert any(line.startswith("gravity: required (changes positions by 100 %") for line in lines)
    assert any(line.startswith("collider roof: not required at 1 % (positions by 0 %)")
               for line in lines)
    assert any(line.startswith("lean scene, drop.lean.toml: changes positions") for line in lines)
    assert any(line.split() == ["multigrid", "0", "0"] for line in lines)


def test_lean_scene_runs_and_says_what_was_removed(drop):
    folder, _ = drop
    text = (folder / "drop.lean.toml").read_text()
    assert "#   collider roof" in text
    assert "--error 0.01" in text
    scene = load(folder / "drop.lean.toml")
    assert [part.name for part in scene.collider] == ["floor"]
    done = mpm_ref("run", folder / "drop.lean.toml", "--out", folder / "lean.h5", "--quiet")
    assert done.exit_code == 0, done.output


def test_json_has_all_that_was_measured(drop):
    folder, _ = drop
    facts = json.loads((folder / "drop.needs.json").read_text())
    removals = {one["label"]: one for one in facts["removals"]}
    assert facts["complete"]
    assert facts["quantities"] == ["positions"]
    assert facts["versions"]["mpm_ref"]
    assert facts["command"].startswith("mpm-ref needs ")
    assert removals["collider roof"]["changes"] == {"positions": 0.0}
    assert removals["gravity"]["verdict"] == "required"
    assert facts["lean_removals"] == ["collider roof"]
    assert facts["code"]["lean"]["stages"]["multigrid"] == []
    assert facts["errors"]["grid"]["positions"] > 0.0


def test_figure_is_written(drop):
    assert (drop[0] / "drop.needs.png").read_bytes().startswith(b"\x89PNG")


def test_page_is_written(drop):
    folder, _ = drop
    facts = json.loads((folder / "drop.needs.json").read_text())
    page = (folder / "drop.needs.html").read_text()
    shown = facts_of(page)
    assert_holds(page, shown)
    for key in ("removals", "order"):
        assert all(one.items() <= both.items() for one, both
                   in zip(facts.pop(key), shown.pop(key), strict=True))
    assert facts.items() <= shown.items()


def test_second_command_makes_no_run(drop, monkeypatch):
    folder, text = drop
    monkeypatch.setattr("mpm_ref.sweep.runs.observe", None)
    done = mpm_ref("needs", folder / "drop.toml", "--budget", "5min", "--workers", "1", "--out",
                   folder, "--quiet", "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)
    assert facts["removals"][0]["text"] in text


@pytest.mark.parametrize(("option", "value", "word"), [
    ("--error", "2", "--error 2"), ("--budget", "soon", "--budget soon"),
    ("--quantity", "beauty", "beauty"), ("--workers", "0", "--workers 0"),
])
def test_bad_option_is_told(scene, tmp_path, option, value, word):
    assert_told(mpm_ref("needs", scene, option, value, "--out", tmp_path, "--quiet"), 2, word)


def test_quantity_that_does_not_fit_is_told(scene, tmp_path):
    done = mpm_ref("needs", scene, "--quantity", "impulse:floor", "--out", tmp_path, "--quiet",
                   "--workers", "1")
    assert_told(done, 2, "impulse:floor")


def test_missing_scene_is_told(tmp_path):
    assert_told(mpm_ref("needs", "no_such", "--out", tmp_path), 2, "no_such")


@pytest.mark.parametrize(("outcome", "status", "word"), [
    (STOPPED, 1, "larger --budget"), (CRASHED, 1, "larger --budget"), (UNSTABLE, 2, "as given"),
    (REFUSED, 2, "as given"),
])
def test_scene_that_does_not_finish_is_told(scene, tmp_path, monkeypatch, outcome, status, word):
    def fail(self):
        self.base = RunObservation({}, RunCost(), outcome, "why")

    monkeypatch.setattr(RemovalStudy, "result", fail)
    done = mpm_ref("needs", scene, "--out", tmp_path, "--quiet", "--workers", "1")
    assert_told(done, status, word, "why")
    assert not list(tmp_path.glob("*.needs.*"))


def test_interrupt_is_told(scene, tmp_path, monkeypatch):
    def interrupt(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(RemovalStudy, "result", interrupt)
    done = mpm_ref("needs", scene, "--out", tmp_path, "--quiet", "--workers", "1")
    assert_told(done, 130, "the same command goes on")


def test_part_of_the_answer_ends_with_status_1(drop, monkeypatch):
    folder, _ = drop
    result = RemovalStudy.result

    def short(self):
        return replace(result(self), complete=False, missing_cpu=7.0)

    monkeypatch.setattr(RemovalStudy, "result", short)
    done = mpm_ref("needs", folder / "drop.toml", "--budget", "5min", "--workers", "1", "--out",
                   folder, "--quiet")
    assert done.exit_code == 1
    assert "about 7 s of CPU time more" in done.stdout


def test_without_a_table_of_the_code_the_answer_is_written(drop, tmp_path, monkeypatch):
    def fail(scene, store):
        raise RuntimeError("the first steps failed")
    monkeypatch.setattr(command, "code_parts", fail)
    folder, _ = drop
    done = mpm_ref("needs", folder / "drop.toml", "--budget", "5min", "--workers", "1", "--out",
                   folder, "--quiet")
    assert done.exit_code == 0, done.output
    assert "no table of the code: the first steps failed" in done.stderr
    assert "lean scene, drop.lean.toml" in done.stdout
    assert json.loads((folder / "drop.needs.json").read_text())["code"] == {}


def test_a_title_cannot_write_into_the_lean_scene(drop, monkeypatch):
    answers = []
    monkeypatch.setattr(command, "write_answer", lambda answer, *_: answers.append(answer))
    folder, _ = drop
    mpm_ref("needs", folder / "drop.toml", "--budget", "5min", "--workers", "1", "--out", folder,
            "--quiet")
    answer, = answers
    first = answer.result.first
    scene = msgspec.structs.replace(first.scene, title="nice\n[evil]\nx = 1 #")
    evil = replace(answer, result=replace(answer.result, first=replace(first, scene=scene)))
    assert digest(loads(lean_text(evil, "."))) == digest(answer.result.lean.scene)


@pytest.mark.parametrize(("share", "text"), [
    (0.34, "34 %"), (0.0034, "0.34 %"), (0.0, "0 %"), (22.98, "2300 %"), (7e-12, "7e-10 %"),
    (-0.051, "-5.1 %"),
])
def test_percent(share, text):
    assert percent(share) == text


def test_toy_scene_is_valid():
    assert len(variant_of(SCENE).offers) > 10
