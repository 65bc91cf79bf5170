"""`mpm-ref rom` and `info` of studies with model = "nsf": what they write and say."""

import json
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_nsf_studies import EVERY, RUNS, STEPS, modelled, write
from small_studies import ended

from mpm_ref.rom import model_file
from mpm_ref.rom.extrapolation import BEYOND
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.study import record, reduce
from mpm_ref.rom.study.dataset import load_histories, simulate_history
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.generate import run_options
from mpm_ref.rom.study.monitor import FIELD_DEPARTURE
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.study.samples import drawn_samples
from mpm_ref.rom.study.study import load
from mpm_ref.rom.study.tables import NSF
from mpm_ref.rom.symmetric import values
from mpm_ref.scene import build
from mpm_ref.store.results import Results
from mpm_ref.store.running import run

ONE = ("--workers", 1)
LEVELS = STEPS // EVERY + 1


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its fields, made by the two commands."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def pairs(made):
    """The `ReducedStudy`."""
    return load(made / "pairs.toml")


@pytest.fixture
def reduced(made, tmp_path):
    """A function that makes a reduced run with some options: what is answered, and its file."""
    def run(*options, study=made / "pairs.toml", out=tmp_path / "run.h5"):
        return mpm_ref("rom", "run", study, "--map", made / "fields.npz", "--out", out,
                       *options), out
    return run


# generate

def test_runs_hold_what_fields_are_made_of(made, pairs):
    """Of both bodies, every second step, with the parameters."""
    with Results(made / "data" / "case-002.h5") as results:
        assert {name: results.fields(name) for name in results.bodies} == {
            name: ["x", "C", "tau"] for name in ("hard", "soft")}
        assert results.manifest["parameters"] == {"v": pairs.mu[2, 0]}
        assert results.step.tolist() == list(range(0, STEPS + 1, EVERY))
    found = load_histories(pairs, made / "data", (2, 0), float)
    for k, number in enumerate((2, 0)):
        full = simulate_history(pairs.scene(pairs.mu[number]), pairs.mu[number])
        assert np.array_equal(found.X, full.X)
        assert np.array_equal(found.v[k], full.v[0])
        assert found.mu[k] == pairs.mu[number]
        for name in ("x", "tau", "C"):
            assert np.array_equal(getattr(found, name)[k], getattr(full, name)[0, ::EVERY])
    assert found.dt == pytest.approx(EVERY * full.dt)
    assert np.abs(found.tau[:, -1]).max() > 100.0


def test_what_is_there_is_not_made_again_and_what_was_cut_off_goes_on(made, pairs, tmp_path):
    study, data = write(tmp_path), tmp_path / "data"
    data.mkdir()
    shutil.copy(made / "data" / "case-000.h5", data)
    run(build(pairs.scene(pairs.mu[1])), data / "case-001.h5",
        replace(run_options(pairs, 1), steps=5))
    before = (data / "case-000.h5").stat().st_mtime_ns
    done = mpm_ref("rom", "generate", study, "--out", data, *ONE)
    assert "made 2, continued 1, 1 were there; 1 held out" in done.stdout
    assert (data / "case-000.h5").stat().st_mtime_ns == before
    for k in range(RUNS):
        name = f"case-{k:03d}.h5"
        with Results(data / name) as ours, Results(made / "data" / name) as theirs:
            for field in ("x", "C", "tau"):
                assert np.array_equal(ours.field("soft", field), theirs.field("soft", field))


def test_runs_of_other_states_kept_are_not_taken(made, tmp_path):
    study = write(tmp_path, ("[map]", "[set]\nevery = 4\n[map]"))
    done = mpm_ref("rom", "generate", study, "--out", made / "data", *ONE)
    assert_told(done, 2, "case-000.h5 holds a run of another scene")


# train

def test_fields_are_those_of_the_training_runs(made, pairs):
    model = reduce.load(made / "fields.npz", pairs)
    data = load_histories(pairs, made / "data", pairs.train)
    fields, xhat = fit_pod_fields(data, Sizes(3, 5, 8, 8, smoothing=1e-6), BLOCK * 0.1)
    assert np.array_equal(model.xhat, xhat)
    assert xhat.shape == (RUNS - 1, LEVELS, 3)
    assert np.array_equal(model.field.tau.coefficients.w, fields.tau.coefficients.w)
    assert np.array_equal(model.field.cells.order, fields.cells.order)
    assert model.about["model"] == NSF
    x = np.stack([fields.place(np.arange(len(data.X)), y) for y in xhat.reshape(-1, 3)])
    off = np.linalg.norm(x - data.x.reshape(x.shape)) / np.linalg.norm(data.x)
    assert model.about["fit"]["errors"]["origin"] == pytest.approx(off, rel=1e-4)


