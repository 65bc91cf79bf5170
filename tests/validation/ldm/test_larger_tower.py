"""The tower of 12.6 million points: its scene, and what its record judges."""

from types import SimpleNamespace

import pytest

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.scene import build
from validation.common import targets
from validation.ldm import larger_tower
from validation.ldm.studies import TOWER
from validation.ldm.timing import Race, StepTime, TimedRun


def test_the_larger_tower_has_more_points_and_moves_as_long():
    """A coarse one has the same volume, and as many points as its grid gives."""
    usual = TOWER.scene(*TOWER.mu[TOWER.test[0]])
    scene = larger_tower.larger(usual, 2.88)
    points, few = build(scene).bodies[0].particles, build(usual).bodies[0].particles
    assert points.V0.sum() == pytest.approx(few.V0.sum(), rel=0.05)
    assert points.V0[0] == pytest.approx((2.88 / 3) ** 3, rel=0.01)
    assert scene.steps * scene.dt == pytest.approx(usual.steps * usual.dt)
    assert 1.25e7 < few.V0.sum() / (larger_tower.DX / larger_tower.PER_AXIS) ** 3 < 1.28e7
    assert larger_tower.larger(usual).dx == larger_tower.DX


def test_cheap_options_are_judged_by_the_printed_speed_up_and_the_papers_are_not(monkeypatch):
    """A step of the full model takes 4 s with the transfer of the training, and 2 s at best."""
    def race(scene, mapping, options, steps):
        errors = PositionErrors(0.001, 0.01, 0.1)
        return Race(StepTime(4.0, 8.0), StepTime(2.0, 4.0),
                    [TimedRun(own, StepTime(wall, 0.2), 900, errors)
                     for own, wall in zip(options, (0.2, 0.04, 0.02), strict=True)])

    scene = larger_tower.larger(TOWER.scene(0.7, 0.3, -0.8), 2.88)
    monkeypatch.setattr(larger_tower, "race", race)
    monkeypatch.setattr(larger_tower, "larger", lambda usual: scene)
    monkeypatch.setattr(larger_tower, "trained", lambda name: SimpleNamespace(field=0, rest=0))
    values, rules, tables = {}, {}, {}

    def record(name, value, **words):
        values[name], rules[name] = value, (words["comparator"], words.get("bound"))

    larger_tower.larger_tower(SimpleNamespace(
        record=record, table=lambda name, columns, rows: tables.update({name: rows})))
    name, printed = "ldm.fig16-larger.eulerian-linear", targets.load()["ldm.fig16.speedup"].value
    assert printed == 20.0
    cheap = f"{name}-10-transported-0.01-single.speed_up"
    assert values[cheap] == pytest.approx(100.0)
    assert rules[cheap] == (">=", printed)
    assert rules[f"{name}-25-transported-0.01-single.speed_up"] == (">=", printed)
    assert values[f"{name}-25.speed_up"] == pytest.approx(10.0)
    assert rules[f"{name}-25.speed_up"] == ("info", None)
    assert [row[-2] for row in tables["ways"]] == pytest.approx([10.0, 50.0, 100.0])
    assert [row[-1] for row in tables["ways"]] == pytest.approx([20.0, 100.0, 200.0])
