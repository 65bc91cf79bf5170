"""What `mpm-ref rom run` says of maps, bounds and parameters."""

import json
import shutil

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_studies import modelled, write

from mpm_ref.cli import rom
from mpm_ref.cli.rom import range_warnings
from mpm_ref.rom.study import monitor, record
from mpm_ref.rom.study.monitor import StateCheck

WELL = StateCheck(beyond=0.3, off=0.01, coverage=0.9, blind=0, lost=0.0, J=0.8, inverted=0.0,
                  far=0.9)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


def test_a_run_without_a_step_has_no_means():
    found = {"study": "ab", "name": "bars", "map": {"kind": "modes", "r": 3},
             "parameters": {"g": 2.0}, "states": 1, "out_of_bounds": 0, "mean_samples": None,
             "mean_points": None}
    assert record.summary_line(found) == (
        "reduced: bars, modes r = 3, g = 2; 0 of 1 states out of bounds")
    some = record.summary_line(found | {"mean_samples": 20.0, "mean_points": 101.25})
    assert "g = 2; a step has 20 samples and 101.2 integration points on average; 0 of 1" in some


def test_states_out_of_bounds_are_counted_and_the_first_is_told():
    out, off = WELL._replace(beyond=2.0), WELL._replace(off=0.5)
    assert list(range_warnings({}, 16, 0.1)) == []
    (said,) = range_warnings({1: out, 4: off}, 16, 0.3)
    assert said.startswith("2 of 16 states, from t = 0.3 s on, are ")
    rest, said = range_warnings({0: off, 1: out}, 16, 0.1)
    assert rest == "the map does not give the body at rest: train longer, or another kind"
    assert said.startswith("2 of 16 states, from t = 0 s on, are ")


def test_each_bound_that_is_stored_is_counted():
    rows = {"beyond": [0.1] * 7, "off": [0.0] * 7, "coverage": [1.0] * 7, "lost": [0] * 7,
            "points": [0, *[30] * 6], "rank": [0, *[2] * 6], "xhat": np.zeros((7, 2)),
            "inverted": [0.0] * 7, "departure": [1.0] * 7}
    rows["off"][0] = 1.0
    changes = {"beyond": 9.0, "departure": 90.0, "lost": 10, "rank": 1, "inverted": 0.5}
    for k, (name, value) in enumerate(changes.items(), 1):
        rows[name][k] = value
    assert [monitor.stored_check(rows, k).out_of_bounds for k in range(7)] == [
        ("off",), ("beyond",), ("departure",), ("lost",), ("blind",), ("inverted",), ()]
    fields = {name: rows[name] for name in ("beyond", "rank", "xhat")} | {"departure": [0.9] * 7}
    assert "departure" in monitor.stored_check(fields, 6).out_of_bounds     # of NSF, lower


@pytest.mark.parametrize(("edit", "asked"), [
    (("r = 3", "r = 2"), "modes, r = 2"), (('"modes"', '"network"'), "network, r = 3"),
])
def test_a_map_unlike_the_studied_one_is_warned_of_unless_named(
        made, tmp_path, monkeypatch, edit, asked):
    study = write(tmp_path, edit)
    shutil.copy(made / "map.npz", tmp_path / "bars.npz")
    monkeypatch.chdir(tmp_path)
    words = f"bars.npz is modes, r = 3, where the study's [map] says {asked}: train again"
    run, judge = ("run", study, "--set", "g=2"), ("evaluate", study, "--data", made / "data")
    for command, out in ((run, "named.h5"), (judge, "named.png")):
        assert words in mpm_ref("rom", *command).stderr
        done = mpm_ref("rom", *command, "--map", "bars.npz", "--out", out)
        assert (done.exit_code, done.stderr) == (0, "")
    write(tmp_path)
    assert mpm_ref("rom", *run, "--overwrite").stderr == ""


def test_a_large_file_is_told_before_it_is_written(made, tmp_path, monkeypatch):
    monkeypatch.setattr(rom, "LARGE", 64 * 12 * 8 * 9 - 1)
    done = mpm_ref("rom", "run", made / "bars.toml", "--map", made / "map.npz", "--set", "g=2",
                   "--out", tmp_path / "run.h5")
    assert (done.exit_code, done.stderr) == (
        0, f"mpm-ref: {tmp_path / 'run.h5'}: 55.3 kB will be written\n")
    assert 55296 < (tmp_path / "run.h5").stat().st_size


def test_a_picture_is_not_replaced(made, tmp_path, monkeypatch):
    out = tmp_path / "e.png"
    command = ("evaluate", made / "bars.toml", "--map", made / "map.npz", "--data", made / "data")
    assert mpm_ref("rom", *command, "--out", out).exit_code == 0
    before = out.stat().st_mtime_ns
    assert mpm_ref("rom", *command, "--out", out, "--overwrite").exit_code == 0
    assert out.stat().st_mtime_ns > before
    monkeypatch.setattr(rom, "evaluate", None)         # not begun
    assert_told(mpm_ref("rom", *command, "--out", out), 2, "e.png exists: add --overwrite")
    done = mpm_ref("rom", *command, "--out", tmp_path / "none" / "e.png")
    assert_told(done, 4, "there is no folder")


def test_blanks_around_a_parameter_do_not_matter(made, tmp_path):
    done = mpm_ref("rom", "run", made / "bars.toml", "--map", made / "map.npz", "--out",
                   tmp_path / "run.h5", "--set", " g = 2 ", "--json")
    assert json.loads(done.stdout)["reduced"]["parameters"] == {"g": 2.0}


def test_a_missing_map_is_told_in_the_words_that_were_typed(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert_told(mpm_ref("rom", "run", "gravity_small", "--set", "g=3"), 2,
                "there is no gravity_small.npz: mpm-ref rom train gravity_small\n")
