"""Runs of the implicit step's verification: histories, and solves that did not converge."""

import numpy as np
import pytest

from validation.verification import implicit as module
from validation.verification.implicit import (
    EPS,
    EnergyHistory,
    energy_history,
    implicit,
    record_minimisers,
    rise,
)


class Records(dict):
    """What an experiment records: {target: (value, note)}."""

    def record(self, target, value, **given):
        self[target] = value, given["note"]


def test_every_method_solves_to_the_same_tolerance():
    for method in module.METHODS:
        options = implicit(method).options
        assert (options.method, options.eps, options.norm) == (method, EPS, "characteristic")


def test_history_says_which_solves_did_not_converge():
    assert energy_history(implicit("pn-pcg"), 1).missed == []
    missed = energy_history(implicit("pn-pcg", max_iterations=1), 2).missed
    assert len(missed) == 2
    assert "the cap" in missed[0]


def test_rise_is_the_largest_of_a_step():
    history = EnergyHistory(np.zeros((1, 2)), np.array([4.0, 2.0, 3.0, 1.0]), [])
    assert rise(history) == 0.25
    assert rise(history._replace(energies=np.array([4.0, 3.0, 1.0]))) == -0.25


def test_methods_that_end_at_other_states_or_miss_are_recorded(monkeypatch):
    offsets = {"pn-pcg": 0.0, "hot": 0.0, "admm": 0.5}
    monkeypatch.setattr(module, "METHODS", offsets)
    monkeypatch.setattr(module, "implicit", lambda method: method)
    history = EnergyHistory(np.zeros((3, 2)), np.ones(2), [])
    monkeypatch.setattr(module, "energy_history", lambda method, steps: history._replace(
        x=offsets[method] * module.DX * np.eye(3, 2), missed=["capped"] if offsets[method] else []))
    records = Records()
    record_minimisers(records, 1, {"pn-pcg": history})
    assert records["verification.implicit.hot"][0] == 0.0
    assert records["verification.implicit.admm"][0] == pytest.approx(0.5)
    value, note = records["verification.implicit.missed"]
    assert value == 1
    assert "admm: capped" in note
    assert "verification.implicit.pn-pcg" not in records
