"""How few points a reduced run must be left with to pay: counts and shares, on made-up times."""

import numpy as np
import pytest

from mpm_ref.rom.study.full_model import nsf_full_model
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import breakeven
from validation.nsf.breakeven import PointCost, kinds
from validation.nsf.studies import jelly

SMALL = breakeven.PrintedScene(jelly, (5, 7, 11), 0.25)


def test_a_reduced_step_on_the_even_share_takes_as_long():
    cost = PointCost(particle=3.0, grid=1.0, fields=5.0)
    share = cost.share(1.0)
    assert share * (cost.grid + cost.fields) == cost.particle
    assert cost.speedup(share) == 1.0
    assert cost.speedup(cost.share(10.0)) == pytest.approx(10.0)
    assert cost.speedup(0.1) == pytest.approx(5.0)


@pytest.fixture(scope="module")
def own():
    """The jelly cube with few points."""
    return nsf_full_model(jelly(4).run(0.4))


def test_products_are_counted_by_layer(own):
    found = {word: (products, fields) for word, products, fields
             in kinds(own, SMALL, np.random.default_rng(0))}
    by_hand = [9 * w + 4 * w * w + w * k for w, k in zip(SMALL.widths, (3, 6, 9), strict=True)]
    assert found["printed"][0] == 2 * by_hand[0] + by_hand[1] + by_hand[2]
    assert found["modes"][0] == found["modes-single"][0] == 720
    assert [*found] == ["printed", *(f"networks-{w}" for w in breakeven.SWEEP), "modes",
                        "modes-single"]


def test_fields_answer_all_that_a_step_asks(own):
    points, xhat = np.array([0, 3, 7]), np.full(6, 0.1)
    for _, _, fields in kinds(own, SMALL, np.random.default_rng(0)):
        shapes = [getattr(fields, name)(points, xhat).shape
                  for name in ("place", "stress", "affine")]
        assert shapes == [(3, 3), (3, 3, 3), (3, 3, 3)]
        assert all(np.isfinite(getattr(fields, name)(points, xhat)).all()
                   for name in ("place", "stress", "affine"))


def test_records_follow_from_times(tmp_path, monkeypatch):
    """One second a point, 2 a particle, of which half is not on the grid."""
    n = len(nsf_full_model(jelly(3).run(0.4)).X)
    monkeypatch.setattr(breakeven, "SCENES", {"jelly": SMALL})
    monkeypatch.setattr(breakeven, "seconds_of_a_point", lambda fields, points: 1.0)
    monkeypatch.setattr(breakeven, "passes", lambda fields, points: (2.0, 6.0))
    monkeypatch.setattr(breakeven, "full_steps", lambda study, steps: (2.0 * n, 1.0 * n))
    assert not run_all([breakeven.breakeven.experiment], RunSetting("quick", tmp_path))
    results = ProfileResults(tmp_path)
    found = {r.target: r.value for r in results.records("nsf.breakeven")}
    for word in ("printed", "networks-64", "modes"):
        assert found[f"nsf.breakeven.jelly.{word}.even"] == pytest.approx(100.0)
        assert found[f"nsf.breakeven.jelly.{word}.ten"] == pytest.approx(10.0)
        assert found[f"nsf.breakeven.jelly.{word}.speedup"] == pytest.approx(4.0)
    nets = ["printed", *(f"networks-{width}" for width in breakeven.SWEEP)]
    assert results.table("nsf.breakeven", "twins")["fields"].tolist() == nets
    assert {found[f"nsf.breakeven.jelly.{word}.twin"] for word in nets} == {3.0}
    table = results.table("nsf.breakeven", "shares")
    assert len(table["fields"]) == 7
    assert table["bound"] == pytest.approx(table["products"] / found["nsf.breakeven.rate"])


def test_both_passes_are_of_the_same_points(own, monkeypatch):
    """Each is clocked by itself, on what the other has too."""
    fields = next(fields for _, _, fields in kinds(own, SMALL, np.random.default_rng(0)))
    made, layers = [], []
    for name in ("derivatives", "stress", "affine"):
        monkeypatch.setattr(type(fields), name,
                            lambda self, points, xhat, name=name: layers.append((name, *points)))
    monkeypatch.setattr(breakeven, "seconds", lambda work: made.append(work()) or 12.0)
    asked = []
    monkeypatch.setattr(breakeven, "infer", lambda *given: asked.append(given))
    assert breakeven.passes(fields, np.array([0, 3, 7])) == (4.0, 4.0)
    assert layers == [(name, 0, 3, 7) for name in ("derivatives", "stress", "affine")]
    (g, h, l, X, xhat), = asked
    assert (g, h, l) == (fields.g, fields.h, fields.l)
    assert np.array_equal(X, fields.X[[0, 3, 7]])
    assert np.array_equal(xhat, breakeven.latent(fields))


def test_seconds_are_a_median_and_the_first_call_is_not_counted(monkeypatch):
    ticks = iter(np.cumsum([0.0, 100.0, 1.0, 1.0, 1.0, 5.0, 1.0, 2.0, 1.0, 3.0, 1.0, 4.0]))
    monkeypatch.setattr(breakeven, "perf_counter", lambda: next(ticks))
    assert breakeven.seconds(lambda: None) == 3.0
