import pytest

from mpm_ref.needs.variant import first_variant
from mpm_ref.scene import build
from validation.trade import needs
from validation.trade.advice_scenes import advice_scenes
from validation.trade.needs import Lean, record_lean, with_idle_parts

SCENES = {one.name: one.scene for one in advice_scenes()}


@pytest.mark.parametrize("name", needs.JUDGED)
def test_parts_that_are_judged_can_be_removed(name):
    scene = with_idle_parts(SCENES[name])
    offers = first_variant(scene, ()).offers
    assert {needs.VITAL[name], *needs.IDLE} <= set(offers)
    assert len(build(scene).bodies) == len(SCENES[name].body) + 1


class Records:
    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, target, value, note="", **_):
        self.values[target], self.notes[target] = value, note


def test_records_count_what_is_wrong():
    good = Lean("a", 0.005, 0.006, 2.0, 1.0, "required", "not required, not required", 4, 2)
    rows = [good, good._replace(scene="b", again=0.02), good._replace(vital="not required"),
            good._replace(idle="not required, required", lean_cpu=4.0),
            good._replace(scene="c", again=float("nan")), good._replace(scene=needs.SOLID, dim=3)]
    records = Records()
    record_lean(records, rows)
    assert records.values == {"trade.needs.kept": pytest.approx(4 / 6), "trade.needs.cost": 0.5,
                              "trade.needs.vital": 1, "trade.needs.idle": 1,
                              "trade.needs.section": 3}
    assert "b 0.02, c nan" in records.notes["trade.needs.kept"]
