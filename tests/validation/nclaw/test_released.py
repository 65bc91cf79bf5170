"""Errors of readings as released: which experiment has them, beside which printed numbers."""

import pytest
from record_verdicts import expected, verdict

from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nclaw import errors, tables, trained_laws
from validation.nclaw.evaluate import ComparedError

ERROR = 0.125
NAMES = ("jelly", "jelly-spline", "jelly-spline-released", "sand-neural-released")


@pytest.fixture
def found(monkeypatch, tmp_path):
    """What an experiment records of errors that are all `ERROR`: {target: `Record`}."""
    monkeypatch.setattr(errors, "compare",
                        lambda scene, laws, goes_on: [ComparedError(ERROR)] * len(laws))
    monkeypatch.setattr(errors, "body_maker", lambda laws: laws)
    monkeypatch.setattr(tables, "trained", lambda name: name)
    monkeypatch.setattr(tables, "RIVALS", {})
    monkeypatch.setattr(tables, "nets", lambda: {
        n: trained_laws.LawNet(n.split("-")[0]) for n in NAMES})

    def of(experiment):
        failed = run_all([experiment], RunSetting("standard", tmp_path, targets=targets.load()))
        assert failed == []
        return {r.target: r for r in ProfileResults(tmp_path).records(experiment.id)}

    return of


def test_they_are_judged_by_the_printed_errors(found):
    records = found(tables.released.experiment)
    assert {target: (expected(r), verdict(r)) for target, r in records.items()
            if r.value == ERROR} == {
        "nclaw.table1.spline.jello": (0.24, "better"),
        "nclaw.table2.spline.jello.time": (0.26, "better"),
        "nclaw.table2.spline.jello.velocity": (0.24, "better"),
        "nclaw.table1.neural.sand": (0.012, "miss"),
        "nclaw.table2.neural.sand.time": (0.047, "miss"),
        "nclaw.table2.neural.sand.velocity": (0.0062, "miss")}


def test_the_tables_have_the_repaired_ones(found):
    records = found(tables.table1.experiment)
    assert {target for target, r in records.items() if r.value == ERROR} == {
        "nclaw.table1.ours.jello", "nclaw.table1.spline.jello.repaired"}


def test_the_largest_of_ours_is_generally_below_a_thousandth(found, monkeypatch):
    assert "nclaw.sec4_2.recon_ours_lt" not in found(tables.table1.experiment)
    monkeypatch.setattr(tables, "nets", lambda: {
        n: trained_laws.LawNet(n) for n in tables.ENVIRONMENTS})
    record = found(tables.table1.experiment)["nclaw.sec4_2.recon_ours_lt"]
    assert (record.value, expected(record), verdict(record)) == (ERROR, 0.001, "miss")


def test_a_training_that_diverged_misses_its_printed_errors(found, monkeypatch):
    monkeypatch.setattr(tables, "identity", lambda net: {})
    monkeypatch.setattr(tables, "diverged", lambda name, expected: {
        "stopped": "in epoch 165"} if name == "sand-neural-released" else None)
    monkeypatch.setattr(tables, "load_available", lambda run, names, load: {})
    records = found(tables.released.experiment)
    missed = [f"nclaw.{id}" for id in ("table1.neural.sand", "table2.neural.sand.time",
                                       "table2.neural.sand.velocity")]
    assert {target for target, r in records.items() if verdict(r) == "miss"} == {*missed}
    assert {records[target].value for target in missed} == {None}
    assert "diverged: in epoch 165" in records[missed[0]].note
