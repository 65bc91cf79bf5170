"""`mpm-ref rom run` and `evaluate`: what they write, say and refuse."""

import json

import h5py
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_studies import CURVED, STEPS, ended, modelled, write

from mpm_ref.rom import model_file
from mpm_ref.rom.study import record, reduce
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.record import LDM_SERIES
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.rom.study.study import load
from mpm_ref.scene import dumps
from mpm_ref.store.results import Results


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.fixture
def reduced(made, tmp_path):
    """A function that makes a reduced run with some options: what is answered, and its file."""
    def run(*options, study=made / "bars.toml", map=made / "map.npz", out=tmp_path / "run.h5"):
        return mpm_ref("rom", "run", study, "--map", map, "--out", out, *options), out
    return run


# run

def test_a_run_is_the_reduced_run_of_its_parameters(made, reduced):
    done, out = reduced("--set", "g=2.5")
    assert done.exit_code == 0, done.output
    assert done.stderr == ""
    bars = load(made / "bars.toml")
    model, one = reduce.load(made / "map.npz", bars), ldm_full_model(bars.scene([2.5]))
    states = list(ldm_run(one, model.field, RunOptions(), model.rest).states())
    with Results(out) as results:
        assert len(results) == STEPS + 1
        assert results.manifest["reduced"]["parameters"] == {"g": 2.5}
        for k, (_, latent, report, _) in enumerate(states):
            x, F, _ = model.field.derivatives(one.X, latent.xhat)
            np.testing.assert_allclose(results.field("bar", "x", k), x, rtol=1e-12)
            np.testing.assert_allclose(results.field("bar", "F", k), F, atol=1e-12)
            np.testing.assert_allclose(results.h5["reduced/xhat"][k], latent.xhat, atol=1e-12)
            assert results.h5["reduced/rank"][k] == (report.rank if report else 0)
        assert np.abs(results.field("bar", "v", 0)).max() == 0.0
        step = results.field("bar", "x", 5) - results.field("bar", "x", 4)
        np.testing.assert_allclose(results.field("bar", "v", 5), step / one.problem.clock.dt,
                                   atol=1e-9)


def test_what_is_known_of_each_state_is_stored_with_units(reduced):
    _, out = reduced("--set", "g=2.5")
    with h5py.File(out) as h5:
        group = h5["reduced"]
        assert set(group) == {name for names in LDM_SERIES for name in names}
        assert {len(series) for series in group.values()} == {STEPS + 1}
        assert group["vhat"].attrs["unit"] == "1/s"
        assert set(group["rank"][1:]) == {3}
        assert set(group["points"][1:]) == {64}
        assert group["beyond"][0] < 1e-6
        assert 0.0 < group["beyond"][-1] < 1.0


def test_other_commands_take_the_results(reduced, tmp_path):
    _, out = reduced("--set", "g=2.5")
    for command, file in (("plot", "run.png"), ("export", "run.vtkhdf")):
        done = mpm_ref(command, out, "--out", tmp_path / file)
        assert done.exit_code == 0, done.output
        assert (tmp_path / file).stat().st_size > 1000
    assert "finished" in mpm_ref("info", out).stdout


def test_a_body_is_shown_at_more_points_than_it_was_trained_with(made, reduced, tmp_path):
    _, coarse = reduced("--set", "g=3.5", out=tmp_path / "coarse.h5")
    done, fine = reduced("--set", "g=3.5", "--points-out", 1000, out=tmp_path / "fine.h5")
    assert done.exit_code == 0, done.output
    with Results(coarse) as a, Results(fine) as b:
        assert b.count("bar") == 1000
        assert np.array_equal(a.h5["reduced/xhat"][()], b.h5["reduced/xhat"][()])
        for name in ("m", "V0"):
            assert b.field("bar", name).sum() == pytest.approx(a.field("bar", name).sum())
        model = reduce.load(made / "map.npz", load(made / "bars.toml"))
        X, xhat = b.field("bar", "x", 0), b.h5["reduced/xhat"][-1]
        x, F, _ = model.field.derivatives(X, xhat)
        np.testing.assert_allclose(b.field("bar", "x", -1), x, atol=1e-6)
        np.testing.assert_allclose(b.field("bar", "F", -1), F, atol=1e-6)
        assert b.scalar("bar", "J", -1).min() > 0.9


def test_a_run_beyond_the_training_is_warned_of(reduced):
    done, out = reduced("--set", "g=9")
    assert done.exit_code == 0
    outside, beyond = done.stderr.splitlines()
    assert outside.startswith("mpm-ref: warning: g = 9 lies outside the range")
    with Results(out) as results:
        found = record.summary(results)
        t = results.time[STEPS + 1 - found["out_of_bounds"]]
    assert f"{found['out_of_bounds']} of {STEPS + 1} states, from t = {t:g} s on" in beyond
    said = (f"reduced: bars, modes r = 3, g = 9; a step has {found['mean_samples']:.4g} samples "
            f"and {found['mean_points']:.4g} integration points on average; "
            f"{found['out_of_bounds']} of {STEPS + 1} states out of bounds")
    assert said in mpm_ref("info", out).stdout.splitlines()
    assert json.loads(mpm_ref("info", out, "--json").stdout)["reduced"] == found
    assert "times as far from the training runs" in beyond


