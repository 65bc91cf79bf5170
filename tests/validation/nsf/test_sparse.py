"""Samples that tell too little of a reduced run with inferred stress: warned of before it."""

from types import SimpleNamespace

import numpy as np
import pytest
from command_line import mpm_ref
from small_nsf_studies import modelled, write
from small_toys import Records

from mpm_ref.rom import model_file
from mpm_ref.rom.cubature import misfit
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.study import monitor
from mpm_ref.rom.study import samples as choice
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.study.samples import (
    SampleSet,
    cell_samples,
    chosen_samples,
    drawn_samples,
    weighted_samples,
)
from mpm_ref.rom.study.study import load
from mpm_ref.store.results import Results as Stored
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.extremes import nsf_samples as samples
from validation.extremes.ldm_runs import BAD, ReducedTrial
from validation.extremes.nsf_runs import FieldBench, FieldEnd
from validation.nsf import reduced_runs
from validation.nsf.studies import jelly

GOOD = FieldEnd(2.0, 0.2, 15.0, 30, -1, "", 0.4, 5, 0.2, 0.01, "")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its fields."""
    return modelled(tmp_path_factory.mktemp("made"))


def test_they_are_told_by_the_command(made, tmp_path, monkeypatch):
    fields = model_file.load(made / "fields.npz").field
    left = misfit(fields.U, 3, drawn_samples(len(fields.X), 20, 0).points)
    for bound, warned in ((0.99 * left, True), (1.01 * left, False)):
        monkeypatch.setattr(monitor, "SPARSE", bound)
        done = mpm_ref("rom", "run", made / "pairs.toml", "--map", made / "fields.npz", "--out",
                       tmp_path / "run.h5", "--set", "v=2", "--overwrite")
        assert done.exit_code == 0
        assert (f"the 20 samples leave {100.0 * left:.0f} % of the products of the modes, and most"
                in done.stderr) is warned


@pytest.mark.parametrize(("asked", "pick", "words"), [
    ("points = 9\nseed = 2\nweighted = true", lambda fields,
     one: weighted_samples(fields, len(one.X), 9, 2),
     "9 points at most, with weights"),
    ("cells = 4\nseed = 2", lambda fields, one: cell_samples(fields, one.problem, len(one.X), 4, 2),
     "points of 4 cells at most, with weights")])
def test_a_run_on_samples_with_weights_is_that_of_their_plan(made, tmp_path, monkeypatch, asked,
                                                             pick, words):
    """By `rom run` and by `rom evaluate`; of networks there are none. The seed draws candidates."""
    monkeypatch.setattr(choice, "CANDIDATES", 40)
    monkeypatch.setattr(choice, "MAX_CELLS", 12)
    study, out = write(tmp_path, ("points = 20", asked)), tmp_path / "run.h5"
    done = mpm_ref("rom", "run", study, "--map", made / "fields.npz", "--out", out, "--set", "v=2")
    assert done.exit_code == 0, done.output
    model, one = model_file.load(made / "fields.npz"), nsf_full_model(load(study).scene([2.0]))
    fields = model.field.with_parameters([2.0])
    chosen = pick(fields, one)
    run = nsf_run(one, fields, FieldRunOptions((chosen,)), model.rest)
    *_, (_, last, report, _) = run.states()
    with Stored(out) as results:
        assert np.array_equal(results.h5["reduced/xhat"][-1], last.xhat)
        assert results.h5["reduced/samples"][-1] == report.samples == len(chosen.points)
    assert words in mpm_ref("info", study).stdout
    errors = mpm_ref("rom", "evaluate", study, "--map", made / "fields.npz", "--data",
                     made / "data", "--out", tmp_path / "e.png", "--json")
    assert errors.exit_code == 0, errors.output
    said = f"{asked.splitlines()[0 if 'cells' in asked else -1]}: weights of samples are computed"
    with pytest.raises(ValueError, match=said):
        chosen_samples(load(study).tables.run, one.problem, SimpleNamespace(dim=2, r=3, X=one.X))


def test_of_networks_nothing_is_known():
    assert not list(monitor.sample_warnings(SimpleNamespace(r=3), drawn_samples(40, 1, 0)))


def test_weights_tell_what_they_leave():
    for left, count in ((0.9, 1), (0.1, 0)):
        one = SampleSet(0.0, np.arange(4), np.ones(4), left)
        assert len(list(monitor.sample_warnings(SimpleNamespace(r=3), one))) == count


def trial(error=2.0, flags=""):
    end = GOOD._replace(error=error, flags=flags)
    return ReducedTrial("jelly", "draw 0", "inferred", 40, 2.0, end)


def test_bad_runs_that_their_samples_tell_are_counted():
    """Two of three bad ones, one of two silent ones, one of two good ones."""
    bad = 1.01 * BAD * 2.0
    found = [trial(bad), trial(bad), trial(bad, "beyond"), trial(), trial()]
    records = Records()
    samples.record_misfit(records, "extremes.nsf.samples",
                        list(zip(found, [0.9, 0.1, 0.8, 0.9, 0.2], strict=True)))
    share, note = records["extremes.nsf.samples.told"]
    assert share == pytest.approx(2 / 3)
    assert "share of the 3 bad runs" in note
    assert "those of 1 of the 2 silent ones, and of 1 of the 2 that are good" in note


def test_sets_are_few_drawn_ones_and_corners(rng):
    fields = SimpleNamespace(X=rng.uniform(size=(150, 3)))
    bench = SimpleNamespace(tested=SimpleNamespace(fields=fields))
    bench.drawn = lambda count, draw=0: FieldBench.drawn(bench, count, draw)
    found = samples.sample_sets(bench, "quick")
    assert [(what, len(chosen.points)) for what, chosen in found] == [
        ("draw 0", 1), ("draw 0", 3), *((f"at the {place} corner", count)
                                        for place in ("lower", "upper") for count in (10, 100))]
    assert np.array_equal(found[1][1].points, drawn_samples(150, 3, 0).points)


def test_scenes_that_the_bound_has_not_seen_are_judged_by_it(tmp_path, monkeypatch):
    """Others than those that it was chosen by, on samples anywhere; few, none in a corner."""
    study = jelly(4)._replace(train=(0.3, 0.5), test=(0.4,), samples=40,
                              sizes=Sizes(r=5, modes=8, tau=12, C=12, smoothing=1e-4))
    monkeypatch.setattr(samples, "other_studies", lambda run: {"cube": study})
    assert not run_all([samples.other_scenes.experiment], RunSetting("quick", tmp_path))
    found = ProfileResults(tmp_path)
    table = found.table("extremes.nsf.unseen", "left")
    assert list(zip(table["model"], table["what"], table["samples"], strict=True)) == [
        ("cube", "draw 0", 3)]
    one = reduced_runs.fit_study(study)
    points = drawn_samples(len(one.fields.X), 3, 0).points
    assert table["left"] == pytest.approx([misfit(one.fields.U, 5, points)])
    records = {r.target: r for r in found.records("extremes.nsf.unseen")}
    assert {"extremes.nsf.unseen.told", "extremes.nsf.unseen.silent",
            "extremes.nsf.unseen.cube.3.draw-0"} <= {*records}


def test_they_are_other_scenes_with_samples_anywhere():
    studies = samples.other_studies(Records())
    assert {*studies}.isdisjoint({"jelly", "metal"})
    assert {(study.column, study.later) for study in studies.values()} == {(None, None)}