def test_the_stress_sees_the_parameters_where_the_study_says_so(made, tmp_path):
    out = tmp_path / "fields.npz"
    study = write(tmp_path, ("r = 3", "r = 3\nstress_sees_parameters = false"))
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", out)
    assert done.exit_code == 0, done.output
    assert model_file.load(made / "fields.npz").field.mu.shape == (1,)
    assert model_file.load(out).field.mu.shape == (0,)


def test_fields_of_a_single_run_ignore_its_parameter(tmp_path):
    """They see a parameter that does not vary, and are asked in a run with another."""
    study = write(tmp_path, ("from = 1.6\nto = 2.4\ncount = 4", "values = [1.7, 2.4]"))
    data, out = tmp_path / "data", tmp_path / "fields.npz"
    for command in (("generate", study, "--out", data),
                    ("train", study, "--data", data, "--out", out)):
        assert mpm_ref("rom", *command).exit_code == 0
    done = mpm_ref("rom", "evaluate", study, "--map", out, "--data", data, "--out",
                   tmp_path / "e.png", "--json")
    assert json.loads(done.stdout)["stress"]["all"]["nearest"] < 2.0


# run

@pytest.mark.parametrize(("way", "plan"), [
    ("points = 20", (20, 0)),
    ('points = 9\nseed = 3\ndt_factor = 2.0\ninversion = "linear"', (9, 3, 2.0, "linear")),
    ("points = 9\ninversion_tolerance = 1e-6", (9, 0, 1.0, "nonlinear", 1e-6)),
    ("", (None, 0)),
])
def test_a_run_is_the_reduced_run_of_its_parameters(made, reduced, tmp_path, way, plan):
    done, out = reduced("--set", "v=1.9", study=write(tmp_path, ("points = 20", way)))
    pairs = load(made / "pairs.toml")
    assert (done.exit_code, done.stderr) == (0, "")
    model, one = reduce.load(made / "fields.npz", pairs), nsf_full_model(pairs.scene([1.9]))
    (count, seed, *how), n, fields = plan, len(one.X), model.field.with_parameters([1.9])
    plan = FieldRunOptions((drawn_samples(n, count or n, seed),), *how)
    states = list(nsf_run(one, fields, plan, model.rest).states())
    with Results(out) as results:
        def of_both(name, k):
            return np.concatenate([results.field(body, name, k) for body in ("hard", "soft")])

        assert np.array_equal(results.time, [t for t, *_ in states])
        for k, (_, at, report, _) in enumerate(states):
            assert np.array_equal(of_both("x", k), fields.place(np.arange(n), at.xhat))
            assert np.array_equal(of_both("tau", k), fields.stress(np.arange(n), at.xhat))
            assert np.array_equal(of_both("C", k), fields.affine(np.arange(n), at.xhat))
            assert results.h5["reduced/points"][k] == (report.points if report else 0)
        assert np.array_equal(of_both("v", 0), one.v)
        step = (of_both("x", 4) - of_both("x", 3)) / np.diff(results.time[3:5])
        np.testing.assert_allclose(of_both("v", 4), step, rtol=1e-12, atol=1e-12)


def test_a_run_in_single_precision_is_one_on_rounded_modes(made, reduced, tmp_path):
    """Whose bytes are half as many, and which hardly moves."""
    study = write(tmp_path, ("points = 20", 'points = 20\nprecision = "single"'))
    exact, rounded = (reduce.load(made / "fields.npz", load(path)).field
                      for path in (made / "pairs.toml", study))
    for ours, theirs in zip((rounded.U, rounded.tau.modes, rounded.C.modes),
                            (exact.U, exact.tau.modes, exact.C.modes), strict=True):
        assert (ours.dtype, theirs.dtype) == (np.float32, float)
        assert np.array_equal(ours, theirs.astype(np.float32))
    _, double = reduced("--set", "v=1.9")
    done, single = reduced("--set", "v=1.9", study=study, out=tmp_path / "single.h5")
    assert (done.exit_code, done.stderr) == (0, "")
    with h5py.File(double) as ours, h5py.File(single) as theirs:
        for name in ("bodies/soft/x", "bodies/hard/tau"):
            apart = np.abs(theirs[name][()] - ours[name][()]).max()
            assert 0.0 < apart < 1e-5 * np.abs(ours[name][()]).max()
    assert "20 points, single precision" in mpm_ref("info", study).stdout