@pytest.mark.parametrize(("g", "words"), [
    (1e3, "broke down in step 1: a particle crosses more than 1 dx"),
    (1e6, "step 1, t = 0.01 s: no body is left"),
])
def test_a_run_that_breaks_down_has_status_3_and_keeps_what_went_before(reduced, g, words):
    done, out = reduced("--set", f"g={g}")
    assert done.exit_code == 3
    assert words in done.stderr
    why, frames = ended(out)
    assert frames == 1
    assert words in why


def test_a_run_that_breaks_down_is_told_to_machines_too(reduced):
    done, out = reduced("--set", "g=1e3", "--json")
    assert done.exit_code == 3
    found = json.loads(done.stdout)
    assert (found["why"], found["status"], found["out"]) == ("broke down", 3, str(out))
    assert (found["step"], found["t"], found["frames"]) == (1, 0.01, 1)
    assert found["reason"] in done.stderr.splitlines()[-1]
    assert (found["reason"], found["frames"]) == ended(out)
    assert found["reduced"]["parameters"] == {"g": 1e3}


def test_a_run_is_told_to_machines_too(made, reduced):
    done, out = reduced("--set", "g=9", "--json")
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert (found["why"], found["out"], found["points_out"]) == ("finished", str(out), 64)
    assert found["status"] == 0
    assert (found["step"], found["frames"], found["t"]) == (STEPS, STEPS + 1, STEPS * 0.01)
    assert found["reduced"]["parameters"] == {"g": 9.0}
    assert found["reduced"]["map"] == {"kind": "modes", "r": 3}
    assert "beyond" in found["out_of_bounds"][str(STEPS)]
    with Results(out) as results:
        assert record.summary(results)["out_of_bounds"] == len(found["out_of_bounds"])


def test_a_curved_map_runs_and_is_evaluated(made, reduced, tmp_path):
    study, file = write(tmp_path, *CURVED), tmp_path / "curved.npz"
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", file)
    assert done.exit_code == 0, done.output
    done, out = reduced("--set", "g=2.5", study=study, map=file)
    assert done.exit_code == 0, done.output
    assert f"{STEPS} steps of curved, r = 2, 64 points" in done.stdout
    with h5py.File(out) as h5:
        assert h5["reduced/xhat"].shape == (STEPS + 1, 2)
    judged = mpm_ref("rom", "evaluate", study, "--map", file, "--data", made / "data", "--json",
                     "--out", tmp_path / "e.png")
    assert judged.exit_code == 0, judged.output
    errors = json.loads(judged.stdout)["all"]
    assert 0.0 < errors["nearest"]["displacement"] <= errors["reduced"]["displacement"] < 0.1
    assert_told(reduced("--set", "g=2.5", map=file, out=tmp_path / "b.h5")[0], 2,
                "run.projection = 'linear': expected 'nonlinear' for a curved map")


@pytest.mark.parametrize(("options", "status", "words"), [
    ((), 2, "add --set g=VALUE"),
    (("--set", "h=1"), 2, "one of the study's parameters g"),
    (("--set", "g"), 2, "g: expected NAME=VALUE"),
    (("--set", "g=3", "--set", "g = 4"), 2, "--set g is given twice, g=3 and g=4"),
    (("--set", "g = x"), 2, "g=x: expected a finite number"),
    (("--set", "g=2", "--map", "none.npz"), 2, "there is no none.npz: mpm-ref rom train "),
    (("--set", "g=2", "--map", "none.npz"), 2, "bars.toml --out none.npz"),
    (("--set", "g=2", "--out", "no/run.h5"), 4, "there is no folder"),
    (("--set", "g=2", "--out", "run.toml"), 2, "scenes have such names"),
    (("--out", "run.npz"), 2, "--out run.npz: expected a name that ends in .h5 or .hdf5"),
])
def test_what_a_run_needs_is_said(reduced, options, status, words):
    done, out = reduced(*options)
    assert_told(done, status, words)
    assert not out.exists()


def test_what_is_too_large_for_the_disk_is_told_before_it_is_made(reduced):
    """Of each point x, v, F and tau in 2D, 12 numbers, at all time levels."""
    done, out = reduced("--set", "g=2", "--points-out", 10**13)
    size = 10**13 * 12 * 8 * (STEPS + 1) / 1e12
    assert done.exit_code == 4
    announced, refused = done.stderr.splitlines()
    assert announced == f"mpm-ref: {out}: {size:.3g} TB will be written"
    assert refused.startswith(f"mpm-ref: {out}: {size:.3g} TB needed, ")
    assert not out.exists()


