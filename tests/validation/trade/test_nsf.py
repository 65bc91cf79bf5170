"""What choices of NSF's reduced runs cost and give, on a small study of the jelly cube."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.study.errors import PositionErrors
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.extremes import nsf_runs
from validation.extremes.outcome import FINISHED
from validation.nsf import reduced_runs
from validation.nsf.studies import jelly
from validation.trade import nsf, nsf_sizes

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.4,), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))
TEST = 0.4


@pytest.fixture(scope="module")
def one():
    """The small study."""
    return reduced_runs.fit_study(STUDY)


@pytest.fixture
def results(one, tmp_path, monkeypatch):
    """A function that runs an experiment on the small study alone; returns `ProfileResults`."""
    monkeypatch.setattr(nsf_runs, "studies", lambda run: {"jelly": STUDY})
    monkeypatch.setattr(nsf_runs, "fit_study", lambda study: one)

    def made(function):
        assert not run_all([function.experiment], RunSetting("quick", tmp_path))
        return ProfileResults(tmp_path)
    return made


# Samples.

def test_each_kind_of_samples_is_run_and_all_particles(one, results, monkeypatch):
    monkeypatch.setattr(nsf, "COUNTS", {"quick": (5, 30)})
    monkeypatch.setattr(nsf, "DRAWS", {"quick": 2})
    found = results(nsf.samples_experiment)
    table, n = found.table("trade.nsf.samples", "samples"), len(one.fields.X)
    assert set(zip(table["fields"], table["samples"], table["draw"], strict=True)) == {
        ("random", n, 0), *((word, count, draw) for word in nsf.WEIGHTED for count in (5, 30)
                            for draw in (0, 1))}
    for word, weighed in nsf.WEIGHTED.items():
        row = (table["fields"] == word) & (table["samples"] == 30) & (table["draw"] == 1)
        own = one._replace(study=STUDY._replace(by_cell=word == "cells"))
        expected = own.errors(TEST, 30, 1, weighted=weighed)
        assert table["origin"][row] == pytest.approx(expected.errors.origin)
        assert table["points"][row] == pytest.approx(expected.points)
        assert table["kept"][row] == expected.samples
    assert (table["cpu"] > 0.0).all()
    assert len(set(table["cpu_full"])) == 1
    records = {r.target: r for r in found.records("trade.nsf.samples")}
    judged = {target: records.pop(f"trade.nsf.samples.jelly.{target}")
              for target in ("enough", "weights")}
    assert {r.comparator for r in records.values()} == {"info", "remark"}
    value = {target: r.value for target, r in records.items()}
    drawn, weighted = ([value[f"trade.nsf.samples.jelly.{kind}.{count}"] for count in (5, 30)]
                       for kind in ("random", "cubature"))
    assert judged["enough"].value == pytest.approx(
        drawn[1] / value[f"trade.nsf.samples.jelly.random.{n}"])
    assert judged["weights"].value == pytest.approx(weighted[1] / drawn[1])
    assert {*records} == {"trade.nsf.samples", f"trade.nsf.samples.jelly.random.{n}", *(
        f"trade.nsf.samples.jelly.{way}.{count}" for way in nsf.WEIGHTED for count in (5, 30))}
    told = {way: records[f"trade.nsf.samples.jelly.{way}.30"].note for way in nsf.WEIGHTED}
    assert "30 samples, random; of the stress" in told["random"]
    assert f"30 cells, cubature of their points, {expected.samples:g} kept, whose" in told["cells"]
    kept = one.errors(TEST, 30, 0, weighted=True).samples, one.errors(TEST, 30, 1,
                                                                      weighted=True).samples
    assert f"30 samples, cubature, {np.mean(kept):g} kept, whose weights" in told["cubature"]


def test_a_run_that_breaks_down_has_no_time(one, monkeypatch):
    assert 0.0 < nsf.reduced_cpu(one, 30, True, 2) < np.inf

    def broken(*_):
        raise NoBody("gone")
        yield

    monkeypatch.setattr(nsf, "nsf_run", lambda *_: SimpleNamespace(states=broken))
    assert nsf.reduced_cpu(one, 30, False, 1) == np.inf


# Steps.

def test_steps_grow_until_a_run_breaks_down(one, results, monkeypatch):
    asked = []

    def errors(self, value, count, draw, dt_factor, weighted):
        asked.append(dt_factor)
        good = dt_factor < 2.0
        return reduced_runs.RunErrors(
            PositionErrors(0.1 if good else np.inf, np.inf, np.inf), 0.2, 30.0, 40.0, np.nan)

    monkeypatch.setattr(type(one), "errors", errors)
    monkeypatch.setattr(nsf, "full_order_end", lambda scene, factor: f"end {factor:g}")
    found = results(nsf.steps_experiment)
    assert found.value("trade.nsf.dt", "trade.nsf.dt.jelly.printed") == 1.0
    table = found.table("trade.nsf.dt", "steps")
    assert asked == [1.0, 1.25, 1.5, 2.0]
    assert table["faster"].tolist() == asked
    assert table["full"].tolist() == ["end 1", "end 1.25", "end 1.5", "end 2"]


def test_full_order_runs_with_longer_steps_end_as_they_do():
    assert nsf.full_order_end(STUDY.run(TEST), 1.0) == FINISHED
    assert nsf.full_order_end(STUDY.run(TEST), 10.0) != FINISHED


# Sizes.

def test_bytes_are_of_all_arrays_once():
    a, b = np.zeros(3), np.zeros((2, 2), np.float32)
    assert nsf_sizes.nbytes((a, (b, a), None, "word")) == 24 + 16


def test_bytes_of_particles_are_those_of_both_bodies(one):
    n, found = len(one.fields.X), nsf_sizes.particle_bytes(STUDY)
    assert found % n == 0
    assert found / n > 8 * (3 + 3 + 9 + 9)      # of x, v, F and C at least


def test_single_precision_halves_the_modes_and_hardly_changes_errors(one):
    short = one._replace(fields=one.fields.single())
    halves = sum(a.nbytes for a in (one.fields.U, one.fields.tau.modes, one.fields.C.modes)) // 2
    assert nsf_sizes.nbytes(one.fields) - nsf_sizes.nbytes(short.fields) == halves
    errors = [own.errors(TEST, 40).errors.origin for own in (one, short)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-3)
    assert errors[0] != errors[1]
    assert one.fields._replace(C=None).single().C is None


def test_changes_are_one_at_a_time_and_leave_out_the_own_sizes(one):
    found = nsf_sizes.field_changes(one, {"r": (2, 3), "smoothing": (1e-4, 1.0)})
    assert [(knob, value) for knob, value, _ in found] == [
        ("own", "sizes"), ("r", "2"), ("smoothing", "1"), ("precision", "single")]
    assert found[1][2]().study.sizes == STUDY.sizes._replace(r=2)
    assert found[2][2]().study.sizes == STUDY.sizes._replace(smoothing=1.0)


def test_sizes_are_told_with_their_bytes(one, results, monkeypatch, tmp_path):
    monkeypatch.setattr(nsf_sizes, "LEVELS", {"quick": {"r": (2,), "C": (4,)}})
    table = results(nsf_sizes.sizes_experiment).table("trade.nsf.sizes", "sizes")
    assert table["knob"].tolist() == ["own", "r", "C", "precision"]
    assert (table["r"].tolist(), table["C"].tolist()) == ([3, 2, 3, 3], [12, 12, 4, 12])
    assert table["bytes"][0] == nsf_sizes.nbytes(one.fields)
    assert table["bytes"][2] < table["bytes"][0]
    assert table["bytes_full"][0] == nsf_sizes.particle_bytes(STUDY)
    assert table["origin"][1] > table["origin"][0]
    value = {r.target: r.value for r in ProfileResults(tmp_path).records("trade.nsf.sizes")}
    errors = [value[f"trade.nsf.sizes.jelly.{words}"] for words in ("own.sizes", "r.2", "C.4",
                                                                    "precision.single")]
    assert value.pop("trade.nsf.sizes.jelly.best") == pytest.approx(errors[0] / min(errors))
    assert {*value} == {"trade.nsf.sizes", *(f"trade.nsf.sizes.jelly.{words}" for words in (
        "own.sizes", "r.2", "C.4", "precision.single"))}


def test_the_two_scenes_have_a_test_each_in_the_quick_profile():
    for profile, tests in (("quick", [1, 1]), ("standard", [1, 4])):
        run = SimpleNamespace(choose=lambda profile=profile, **by: by[profile])
        found = nsf_runs.studies(run)
        assert [*found] == ["jelly", "metal"]
        assert [len(study.test) for study in found.values()] == tests
