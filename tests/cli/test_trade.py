import json
import re
import shutil

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from offline_page import facts_of
from sweep_scenes import FLIGHT

from mpm_ref.cli.sweep_options import parse_budget, parse_error
from mpm_ref.scene import load
from mpm_ref.trade import answer
from mpm_ref.trade.search import TradeSearch

FAST = "--budget", "60s", "--workers", "1", "--quiet"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scene, after `mpm-ref trade` on it."""
    folder = tmp_path_factory.mktemp("trade")
    (folder / "flight.toml").write_text(FLIGHT)
    done = mpm_ref("trade", folder / "flight.toml", "--error", "4%", "--out", folder, *FAST)
    assert done.exit_code == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    return folder


def test_it_writes_an_answer_a_page_and_a_scene(folder):
    facts = json.loads((folder / "flight.trade.json").read_text())
    assert facts["scene"] == "flight"
    assert facts["error"] == 0.04
    assert facts["best"] in (folder / "stdout").read_text()
    assert "<svg" in (folder / "flight.trade.html").read_text()
    assert load(folder / "flight.best.toml").dim == 2
    assert mpm_ref("run", folder / "flight.best.toml", "--out", folder / "best.h5",
                   "--steps", "2", "--quiet").exit_code == 0


def test_a_second_call_makes_no_run_again(folder):
    stored = {file: file.stat().st_mtime_ns for file in (folder / "flight.trade").iterdir()}
    done = mpm_ref("trade", folder / "flight.toml", "--error", "4%", "--out", folder, "--json",
                   *FAST)
    assert json.loads(done.stdout)["best"] is not None
    again = {file: file.stat().st_mtime_ns for file in (folder / "flight.trade").iterdir()}
    assert {file: again[file] for file in stored} == stored


def test_runs_of_other_quantities_are_said_to_be_of_no_use(folder, tmp_path):
    shutil.copytree(folder / "flight.trade", tmp_path / "flight.trade")
    options = (folder / "flight.toml", "--error", "10%", "--out", tmp_path, "--budget", "1s",
               "--workers", "1", "--quiet")
    assert "could be used" not in mpm_ref("trade", *options).stderr
    done = mpm_ref("trade", *options, "--quantity", "centroid")
    assert re.search(r"warning: none of the \d+ runs in .* could be used", done.stderr)


def test_a_bad_start_is_told_and_written(folder, tmp_path, monkeypatch):
    shutil.copytree(folder / "flight.trade", tmp_path / "flight.trade")
    monkeypatch.setattr(answer, "start_fault", lambda search, chosen: "a face is off")
    done = mpm_ref("trade", folder / "flight.toml", "--error", "4%", "--out", tmp_path, *FAST)
    assert "warning: a face is off\n" in done.stdout
    assert "# Warning: a face is off.\n" in (tmp_path / "flight.best.toml").read_text()


def test_a_similar_scene_answers_without_a_run(folder):
    larger = FLIGHT.replace("radius = 0.25", "radius = 0.5").replace("dx = 0.1", "dx = 0.2")
    (folder / "larger.toml").write_text(larger)
    done = mpm_ref("trade", folder / "larger.toml", "--like", "flight", "--error", "4%",
                   "--out", folder)
    assert done.exit_code == 0
    assert "nothing was measured on larger" in done.stdout
    assert not (folder / "larger.trade").exists()
    ours, theirs = (load(folder / f"{name}.best.toml") for name in ("larger", "flight"))
    assert ours.dx == pytest.approx(2.0 * theirs.dx, rel=0.1)
    assert (ours.cfl, ours.scheme) == (theirs.cfl, theirs.scheme)


def test_another_scene_of_the_same_problem_is_tried_too(folder, tmp_path):
    stiff = FLIGHT.replace("E = 1e4", "E = 2e4")
    assert stiff != FLIGHT
    (tmp_path / "stiff.toml").write_text(stiff)
    mpm_ref("trade", folder / "flight.toml", "--error", "4%", "--out", tmp_path, *FAST,
            "--alternative", tmp_path / "stiff.toml")
    facts = json.loads((tmp_path / "flight.trade.json").read_text())
    rows = [row for row in facts["rows"] if row["setting"].get("scene") == "stiff"]
    assert rows
    assert all(row["text"].startswith("scene stiff") and row["outcome"] == "finished"
               for row in rows)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("end = 0.2", "end = 0.3", "end = 0.3 s, in the scene 0.2 s"),
    ('name = "disk"', 'name = "ball"', "bodies ball, in the scene disk"), ("", "", "two scenes")])
def test_a_scene_of_another_problem_is_refused(folder, tmp_path, old, new, words):
    assert old in FLIGHT
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "other.toml").write_text(FLIGHT.replace(old, new))
    done = mpm_ref("trade", folder / "flight.toml", "--out", tmp_path, "--quiet", "--alternative",
                   tmp_path / "a" / "other.toml", "--alternative", tmp_path / "b" / "other.toml")
    assert_told(done, 2, words)


def test_a_results_file_is_compared(tmp_path):
    scene = tmp_path / "flight.toml"
    scene.write_text("interval = 0.005\n" + FLIGHT)
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--quiet").exit_code == 0
    done = mpm_ref("trade", scene, "--error", "4%", "--out", tmp_path, "--budget", "6s",
                   "--workers", "1", "--quiet", "--compare", tmp_path / "run.h5")
    facts = json.loads((tmp_path / "flight.trade.json").read_text())
    row, = facts["compared"]
    own, = (one for one in facts["rows"] if one["setting"] == {"dx": 1.0})
    assert row["error"] == pytest.approx(own["error"], rel=0.02)
    assert row["cpu"] > 0.0
    assert f"{tmp_path / 'run.h5'}: error" in done.stdout
    assert "run.h5" in (tmp_path / "flight.trade.html").read_text()
    assert facts["best"] != row["text"]


@pytest.mark.parametrize(("old", "new", "words"), [
    ("end = 0.2", "end = 0.2", "2 frames, between which positions is known to"),
    ("end = 0.2", "end = 0.1", "expected a run from 0 to the scene's end at 0.2 s"),
    ('name = "disk"', 'name = "ball"', "bodies ball; expected those of the scene: disk")])
def test_a_results_file_of_another_problem_is_refused(folder, tmp_path, old, new, words):
    assert old in FLIGHT
    (tmp_path / "other.toml").write_text(FLIGHT.replace(old, new))
    mpm_ref("run", tmp_path / "other.toml", "--out", tmp_path / "run.h5", "--quiet")
    done = mpm_ref("trade", folder / "flight.toml", "--out", tmp_path, "--quiet", "--compare",
                   tmp_path / "run.h5")
    assert_told(done, 2, words)


@pytest.mark.parametrize("content", [None, b"", b"not HDF5"])
def test_what_is_no_results_file_is_refused(folder, tmp_path, content):
    if content is not None:
        (tmp_path / "run.h5").write_bytes(content)
    done = mpm_ref("trade", folder / "flight.toml", "--out", tmp_path, "--quiet", "--compare",
                   tmp_path / "run.h5")
    assert_told(done, 2, "run.h5")


@pytest.mark.parametrize(("content", "words"), [
    (None, "No such file"), ("{}", "missing required field `cells`"), ("[1", "not an answer"),
    ('{"rows": [{}], "cells": 3}', "not an answer"), ('{"rows": [], "cells": "x"}', "not an")])
def test_an_answer_that_is_none_is_refused(folder, tmp_path, content, words):
    if content is not None:
        (tmp_path / "other.trade.json").write_text(content)
    done = mpm_ref("trade", folder / "flight.toml", "--like", "other", "--out", tmp_path)
    assert_told(done, 2, words)


@pytest.mark.parametrize("knobs", [
    {"transfer": "mls\nend = 1"}, {"dx": "1"}, {"dx": -1.0}, {"dx": 1e300}, {"speed": 2.0},
    {"integrator": 3}, {"sampling": "import os"}, {"degree": 7}, {"cfl": None}])
def test_a_forged_answer_writes_no_scene(folder, tmp_path, knobs):
    facts = json.loads((folder / "flight.trade.json").read_text())
    best = next(row for row in facts["rows"] if row["best"])
    facts["rows"] = [best | {"setting": knobs, "text": "harmless"}]
    (tmp_path / "other.trade.json").write_text(json.dumps(facts))
    done = mpm_ref("trade", folder / "flight.toml", "--like", "other", "--error", "4%",
                   "--out", tmp_path)
    assert_told(done, 2)
    assert not list(tmp_path.glob("*.toml"))


def test_a_similar_answer_about_another_quantity_is_refused(folder, tmp_path):
    done = mpm_ref("trade", folder / "flight.toml", "--like", "flight", "--out", folder,
                   "--quantity", "kinetic")
    assert_told(done, 2, "flight: its answer is about positions; asked is kinetic")


def test_a_similar_answer_measures_nothing(folder):
    done = mpm_ref("trade", folder / "flight.toml", "--like", "flight", "--out", folder,
                   "--compare", folder / "run.h5")
    assert_told(done, 2, "--like flight: it measures nothing")


def test_an_output_that_is_a_file_is_refused(folder, tmp_path):
    (tmp_path / "file").write_text("")
    done = mpm_ref("trade", folder / "flight.toml", "--out", tmp_path / "file", *FAST)
    assert_told(done, 4, "this is no folder")


def test_files_of_the_recommended_scene_are_named_from_its_folder(tmp_path):
    (tmp_path / "scenes").mkdir()
    np.savez(tmp_path / "scenes" / "points.npz",
             x=np.random.default_rng(0).uniform(0.3, 0.7, (60, 2)), V0=np.full(60, 0.002))
    shape = 'shape = { type = "sphere", center = [0.5, 0.7], radius = 0.25 }'
    assert shape in FLIGHT
    (tmp_path / "scenes" / "flight.toml").write_text(
        FLIGHT.replace(shape, 'particles = { file = "points.npz" }'))
    done = mpm_ref("trade", tmp_path / "scenes" / "flight.toml", "--out", tmp_path / "out",
                   "--error", "20%", "--budget", "20s", "--workers", "1", "--quiet")
    assert done.exit_code == 0, done.output
    best = tmp_path / "out" / "flight.best.toml"
    assert 'file = "../scenes/points.npz"' in best.read_text()
    assert mpm_ref("run", best, "--out", tmp_path / "best.h5", "--steps", "2",
                   "--quiet").exit_code == 0


def test_without_a_budget_there_is_no_answer(folder, tmp_path):
    """And none is left of an earlier call."""
    (tmp_path / "flight.best.toml").write_text("an earlier answer")
    done = mpm_ref("trade", folder / "flight.toml", "--error", "0.0001%", "--out", tmp_path,
                   "--budget", "1s", "--workers", "1", "--quiet")
    assert done.exit_code == 1
    assert "no setting keeps" in done.stdout
    assert not (tmp_path / "flight.best.toml").exists()
    facts = json.loads((tmp_path / "flight.trade.json").read_text())
    assert facts["advice"][0] == "no setting keeps 0.0001 %:"
    assert all(line in done.stdout.splitlines() for line in facts["advice"])
    page = (tmp_path / "flight.trade.html").read_text()
    assert facts_of(page)["advice"] == facts["advice"]
    assert 'el("advice").replaceChildren(...paragraphs(facts.advice))' in page


@pytest.mark.parametrize(("option", "value", "word"), [
    ("--error", "fast", "--error fast"), ("--error", "0%", "share between 0 and 1"),
    ("--error", "200%", "share between 0 and 1"), ("--budget", "soon", "--budget soon"),
    ("--budget", "nan", "--budget nan"), ("--workers", "0", "--workers 0"),
    ("--quantity", "beauty", "beauty"), ("--quantity", "impulse:floor", "no collider"),
    ("--scheduler", "somewhere", "somewhere")])
def test_bad_options_get_one_sentence(folder, tmp_path, option, value, word):
    done = mpm_ref("trade", folder / "flight.toml", option, value, "--out", tmp_path, "--quiet")
    assert_told(done, 2, word)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_says_how_to_go_on(folder, tmp_path, monkeypatch):
    def interrupt(self):
        raise KeyboardInterrupt
    monkeypatch.setattr(TradeSearch, "run", interrupt)
    done = mpm_ref("trade", folder / "flight.toml", "--out", tmp_path, "--workers", "1", "--quiet")
    assert_told(done, 130, "after 0 runs", "flight.trade", "the same command goes on")


def test_an_error_of_the_search_is_no_bad_input(folder, tmp_path, monkeypatch):
    def fail(self):
        raise ValueError("a bug")
    monkeypatch.setattr(TradeSearch, "run", fail)
    with pytest.raises(ValueError, match="a bug"):
        mpm_ref("trade", folder / "flight.toml", "--out", tmp_path, "--workers", "1", "--quiet")


def test_a_scene_without_an_end_is_refused(tmp_path):
    (tmp_path / "endless.toml").write_text(FLIGHT.replace("end = 0.2", "steps = 20"))
    assert_told(mpm_ref("trade", tmp_path / "endless.toml", "--out", tmp_path), 2, "without dt")


@pytest.mark.parametrize(("text", "value"), [("1%", 0.01), ("0.5 %", 0.005), ("0.02", 0.02)])
def test_errors_are_shares_or_percent(text, value):
    assert parse_error(text) == pytest.approx(value)


@pytest.mark.parametrize(("text", "value"), [("90s", 90), ("20min", 1200), ("2h", 7200),
                                             ("30", 30)])
def test_budgets_have_units(text, value):
    assert parse_budget(text) == value
