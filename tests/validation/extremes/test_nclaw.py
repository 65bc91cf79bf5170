"""Learned laws at their extremes: the judge of runs, and what is run."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.materials import Fluid, NoFlow
from mpm_ref.materials.learned.strain_range import strain_bounds
from mpm_ref.nclaw.bodies import body_maker, body_with_laws
from mpm_ref.nclaw.strain_watch import StrainReport
from mpm_ref.scene import Mesh, Transformed, build
from validation.common.scenes import with_
from validation.common.weights_needed import Untrained, load_available
from validation.extremes import nclaw_extrapolation as extrapolation
from validation.extremes import nclaw_guard as guards
from validation.extremes import nclaw_runs
from validation.extremes import nclaw_trainings as trainings
from validation.extremes.nclaw_extrapolation import with_time_step
from validation.extremes.nclaw_runs import (
    BAD,
    CHOSEN,
    LOST,
    Law,
    LawEnd,
    LawSetup,
    LawTrial,
    law_end,
    law_trials,
    record_silent,
    summarize_reports,
)
from validation.extremes.verdicts import FINE, FLAGGED, SILENT, STOPPED
from validation.nclaw import strain_bounds as met_of
from validation.nclaw.environments import environment
from validation.nclaw.initial_laws import untrained
from validation.nclaw.small_runs import Measured
from validation.nclaw.small_trainings import Small
from validation.nclaw.stand_in_bodies import STAND_INS
from validation.nclaw.tasks import geometry
from validation.nclaw.trained_laws import LawNet

GOOD = LawEnd(1e-4, 1000, -1, "", 0.1, -1, 0.9, 0.01, "")
WIDE = {"low": [0.0, -9.0, -9.0, -99.0], "high": [9.0, 9.0, 9.0, 99.0]}
NARROW = {"low": [0.9, 0.9, 0.9, 0.8], "high": [1.1, 1.1, 1.1, 1.2]}
DT = 5e-4


def trial(what="what", law="jelly", usual=1e-4, **changes):
    return LawTrial(law, what, usual, GOOD._replace(**changes))


def sight(beyond=0.0, J=1.0, count=0):
    return StrainReport("cube", 0, (1.0, 1.0, 1.0, J), beyond, count, 1000)


def as_true(body):
    return body_with_laws(body, body.law, body.flow)


def wild(body):
    return body_with_laws(body, Fluid(1e15), NoFlow())


def small(**changes):
    """A short run of the small cube."""
    return with_(Small().scene, **{"steps": 40, "every": 20, **changes})


# The four ends.

@pytest.mark.parametrize(("changes", "kind"), [
    ({}, FINE), ({"error": 0.999e-4 * BAD}, FINE), ({"error": 1.001e-4 * BAD}, SILENT),
    ({"error": np.nan}, SILENT), ({"error": np.inf}, SILENT), ({"flags": "strain"}, FLAGGED),
    ({"error": 1.0, "flags": "dt"}, FLAGGED), ({"flags": "strain", "message": "no place"}, STOPPED),
    ({"error": np.inf, "message": "no place"}, STOPPED)])
def test_a_run_ends_in_one_of_four_ways(changes, kind):
    assert trial(**changes).kind == kind


def test_what_is_bad_depends_on_the_usual_error():
    assert trial(error=4e-4).is_bad()
    assert not trial(error=4e-4).is_bad(5.0)
    assert not trial(error=4e-4, usual=1e-3).is_bad()
    assert trial(error=np.nan).is_bad(1e9)


def test_the_extremes_of_a_run_are_kept():
    sights = [sight(), sight(0.4, 0.5, 3), sight(LOST + 1.0, 0.7, 9), sight(0.2)]
    assert summarize_reports(sights, 0.1, "", (20, False)) == LawEnd(
        0.1, 60, 20, "strain", LOST + 1.0, 40, 0.5, 0.0, "")
    assert summarize_reports([sight(), sight(0.2)], 0.1, "", (20, True)) == LawEnd(
        0.1, 20, 0, "dt", 0.2, -1, 1.0, 0.0, "")
    stopped = summarize_reports([sight(), sight(0.4, count=1)], np.inf, "step 31: gone", (20, True))
    assert (stopped.lost, stopped.flags, stopped.message) == (40, "strain dt", "step 31: gone")


def test_misses_and_false_alarms_are_counted_and_named():
    found = [trial(), trial("far", flags="strain"), trial("silent", error=4e-4),
             trial("worse", error=4e-4, flags="strain"), trial("gone", error=np.inf, message="no")]
    records = Records()
    record_silent(records, found, "some")
    value, note = records["trade.nclaw.x.silent"]
    assert value == 1
    assert note == "1 stopped, 2 flagged, 1 fine; jelly, silent: 4 times"
    value, note = records["trade.nclaw.x.misses.3"]
    assert value == pytest.approx(1.0 / 3.0)
    assert note.endswith("; jelly, silent")
    value, note = records["trade.nclaw.x.false_alarms.3"]
    assert value == pytest.approx(0.5)
    assert note.endswith("; jelly, far")
    assert records["trade.nclaw.x.misses.5"][0] == 0.0
    assert records["trade.nclaw.x.false_alarms.5"][0] == pytest.approx(0.5)


# Runs.

def test_the_true_law_is_not_off_from_itself():
    law = Law("true", "jelly", as_true, WIDE, DT)
    end = law_end(law, LawSetup("as trained", small()))
    assert end == LawEnd(0.0, 40, -1, "", 0.0, -1, end.J, 0.0, "")


def test_strains_out_of_bounds_are_flagged_when_they_are():
    law = Law("true", "jelly", as_true, NARROW, DT)
    calm = law_end(law, LawSetup("calm", extrapolation.thrown(small(), 0.0)))
    pressed = law_end(law, LawSetup("pressed", small(steps=60), np.diag([0.8, 1.0, 1.0])))
    assert (calm.flags, pressed.flags, pressed.first) == ("", "strain", 0)
    assert calm.beyond < 0.3 < 0.499 < pressed.beyond       # 0.1 of 0.2 at the start
    assert pressed.error == 0.0         # both bodies are strained


def test_other_time_steps_are_flagged_from_the_start():
    law = Law("true", "jelly", as_true, WIDE, DT)
    end = law_end(law, LawSetup("2 dt", with_time_step(small(), 2.0)))
    assert (end.flags, end.first, end.steps, end.error) == ("dt", 0, 20, 0.0)


def test_a_run_that_breaks_down_stops_with_a_sentence():
    end = law_end(Law("wild", "water", wild, WIDE, DT), LawSetup("any", small(steps=200)))
    assert end.error == np.inf
    assert "step" in end.message
    assert 0 <= end.lost <= 200
    assert LawTrial("wild", "any", 1.0, end).kind == STOPPED


def test_what_is_usual_is_the_first_run_s_error():
    law = Law("none", "jelly", body_maker(untrained()), WIDE, DT)
    setups = [LawSetup("as trained", small(steps=20)), LawSetup("again", small(steps=40))]
    first, second = law_trials(Records(), law, setups)
    assert first.usual == second.usual == first.end.error > 0.0
    assert second.end.error > first.end.error


def test_fluids_start_at_the_volume_of_the_strain():
    one = body_with_laws(build(environment("water")).bodies[0], Fluid(1e5), NoFlow())
    assert one.particles.F.ndim == 1
    nclaw_runs.set_deformation(one, np.diag([0.5, 1.0, 1.0]))
    assert one.particles.F == pytest.approx(0.5)


def test_longer_steps_cover_the_same_time():
    for factor, expected in ((4.0, (2e-3, 250, 5)), (0.25, (1.25e-4, 4000, 80))):
        scene = with_time_step(environment("jelly", every=20), factor)
        assert (scene.dt, scene.steps, scene.every) == expected


def test_bodies_are_thrown_and_made_denser():
    scene = environment("jelly")
    fast, dense = extrapolation.thrown(scene, 2.0), extrapolation.denser(scene, 5.0)
    v, v_fast, v_dense = (build(one).bodies[0].particles.v for one in (scene, fast, dense))
    assert v_fast == pytest.approx(2.0 * v)
    assert np.array_equal(v_dense, v)
    assert build(dense).bodies[0].particles.m.sum() == pytest.approx(625.0)


# Rates.

def test_rates_go_by_the_bound_and_by_the_law():
    found = [trial(beyond=0.35), trial(beyond=0.05), trial(beyond=0.45, error=4e-4),
             trial(beyond=0.15, error=9e-4), trial(law="sand", beyond=9.0)]
    rows = {row[:3]: row[3:] for row in extrapolation.rates(found)}
    assert rows["chosen", 3.0, 0.3] == (2, 1, 2, 1)
    assert rows["chosen", 3.0, 0.0] == (2, 0, 2, 2)
    assert rows["chosen", 3.0, 1.0] == (2, 2, 2, 0)
    assert rows["chosen", 5.0, 0.3] == (1, 1, 3, 2)
    assert rows["other", 3.0, 1.0] == (0, 0, 1, 1)
    assert "sand" not in CHOSEN


def test_the_worst_and_the_farthest_good_run_are_named():
    records = Records()
    extrapolation.record_farthest(records, [trial(), trial("far", beyond=0.9),
                                           trial("bad", beyond=2.0, error=9e-4)])
    assert records["trade.nclaw.x.jelly.worst"] == (
        pytest.approx(9.0), "largest error over the usual one, 0.0001 m^2: bad")
    value, note = records["trade.nclaw.x.jelly.farthest"]
    assert (value, note.split(": ")[-1]) == (0.9, "far")


# Weights that are there, and what they have met.

def test_what_is_not_trained_is_told():
    def load(name):
        if name == "b":
            raise Untrained("no weights b.npz: train b")
        return name.upper()

    records = Records()
    assert load_available(records, ["a", "b", "c"], load) == {"a": "A", "c": "C"}
    assert records["trade.nclaw.x.untrained"] == (1, "no weights b.npz: train b")
    assert load_available(Records(), ["a"], load) == {"a": "A"}


def test_bounds_are_those_that_weights_say(monkeypatch):
    monkeypatch.setattr(met_of, "trained", lambda name: SimpleNamespace(about={"seen": NARROW}))
    assert met_of.visited_bounds.__wrapped__("jelly") is NARROW


def test_bounds_that_weights_do_not_say_are_made(monkeypatch):
    short = SimpleNamespace(x=np.zeros((6, 1)), F=np.eye(3)[None, None] * np.ones((6, 1, 1, 1)))
    made = []
    monkeypatch.setattr(met_of, "trained", lambda name: SimpleNamespace(about={}))
    monkeypatch.setattr(met_of, "body_maker", lambda laws: laws)
    monkeypatch.setattr(met_of, "trajectory", lambda name: short)
    monkeypatch.setattr(met_of, "training_bounds",
                        lambda *of: made.append(of[3]) or strain_bounds(of[1].F))
    monkeypatch.setattr(met_of, "nets", lambda: {"jelly": LawNet("jelly"),
                                                 "labels": LawNet("jelly", method="labeled")})
    assert met_of.visited_bounds.__wrapped__("jelly") == strain_bounds(short.F)
    met_of.visited_bounds.__wrapped__("labels")
    assert made == [[0, 5], ()]         # the last horizon is longer than the run


# Long runs.

def test_long_runs_are_looked_at_beside_the_true_one():
    law = Law("true", "jelly", as_true, NARROW, DT)
    rows, said = extrapolation.compare_long_run(law, small(steps=60))
    assert ([row.step for row in rows], said) == ([0, 20, 40, 60], "")
    for row in rows:
        assert (row.error, row.kinetic, row.volume, row.height) == (
            0.0, row.true_kinetic, row.true_volume, row.true_height)
    assert rows[0].kinetic > 0.5 * 125.0 * 7.25         # of the flight alone
    assert rows[0].height == pytest.approx(0.5)
    assert rows[-1].height < rows[0].height
    broken, said = extrapolation.compare_long_run(Law("wild", "jelly", wild, NARROW, DT),
                                                  small(steps=400))
    assert len(broken) < 21
    assert "step" in said


def test_drift_is_that_of_the_last_fifth():
    rows = [extrapolation.LongRunRow(k, float(k), 2.0 * k, k, 1.0, 1.0, 0.5, 0.4, 0.1)
            for k in range(10)]
    records = Records()
    extrapolation.record_drift(records, SimpleNamespace(name="jelly"), rows, "")
    assert records["extremes.nclaw.long.jelly.steps"][0] == 9
    value, note = records["extremes.nclaw.long.jelly.error"]
    assert value == 4.5
    assert "of the last fifth 8.5 m^2" in note
    assert records["extremes.nclaw.long.jelly.kinetic"] == (
        17.0, "mean of the last fifth; the true one's 8.5")


# Unfinished trainings, and faults of what is seen.

def test_epochs_are_compared_with_the_last_one(monkeypatch):
    def shown(run, law, setups):
        error = {"jelly after 10": 5e-4, "jelly after 100": 1e-4}[law.name]
        return [trial("as trained", law.name, error, error=error, lost=120, first=60),
                trial("thrown", law.name, error, error=error)]

    monkeypatch.setattr(trainings, "law_trials", shown)
    kept = {k: untrained()._replace(about={"seen": WIDE, "dt": DT}) for k in (10, 100)}
    records = Records()
    found = trainings.training_trials(records, Small(), kept)
    assert [t.usual for t in found] == [1e-4] * 4
    assert [t.law for t in found] == ["jelly after 100"] * 2 + ["jelly after 10"] * 2
    value, note = records["extremes.nclaw.epochs.jelly.10"]
    assert value == 5e-4
    assert note == ("1 of 2 runs lost, 1 of them flagged before; as trained: lost in step 120")


def test_epochs_are_run_at_the_training_s_size():
    setups = trainings.training_setups(Records(), Small())
    assert len(setups) == 5
    assert {setup.scene.body[0].sampling.counts[0] for setup in setups} == {6}
    assert {setup.scene.steps * setup.scene.dt for setup in setups} == {0.5}


def test_faults_stand_beside_the_seeds(monkeypatch):
    rows = [Measured(name, 100, 60.0, own, 2e-4, np.nan, -1) for name, own in
            (("small", 1e-4), ("small-seed-1", 3e-4), ("small-density-2", 9e-4))]
    monkeypatch.setattr(trainings, "measured", lambda *_, **__: rows)
    records = Records()
    trainings.observed(records)
    value, note = records["extremes.nclaw.observed.small-density-2"]
    assert value == 9e-4
    assert "without faults 0.0001 to 0.0003 m^2" in note
    columns, table = records["trainings"]
    assert dict(zip(columns, table[2], strict=True))["density"] == 2.0


# The guard.

def guarded_trial(what, unguarded=GOOD, guarded=GOOD):
    return guards.GuardedTrial("water", what, unguarded, guarded)


def test_runs_that_break_down_with_and_without_the_guard_are_counted():
    stopped = GOOD._replace(error=np.inf, message="lost")
    records = Records()
    guards.record_guard(records, [
        guarded_trial("as trained"), guarded_trial("thrown", stopped),
        guarded_trial("stretched", stopped, GOOD._replace(error=3e-4)),
        guarded_trial("pressed", stopped, stopped),
        guarded_trial("turned", GOOD, GOOD._replace(error=2.0 * GOOD.error))])
    values = {id: value for id, (value, _) in records.items()}
    assert values == {"extremes.nclaw.guard.broken": 1, "extremes.nclaw.guard.harm": 2.0}
    assert "finish 2; water, pressed" in records["extremes.nclaw.guard.broken"][1]


def test_a_run_that_stops_is_bad_whatever_is_usual():
    assert trial(error=np.inf, usual=np.inf, message="lost").is_bad()


def test_laws_with_a_large_error_on_their_own_run_are_flagged():
    assert nclaw_runs.flagged_as_poor(GOOD).flags == "poor"
    assert nclaw_runs.flagged_as_poor(GOOD._replace(flags="dt", first=3))[2:4] == (0, "dt poor")


def test_the_guarded_body_is_the_stand_in_also_where_the_mesh_is_there(monkeypatch):
    there = geometry("water")
    mesh = with_(there, body=(with_(there.body[0], shape=Mesh(file="spot.obj", size=0.8)),))
    monkeypatch.setattr(guards, "geometry", lambda name: mesh)
    scene = guards.stand_in_scene("water")
    assert scene.body[0].shape == Transformed(
        shape=STAND_INS["spot"], scale=0.8, about=(0.0, 0.0, 0.0), translate=(0.5, 0.5, 0.5))
    assert with_(scene, body=mesh.body) == mesh
