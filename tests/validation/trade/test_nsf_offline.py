"""NSF: what fields cost before the first reduced run, and when that is paid back."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.ldm.timing import StepTime
from validation.nsf.studies import jelly
from validation.trade import nsf_offline
from validation.trade.nsf_offline import OfflineCosts

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.4,), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))


@pytest.fixture
def counted(monkeypatch):
    """Every clock shows 2, 4, 6, .. CPU seconds; a full-order run takes 10, a reduced one 4."""
    shown = iter(range(2, 100, 2))
    monkeypatch.setattr(nsf_offline, "timed", lambda step: (step(), StepTime(0.0, next(shown))))
    monkeypatch.setattr(nsf_offline, "full_cpu", lambda one: 10.0)
    monkeypatch.setattr(nsf_offline, "reduced_cpu", lambda one, count, weighed, repeats: 4.0)


def test_it_is_paid_back_once_the_full_runs_would_have_cost_as_much():
    bill = OfflineCosts(runs=30.0, making=6.0, full=10.0, reduced=4.0)
    assert bill.pays_after == 6.0
    assert bill.runs + bill.making + 6 * bill.reduced == 6 * bill.full


@pytest.mark.parametrize("reduced", [10.0, 11.0, np.inf])
def test_it_is_never_paid_back_by_runs_that_are_not_faster(reduced):
    assert OfflineCosts(30.0, 6.0, 10.0, reduced).pays_after == np.inf


@pytest.mark.usefixtures("counted")
def test_runs_and_fields_are_clocked_apart():
    one, bill = nsf_offline.mode_costs(STUDY, 1)
    assert bill == OfflineCosts(2, 4, 10.0, 4.0)
    assert one.fields.r == 3
    assert [*one.tests] == [0.4]
    assert len(one.runs.mu) == 2


@pytest.mark.usefixtures("counted")
def test_networks_cost_the_same_runs_and_their_own_training(monkeypatch):
    one, bill = nsf_offline.mode_costs(STUDY, 1)
    known = SimpleNamespace(xhat=np.zeros((2, 5, 3)),
                            about={"cpu_seconds": {"g": 50.0, "h": 8.0, "l": 2.0}})
    monkeypatch.setattr(nsf_offline, "trained", lambda name: known)
    monkeypatch.setattr(nsf_offline, "fields_of", lambda model, study: one.fields)
    run, drafts = recording()
    (row,) = nsf_offline.network_costs(run, "jelly", one, bill)
    assert row == ("jelly", "networks", 2, 60.0, 10.0, 4.0, 62.0 / 6.0)
    assert drafts["trade.nsf.offline.jelly.networks.making"] == 60.0


def test_networks_that_are_not_trained_are_told(monkeypatch):
    def missing(name):
        raise Untrained(f"no weights {name}.npz")

    monkeypatch.setattr(nsf_offline, "trained", missing)
    run, drafts = recording()
    assert nsf_offline.network_costs(run, "jelly", None, None) == []
    assert drafts == {"said": "no weights jelly.npz"}


def recording():
    """A run that keeps what it is told, and where."""
    drafts = {}
    return SimpleNamespace(record=lambda id, value, **_: drafts.update({id: value}),
                           note=lambda said: drafts.update(said=said)), drafts


@pytest.mark.usefixtures("counted")
def test_all_is_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(nsf_offline, "studies", lambda run: {"jelly": STUDY})
    assert not run_all([nsf_offline.offline.experiment],
                       RunSetting("quick", tmp_path, targets=targets.load()))
    found = ProfileResults(tmp_path)
    records = {r.target.split(".")[-1]: r for r in found.records("trade.nsf.offline")}
    trainings = {"train_time_lo", "train_time_hi"}
    assert {*records} == {"offline", *OfflineCosts._fields, "pays_after", *trainings}
    assert records["pays_after"].value == 1.0
    assert records["runs"].unit == "s"
    assert "40 samples" in records["runs"].scale
    table = found.table("trade.nsf.offline", "bills")
    assert [float(table[word][0]) for word in OfflineCosts._fields] == [2.0, 4.0, 10.0, 4.0]


def test_the_shortest_and_the_longest_training_are_told(monkeypatch):
    def known(name):
        if name == "metal-waves":
            raise Untrained(f"no weights {name}.npz")
        h = 7200.0 if name == "sand-waves" else 90.0
        return SimpleNamespace(about={"cpu_seconds": {"g": 90.0, "h": h}})

    monkeypatch.setattr(nsf_offline, "trained", known)
    run, drafts = recording()
    run.experiment = nsf_offline.offline.experiment
    nsf_offline.record_trainings(run)
    assert drafts == {"trade.nsf.offline.untrained": 1, "nsf.sec7.train_time_lo": 0.05,
                      "nsf.sec7.train_time_hi": 2.025}


def test_the_printed_resolution_is_that_of_the_standard_profile():
    for profile, coarser in (("quick", 4), ("standard", 1)):
        run = SimpleNamespace(choose=lambda profile=profile, **by: by[profile])
        found = nsf_offline.studies(run)
        assert {*found} == {"jelly", "metal"}
        assert {study.coarser for study in found.values()} == {coarser}
