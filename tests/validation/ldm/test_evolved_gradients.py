"""Errors with evolved deformation gradients are judged by the printed ones, or by the map's."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.study.errors import PositionErrors
from validation.common import targets
from validation.common.verdicts import printed_id
from validation.ldm import evolved_gradients as experiment
from validation.ldm.references import record_seeds

TESTS = SimpleNamespace(X=np.zeros((7, 3)), scale="runs")


@pytest.fixture
def run():
    """A run that keeps records, with their rules."""
    found = {}
    return SimpleNamespace(progress=lambda names, noun: names, found=found,
                           record=lambda id, value, **rule: found.update({id: (value, rule)}))


def test_pokes_are_judged_by_the_printed_errors_of_the_same_scheme(run, monkeypatch):
    monkeypatch.setattr(experiment, "trained", lambda net: SimpleNamespace(field=None, rest=None))
    monkeypatch.setattr(experiment, "errors_of", lambda run, table, case, options: PositionErrors(
        *3 * [0.01]))
    rows = experiment.judged_rows(run, "ldm.table5", TESTS)
    id = "ldm.table5.lagrangian_linear.all.evolved"
    value, rule = run.found[id]
    assert value == pytest.approx(1.0)
    assert "comparator" not in rule
    assert printed_id(id, targets.load()) == (id.removesuffix(".evolved"), ("evolved",))
    name = "ldm.evolved.ldm.table5.lagrangian_{}.all.map"
    assert run.found[name.format("linear")][1]["comparator"] == "info"
    assert name.format("nonlinear") not in run.found
    assert len(rows) == 3 * 2


def test_trainings_have_a_median_and_a_spread(run):
    errors = {net: PositionErrors(*3 * [share]) for net, share in
              (("poke", 0.01), ("poke-1", 0.02), ("poke-2", 0.06))}
    record_seeds(run, "x", errors, "runs")
    assert run.found["x.median"][0] == pytest.approx(2.0)
    assert run.found["x.spread"][0] == pytest.approx(6.0)
    assert run.found["x.poke-2"][0] == pytest.approx(6.0)


def test_other_maps_are_judged_by_the_error_with_their_own_gradient(run, monkeypatch):
    monkeypatch.setattr(experiment, "errors_of", lambda run, table, case, options: PositionErrors(
        *3 * [{"map": 0.04, "evolved": 0.01}[options.deformation_gradient]]))
    rows = experiment.compared_rows(run, experiment.MapCase("pod", TESTS, None, None))
    value, rule = run.found["ldm.evolved.pod.ratio"]
    assert (value, rule["comparator"], rule["bound"]) == (0.25, "<=", 1.0)
    assert [one[2:5] for one in rows] == [(origin, "lagrangian_linear", points)
                                          for points in (7, 50) for origin in ("map", "evolved")]
