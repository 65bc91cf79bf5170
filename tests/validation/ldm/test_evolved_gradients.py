"""Errors with evolved deformation gradients are judged by the printed ones, or by the map's."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.study.errors import PositionErrors
from validation.common import targets
from validation.common.verdicts import printed_id
from validation.ldm import evolved_gradients as experiment

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
        *3 * [{"poke": 0.01, "poke-1": 0.02, "poke-2": 0.06}[case.name]]))
    rows = experiment.judged_rows(run, "ldm.table5", TESTS, experiment.POKE_NETS)
    id = "ldm.table5.lagrangian_linear.all.evolved"
    value, rule = run.found[id]
    assert value == pytest.approx(3.0)
    assert "comparator" not in rule
    assert "1, 2, 6" in rule["note"]
    assert printed_id(id, targets.load()) == (id.removesuffix(".evolved"), ("evolved",))
    assert run.found["ldm.table5.lagrangian_nonlinear.50.evolved"][0] == pytest.approx(1.0)
    name = "ldm.evolved.ldm.table5.lagrangian_{}.all.map"
    assert run.found[name.format("linear")][1]["comparator"] == "info"
    assert name.format("nonlinear") not in run.found
    assert len(rows) == (3 + 1 + 1) * 2


def test_other_maps_are_judged_by_the_error_with_their_own_gradient(run, monkeypatch):
    monkeypatch.setattr(experiment, "errors_of", lambda run, table, case, options: PositionErrors(
        *3 * [{"map": 0.04, "evolved": 0.01}[options.deformation_gradient]]))
    rows = experiment.compared_rows(run, experiment.Case("pod", TESTS, None, None))
    value, rule = run.found["ldm.evolved.pod.ratio"]
    assert (value, rule["comparator"], rule["bound"]) == (0.25, "<=", 1.0)
    assert [one[2:5] for one in rows] == [(origin, "lagrangian_linear", points)
                                          for points in (7, 50) for origin in ("map", "evolved")]