def test_a_run_that_was_cut_off_goes_on_bit_for_bit(reduced, tmp_path, monkeypatch):
    show = record._show

    def interrupted(writer, state, problem):
        if state.step == 6:
            raise KeyboardInterrupt
        show(writer, state, problem)

    _, whole_run = reduced("--set", "v=1.9", out=tmp_path / "whole.h5")
    with monkeypatch.context() as patch:
        patch.setattr(record, "_show", interrupted)
        done, out = reduced("--set", "v=1.9")
    assert_told(done, 130, f"at step 5 of {STEPS}; the same command again goes on")
    assert ended(out) == ("interrupted", 6)
    assert_told(reduced("--set", "v=2.0")[0], 2, "holds another reduced run")
    assert reduced("--set", "v=1.9")[0].exit_code == 0
    with h5py.File(out) as ours, h5py.File(whole_run) as theirs:
        for name in (*(f"reduced/{name}" for name in theirs["reduced"]), "bodies/soft/x",
                     "bodies/hard/v", "bodies/hard/tau"):
            assert np.array_equal(ours[name], theirs[name])
        assert "first_step\": 5" in ours["manifest"][()].decode()


def test_a_run_that_breaks_down_has_status_3_and_keeps_what_went_before(reduced):
    done, out = reduced("--set", "v=200", "--json")
    assert done.exit_code == 3
    found = json.loads(done.stdout)
    assert (found["why"], found["frames"]) == ("broke down", 1)
    assert "lies outside the range" in done.stderr
    assert "broke down in step 1: " in done.stderr
    assert ended(out) == (found["reason"], 1)


def test_states_that_the_fields_have_not_learned_are_warned_of(reduced):
    done, out = reduced("--set", "v=9")
    assert done.exit_code == 0
    outside, beyond = done.stderr.splitlines()
    assert "v = 9 lies outside the range" in outside
    assert "times as far from the training runs" in beyond
    with Results(out) as results:
        found = record.summary(results)
        beyond_bound = results.h5["reduced/beyond"][()] > BEYOND
        departed = results.h5["reduced/departure"][()] > FIELD_DEPARTURE
        assert found["out_of_bounds"] == np.sum(beyond_bound | departed) > beyond_bound.sum() > 0
    assert np.argmax(departed) < np.argmax(beyond_bound)        # the speed shows before the place
    assert f"{found['out_of_bounds']} of {STEPS + 1} states" in beyond


# evaluate

def test_errors_are_those_of_the_run_that_was_held_out(made, pairs, reduced, tmp_path):
    done = mpm_ref("rom", "evaluate", made / "pairs.toml", "--map", made / "fields.npz", "--data",
                   made / "data", "--out", tmp_path / "errors.svg", "--json")
    assert done.exit_code == 0, done.output
    found, (number,) = json.loads(done.stdout), pairs.test
    assert found["runs"][0]["parameters"] == {"v": pairs.mu[number, 0]}
    full = load_histories(pairs, made / "data", pairs.test, float)
    _, out = reduced("--set", f"v={pairs.mu[number, 0]}")
    with Results(out) as results:
        x, tau = (np.concatenate([results.field(body, name)[EVERY::EVERY] for body in
                                  ("hard", "soft")], axis=1) for name in ("x", "tau"))
    error = np.linalg.norm(x - full.x[0, 1:])
    own = found["runs"][0]["reduced"]
    assert own["origin"] == pytest.approx(error / np.linalg.norm(full.x[0, 1:]), rel=1e-4)
    assert own["displacement"] == pytest.approx(
        error / np.linalg.norm(full.x[0, 1:] - full.X), rel=1e-4)
    off = np.linalg.norm(values(tau) - full.tau[0, 1:]) / np.linalg.norm(full.tau[0, 1:])
    assert found["stress"]["all"]["reduced"] == pytest.approx(off, rel=1e-4)
    assert 0.0 < found["all"]["nearest"]["origin"] <= own["origin"] < 0.01
    assert (tmp_path / "errors.svg").read_text().startswith("<?xml")


