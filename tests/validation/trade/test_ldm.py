"""What choices of reduced runs cost: the clock, the counts, and the settings compared."""

from time import process_time
from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions
from validation.common.scenes import with_
from validation.ldm.networks import trained
from validation.ldm.references import references
from validation.ldm.studies import GRAVITY
from validation.ldm.timing import StepTime, TimedRun
from validation.trade import ldm
from validation.trade.ldm_cost import (
    EVALUATIONS,
    PARTS,
    PartTimer,
    TimedCalls,
    evaluation_costs,
    record_parts,
    runs_to_pay,
    split_step,
)

EXACT = Affine(3), Affine(3).rest


@pytest.fixture(scope="module")
def one():
    """The cylinder, a few steps."""
    return ldm_full_model(with_(GRAVITY.scene(5.0), steps=4))


def busy(seconds):
    """Use the processor."""
    end = process_time() + seconds
    while process_time() < end:
        pass


def test_a_part_inside_another_counts_for_itself():
    clock = PartTimer()
    inner = clock.part("inner", lambda: busy(0.05))

    def work():
        busy(0.02)
        inner()

    begin = process_time()
    clock.part("outer", work)()
    busy(0.03)
    clock.turn()
    assert clock.spent["inner"] == pytest.approx(0.05, abs=0.015)
    assert clock.spent["outer"] == pytest.approx(0.02, abs=0.015)
    assert clock.spent["rest"] == pytest.approx(0.03, abs=0.015)
    assert sum(clock.spent.values()) <= process_time() - begin


def test_a_part_that_raises_is_left():
    clock = PartTimer()
    with pytest.raises(ZeroDivisionError):
        clock.part("broken", lambda: 1 / 0)()
    assert clock.inside == ["rest"]


def test_what_is_watched_is_the_same_but_for_the_named_methods():
    said = []
    watched = TimedCalls([3, 1], ("sort",),
                         lambda name, method: lambda: said.append(name) or method())
    watched.sort()
    watched.append(5)
    assert watched.target == [1, 3, 5]
    assert said == ["sort"]


def test_a_step_asks_the_map_as_often_as_its_way_says(one):
    """All points, Lagrangian: the samples are the points, and each quantity is asked for once."""
    n = len(one.X)
    for velocity, derivatives, place, speeds in (("previous", 1, 0, 1), ("latest", 1, 0, 0),
                                                 ("difference", 1, 1, 0), ("transported", 2, 0, 1)):
        spent, asked, points = split_step(one, EXACT, RunOptions(velocity=velocity), 3)
        assert points == n
        expected = dict(zip(EVALUATIONS, (derivatives * n, place * n, speeds * n), strict=True))
        assert asked == pytest.approx(expected, abs=0.0)
        assert set(spent) == set(PARTS)
        assert all(a >= 0.0 for a in spent.values())


def test_near_preimages_ask_less(one):
    model = trained("gravity-r4")
    way = RunOptions("eulerian", points=20, velocity="latest")
    paper, cheap = (split_step(one, (model.field, model.rest),
                               way._replace(preimage_tolerance=close), 2) for close in (1e-9, 1e-2))
    assert cheap[2] == paper[2]
    assert cheap[1]["derivatives"] < 0.7 * paper[1]["derivatives"]


def test_parts_of_a_step_are_recorded_in_the_precision_of_its_options(one):
    found, model = {}, trained("gravity-r4")
    run = SimpleNamespace(record=lambda name, value, **rest: found.update({name: value}))
    options = RunOptions("eulerian", points=20, preimage_tolerance=1e-2, precision="single")
    row = record_parts(run, "split.34.cheap", one, (model.field, model.rest), options)
    assert found["split.34.cheap.us_per_point"] == pytest.approx(1e6 * row[3] / row[2])
    assert row[:2] == (len(one.X), "cheap")


def test_each_evaluation_has_a_cost(one):
    found = evaluation_costs(one, *EXACT)
    assert set(found) == set(EVALUATIONS)
    assert 0.0 < min(found.values()) < 1e-3


def test_choices_differ_from_the_base_in_one_thing():
    ways = ldm.single_choices()
    assert len(set(ways)) == len(ways)
    for way in ways:
        other = [name for name in RunOptions._fields
                 if getattr(way, name) != getattr(ldm.BASE, name)]
        if set(other) != {"velocity", "preimage_tolerance", "precision"} | set(other) & {"points"}:
            assert len(other) <= 1 or set(other) == {"preimage_tolerance", "precision"}


def test_longer_steps_meet_the_same_answer_at_their_times():
    tests = references(GRAVITY, 1)
    longer = ldm.with_longer_steps(tests, 3)
    (before,), (after,) = tests.cases, longer.cases
    assert after.problem.clock.dt == 3 * before.problem.clock.dt
    assert after.problem.clock.steps == before.problem.clock.steps // 3
    assert np.array_equal(after.problem.gravity, before.problem.gravity)
    assert np.array_equal(longer.x[0], tests.x[0][::3])
    assert len(longer.x[0]) == after.problem.clock.steps + 1
    errors, seconds = ldm.ReducedSetting("network", 4, 20, 3).measured(tests)
    assert 0.0 < errors.origin < 0.05
    assert seconds > 0.0


def test_what_saves_nothing_is_never_paid():
    assert runs_to_pay(2.0, 30.0) == 15.0
    assert runs_to_pay(0.0, 30.0) == runs_to_pay(-1.0, 30.0) == np.inf


def test_a_run_costs_as_many_steps_as_it_has(monkeypatch):
    tests = references(GRAVITY, 1)
    one = TimedRun(RunOptions(), StepTime(9.0, 0.5), 0, None)
    monkeypatch.setattr(ldm, "time_alone", lambda *_: one)
    assert ldm.run_cpu(tests, EXACT, RunOptions()) == 0.5 * tests.cases[0].problem.clock.steps


def test_a_run_by_itself_has_the_errors_that_it_has_among_others():
    tests, model = references(GRAVITY, 1), trained("gravity-r4")
    at, way = (model.field, model.rest), RunOptions(points=20)
    found = ldm.time_alone(tests.cases[0], at, way, tests.x[0])
    assert tuple(found.errors) == pytest.approx(tuple(tests.run_errors(*at, way)), rel=1e-12)
