"""`mpm-ref rom` of studies with model = "nsf": steps that are too long, and fields that were made
otherwise than the study says.
"""

import json

import numpy as np
import pytest
from command_line import mpm_ref
from small_nsf_studies import modelled, write

from mpm_ref.problem import Clock
from mpm_ref.rom.study import reduce
from mpm_ref.rom.study.dataset import load_histories
from mpm_ref.rom.study.evaluate import NEAREST, REDUCED, evaluate, largest_length
from mpm_ref.rom.study.run import step_count
from mpm_ref.rom.study.study import load


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its fields."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.mark.parametrize(("faster", "steps"), [(1.0, 120), (1.5, 80), (7.0, 17), (80.0, 1),
                                               (0.1, 1200), (120.0, 1)])
def test_no_step_ends_after_the_scene(faster, steps):
    assert step_count(Clock(0.01, steps=120), faster) == steps


def test_a_run_that_goes_too_fast_has_no_errors(made, tmp_path):
    """`evaluate` says of it what `run` says, which names the length of the steps."""
    study = write(tmp_path, ("points = 20", "points = 20\ndt_factor = 2.0"))
    fields, v = made / "fields.npz", 200.0
    ran = mpm_ref("rom", "run", study, "--map", fields, "--set", f"v={v}", "--out",
                  tmp_path / "run.h5")
    assert ran.exit_code == 3
    assert "in step 1: a particle crosses more than 1 dx in a step" in ran.stderr
    assert "and are steps 2 times as long too long?" in ran.stderr
    plain = mpm_ref("rom", "run", made / "pairs.toml", "--map", fields, "--set", f"v={v}", "--out",
                    tmp_path / "plain.h5")
    assert "too long" not in plain.stderr


def test_the_farthest_point_counts():
    assert largest_length(np.array([[-3.0, -4.0], [0.0, 1.0]])) == 5.0
    assert np.isnan(largest_length(np.array([[np.nan, 0.0], [0.0, 1.0]])))


def test_errors_of_a_run_beyond_its_limit_are_infinite(made, tmp_path, monkeypatch):
    study = write(tmp_path)
    command = ("rom", "evaluate", study, "--map", made / "fields.npz", "--data", made / "data",
               "--out", tmp_path / "e.png", "--json", "--overwrite")
    good = json.loads(mpm_ref(*command).stdout)
    assert good["all"]["reduced"]["origin"] < 0.01
    monkeypatch.setattr("mpm_ref.rom.study.evaluate.largest_length", lambda u: float("nan"))
    done = mpm_ref(*command)
    assert done.exit_code == 3
    found = json.loads(done.stdout)
    assert found["all"]["reduced"]["origin"] is None
    assert found["runs"][0]["broken"]["reduced"] == (
        "step 1: a particle crosses more than 1 dx in a step")


def test_nearest_states_are_compared_at_the_times_of_longer_steps(made, tmp_path):
    study = load(write(tmp_path, ("points = 20", "points = 20\ndt_factor = 4.0")))
    runs = load_histories(study, made / "data", study.test, float)
    (held,) = evaluate(study, reduce.load(made / "fields.npz", study), runs)
    for name in (REDUCED, NEAREST):
        assert np.flatnonzero(np.isfinite(held.paths[name].levels)).tolist() == [0, 2, 4, 6, 8]


def test_fields_that_were_made_otherwise_are_warned_of(made, tmp_path, monkeypatch):
    study = write(tmp_path, ("smoothing = 1e-6", "smoothing = 1e-3"))
    (tmp_path / "pairs.npz").write_bytes((made / "fields.npz").read_bytes())
    monkeypatch.chdir(tmp_path)
    done = mpm_ref("rom", "run", study, "--set", "v=2")
    assert ("pairs.npz is smoothing = 1e-06, where the study's [map] says smoothing = 0.001: train "
            "again" in done.stderr)
    write(tmp_path)
    assert "train again" not in mpm_ref("rom", "run", study, "--set", "v=2", "--overwrite").stderr