def test_the_stress_has_a_table_of_its_own(made, tmp_path):
    done = mpm_ref("rom", "evaluate", made / "pairs.toml", "--map", made / "fields.npz", "--data",
                   made / "data", "--out", tmp_path / "errors.png")
    *_, heading, head, one, every, picture = done.stdout.splitlines()
    assert heading.startswith("errors of the Kirchhoff stress [%]")
    assert (head.split(), one.split()[1:]) == (["run", "reduced", "nearest"], every.split()[1:])
    assert picture == str(tmp_path / "errors.png")


def test_longer_steps_are_compared_where_they_meet_the_states_kept(made, tmp_path):
    """Of three steps of 1.5 two end between states that are two steps apart."""
    def evaluated(faster):
        study = write(tmp_path, ("points = 20", f"points = 20\ndt_factor = {faster}"))
        return mpm_ref("rom", "evaluate", study, "--map", made / "fields.npz", "--data",
                       made / "data", "--out", tmp_path / "e.png", "--overwrite", "--json")

    error = json.loads(evaluated(1.5).stdout)["all"]["reduced"]["origin"]
    assert 0.0 < error < 0.01
    assert_told(evaluated(1.01), 2, "dt_factor = 1.01: expected steps of which some end at a")
    assert_told(evaluated(20.0), 2, "dt_factor = 20: expected at most 16, the steps of the scene")


def test_a_run_that_breaks_down_is_infinitely_off(made, pairs, tmp_path):
    model, bad = reduce.load(made / "fields.npz", pairs), tmp_path / "bad.npz"
    tau = model.field.tau
    model_file.save(bad, model._replace(field=model.field._replace(
        tau=tau._replace(modes=1e6 * tau.modes))))
    done = mpm_ref("rom", "evaluate", made / "pairs.toml", "--map", bad, "--data", made / "data",
                   "--out", tmp_path / "e.png", "--json")
    assert done.exit_code == 3
    found, (number,) = json.loads(done.stdout), pairs.test
    assert found["all"]["reduced"]["origin"] is found["stress"]["all"]["reduced"] is None
    assert found["stress"]["runs"][0]["nearest"] > 1e3
    said = found["runs"][0]["broken"]["reduced"]
    assert said == "step 1: a particle crosses more than 1 dx in a step"
    assert (f"run {number} (v = {pairs.mu[number, 0]:g}): the reduced run broke down in {said}"
            in done.stderr)


# info

def test_info_knows_study_fields_and_results(made, pairs, reduced):
    study, n = made / "pairs.toml", len(nsf_full_model(pairs.base).X)
    modes = ("modes: 5 of the displacement, 8 of the stress, 8 of the affine field; the stress "
             "sees the parameters")
    assert mpm_ref("info", study).stdout.splitlines() == [
        f"{study}: a study, Two disks: 4 runs of the scene disks.toml, 1 held out",
        f"2D, {n} points, dx = 0.1 m, {STEPS} steps of 0.002 s, one in 2 kept",
        "parameters: v = 1.6 .. 2.4 (body.hard.velocity.linear[0])",
        f"stress fields: modes, r = 3, {modes}; reduced runs: nonlinear inversion, 20 points"]
    assert json.loads(mpm_ref("info", study, "--json").stdout)["model"] == NSF
    what, of, sizes, off, by = mpm_ref("info", made / "fields.npz").stdout.splitlines()
    assert what.endswith(f"fields.npz: stress fields, modes, r = 3, 2D, {n} points, study pairs, "
                         "scene disks.toml")
    assert of.startswith(f"made of 3 runs of {LEVELS} states, v = ")
    assert sizes == modes
    assert off.startswith("off these runs, at its own latent coordinates, by ")
    assert by.startswith("made by: mpm-ref rom train ")
    _, out = reduced("--set", "v=2")
    said = mpm_ref("info", out).stdout
    with h5py.File(out) as h5:
        points = h5["reduced/points"][1:].mean()
    assert 20 < points <= n
    assert (f"reduced: pairs, modes r = 3, v = 2; a step has 20 samples and {points:.4g} "
            "integration points on average; 0 of 17 states out of bounds") in said
    assert "hard" in said
    assert "(x v C tau)" in said
