"""Memory and time of an epoch with few and with all states kept: what is recorded of them."""

import pytest
from record_verdicts import verdict

from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nclaw import segments
from validation.nclaw.segments import ALL, FEW, EpochCost

COSTS = {FEW: EpochCost(13.0, 0.9, 0.5, 0.6, 2.0, (1.0, 4.0)),
         ALL: EpochCost(10.0, 5.9, 0.5, 3.5, 2.0, (1.0, 4.0 + 1e-6))}


@pytest.fixture
def asked(monkeypatch):
    """What was run, as (kept states, steps); the second run of each takes twice the time."""
    found = []

    def measured(keep_every, steps):
        found.append((keep_every, steps))
        one = COSTS[keep_every]
        return one._replace(cpu=one.cpu * (1 + (found.count((keep_every, steps)) == 2)))

    monkeypatch.setattr(segments, "find_spec", lambda name: object())
    monkeypatch.setattr(segments, "measured", measured)
    return found


def recorded(folder, profile):
    setting = RunSetting(profile, folder, targets=targets.load())
    assert run_all([segments.segments.experiment], setting) == []
    return {r.target.removeprefix("nclaw.segments."): r
            for r in ProfileResults(folder).records("nclaw.segments")}


def test_epochs_run_in_turn_after_one_that_compiles(asked, tmp_path):
    recorded(tmp_path, "standard")
    assert asked == [(25, 25), *3 * [(25, 1000), (1, 1000)]]
    table = ProfileResults(tmp_path).table("nclaw.segments", "epochs")
    assert list(zip(table["keep_every"], table["repeat"], table["cpu"], strict=True)) == [
        (25, 0, 13.0), (25, 1, 26.0), (25, 2, 13.0), (1, 0, 10.0), (1, 1, 20.0), (1, 2, 10.0)]


def test_memory_and_time_are_judged_by_the_aim(asked, tmp_path):
    found = recorded(tmp_path, "standard")
    values = {word: (found[word].value, verdict(found[word])) for word in
              ("memory", "process", "saved", "time", "cpu.few", "cpu.all")}
    assert values == {
        "memory": (pytest.approx(0.1), "pass"), "process": (0.9, "pass"),
        "saved": (pytest.approx(30.0), "info"), "time": (pytest.approx(1.3), "pass"),
        "cpu.few": (13.0, "info"), "cpu.all": (10.0, "info")}
    assert "5.9 GB with all states kept" in found["process"].note
    assert found["change"].value == pytest.approx(2.5e-7, rel=1e-3)


@pytest.mark.parametrize(("change", "word"), [
    ({"during": 1.6}, "memory"), ({"process": 1.1}, "process"), ({"cpu": 13.6}, "time"),
    ({"loss": 2.001}, "change"), ({"gradients": (1.001, 4.0)}, "change")])
def test_what_exceeds_its_bound_misses(asked, tmp_path, monkeypatch, change, word):
    monkeypatch.setitem(COSTS, FEW, COSTS[FEW]._replace(**change))
    found = recorded(tmp_path, "standard")
    assert {name for name, one in found.items() if verdict(one) == "miss"} == {word}


def test_a_short_run_has_a_share_of_the_memory(asked, tmp_path):
    found = recorded(tmp_path, "quick")
    assert asked == [(25, 200), (1, 200)]
    assert (found["memory"].bound, verdict(found["memory"])) == (0.2, "pass")
    assert [verdict(found[word]) for word in ("process", "time")] == ["info", "info"]


def test_without_pytorch_it_is_told_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(segments, "find_spec", lambda name: None)
    assert "PyTorch is not installed" in recorded(tmp_path, "quick")["nclaw.segments"].note


def test_an_epoch_that_fails_is_told_in_a_sentence(monkeypatch):
    monkeypatch.setattr(segments, "MODULE", "validation.no_such_module")
    with pytest.raises(RuntimeError, match=r"validation\.no_such_module 25 10 failed: .*No module"):
        segments.measured(25, 10)