def test_other_files_are_not_replaced(made, reduced, tmp_path):
    _, out = reduced("--set", "g=2")
    before = out.read_bytes()
    assert_told(reduced("--set", "g=3")[0], 2, "add --overwrite")
    assert out.read_bytes() == before
    assert reduced("--set", "g=3", "--overwrite")[0].exit_code == 0
    assert out.read_bytes() != before
    out.write_text("x")
    assert_told(reduced("--set", "g=3", "--overwrite")[0], 2, "cannot be read as HDF5")
    assert out.read_text() == "x"


def test_a_full_order_run_does_not_go_on_from_a_reduced_one(made, reduced, tmp_path):
    _, out = reduced("--set", "g=2")
    before, same = out.read_bytes(), tmp_path / "same.toml"
    same.write_text(dumps(load(made / "bars.toml").scene([2.0])))
    done = mpm_ref("run", same, "--out", out, "--resume")
    assert_told(done, 2, "holds results of another scene")
    assert out.read_bytes() == before


def test_a_map_is_for_its_own_study(made, reduced, tmp_path):
    done, _ = reduced("--set", "g=2", study=write(tmp_path, ("to = 4.0", "to = 5.0")))
    assert_told(done, 2, "is a map of another study")


def test_samples_that_do_not_suffice_are_refused(reduced, tmp_path):
    for points, words in ((1, "expected at least 2 samples"), (500, "500 samples of 64 points")):
        study = write(tmp_path, ("[map]", f"[run]\npoints = {points}\n[map]"))
        assert_told(reduced("--set", "g=2", study=study)[0], 2, words)


# evaluate

def evaluate(made, *options, study="bars.toml", map="map.npz"):
    return mpm_ref("rom", "evaluate", made / study, "--map", made / map, "--data", made / "data",
                   *options)


def test_errors_are_those_of_the_run_that_was_held_out(made, reduced, tmp_path):
    done = evaluate(made, "--json", "--out", tmp_path / "errors.svg")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    (number,), g = load(made / "bars.toml").test, found["runs"][0]["parameters"]["g"]
    _, out = reduced("--set", f"g={g}")
    with Results(out) as ours, Results(made / "data" / f"case-00{number}.h5") as full:
        x, reference = ours.field("bar", "x"), full.field("bar", "x")
    error = np.linalg.norm(x - reference)
    run = found["runs"][0]["reduced"]
    assert run["origin"] == pytest.approx(error / np.linalg.norm(reference))
    assert run["displacement"] == pytest.approx(error / np.linalg.norm(reference - reference[0]))
    assert found["all"]["reduced"] == pytest.approx(run)
    assert 0.0 < found["all"]["nearest"]["displacement"] <= run["displacement"] < 0.05
    assert (tmp_path / "errors.svg").read_text().startswith("<?xml")


def test_the_table_has_a_row_for_each_run_and_one_for_all(made, tmp_path):
    done = evaluate(made, "--out", tmp_path / "errors.png")
    heading, head, *rows, nearest, _, _, _, interpolated, _, _, _, picture = (
        done.stdout.splitlines())
    assert "[%]" in heading
    assert head.split()[:3] == ["run", "g", "origin"]
    assert [row.split()[0] for row in rows] == [str(load(made / "bars.toml").test[0]), "all"]
    assert rows[0].split()[2:] == rows[1].split()[1:]
    assert nearest.startswith("position errors [%] of the training run")
    assert interpolated.startswith("position errors [%] of the linear interpolation")
    assert picture == str(tmp_path / "errors.png")


@pytest.mark.parametrize(("options", "words"), [
    (("--out", "errors.txt", "--map", "none.npz"), "ends in .png or .pdf or .svg"),
    (("--data", "none"), "none lacks 1 of 1 runs"),
    (("--map", "none.npz"), "there is no none.npz: mpm-ref rom train "),
])
def test_what_cannot_be_evaluated_is_said(made, options, words):
    assert_told(evaluate(made, *options), 2, words)


def test_without_a_run_held_out_there_is_nothing_to_evaluate(made, tmp_path):
    write(tmp_path, ("test = 1", "test = 0"))
    done = mpm_ref("rom", "evaluate", tmp_path / "bars.toml", "--map", made / "map.npz")
    assert_told(done, 2, "no run is held out")


def test_a_run_that_breaks_down_is_infinitely_off(made, tmp_path):
    study = load(made / "bars.toml")
    model = reduce.load(made / "map.npz", study)
    model_file.save(tmp_path / "bad.npz", model._replace(field=model.field._replace(
        slope=1e6 * model.field.slope)))
    done = evaluate(made, "--json", "--out", tmp_path / "e.png", map=tmp_path / "bad.npz")
    assert done.exit_code == 3
    found = json.loads(done.stdout)
    assert found["all"]["reduced"]["origin"] is None
    (number,), said = study.test, found["runs"][0]["broken"]["reduced"]
    assert said == "step 2: a particle crosses more than 1 dx in a step"
    assert (f"run {number} (g = {study.mu[number, 0]:g}): the reduced run broke down in {said}"
            in done.stderr)
    assert evaluate(made, "--out", tmp_path / "e.png", "--overwrite").stderr == ""
