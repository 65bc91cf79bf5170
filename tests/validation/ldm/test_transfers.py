"""Reduced runs by the full model's own transfer, and of bodies that start moving."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ldm_start
from validation.ldm import transfers


def test_a_moving_start_has_the_rates_that_fit_its_velocities():
    full, map = ldm_full_model(transfers.kicked(0.5)), Affine(3)
    start = ldm_start(full, map, map.rest)
    np.testing.assert_allclose(map.place(full.X, start.xhat), full.X, atol=1e-12)
    np.testing.assert_allclose(map.velocity(full.X, start.xhat, start.vhat), full.v, atol=1e-12)
    np.testing.assert_array_equal(full.v, np.tile([0.0, 0.0, -0.5], (len(full.X), 1)))


@pytest.mark.parametrize("start", transfers.STARTS)
def test_a_full_model_is_followed_best_by_its_own_transfer(start, monkeypatch):
    monkeypatch.setattr(transfers, "RUNS", 4)
    monkeypatch.setattr(transfers, "TESTS", 1)
    monkeypatch.setattr(transfers, "R", 3)
    found = {}
    run = SimpleNamespace(record=lambda name, value, **rest: found.update({name: value}))
    rows = transfers.record_case(run, start, "mls")
    id = f"ldm.transfers.{start}.mls"
    assert [row[:3] for row in rows] == [(start, "mls", word) for word in ("own", "nearest", "pic")]
    assert found[f"{id}.gain"] == pytest.approx(found[f"{id}.own"] / found[f"{id}.pic"])
    assert found[f"{id}.gain"] < 0.5
    assert found[f"{id}.nearest"] < found[f"{id}.own"]


def test_pic_has_its_own_transfer_alone(monkeypatch):
    monkeypatch.setattr(transfers, "RUNS", 4)
    monkeypatch.setattr(transfers, "TESTS", 1)
    found = {}
    run = SimpleNamespace(record=lambda name, value, **rest: found.update({name: value}))
    transfers.record_case(run, "gravity", "pic")
    assert {*found} == {"ldm.transfers.gravity.pic.own", "ldm.transfers.gravity.pic.nearest"}
