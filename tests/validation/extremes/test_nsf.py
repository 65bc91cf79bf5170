"""NSF's reduced runs at their extremes, on a small study of the jelly cube."""

from types import SimpleNamespace

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.step import StepReport
from mpm_ref.rom.study.monitor import StateCheck
from mpm_ref.rom.study.run import RunState
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.extremes import nsf_damage as damage
from validation.extremes import nsf_extrapolation as extrapolation
from validation.extremes import nsf_runs as runs
from validation.extremes import nsf_samples as samples
from validation.extremes.ldm_runs import BAD, TOLERABLE, ReducedTrial
from validation.extremes.verdicts import FINE, FLAGGED, SILENT, STOPPED
from validation.nsf import reduced_runs
from validation.nsf.studies import jelly

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.4,), samples=40,
                          sizes=Sizes(r=5, modes=8, tau=12, C=12, smoothing=1e-4))
GOOD = runs.FieldEnd(2.0, 0.2, 15.0, 30, -1, "", 0.4, 5, 0.2, 0.01, "")


@pytest.fixture(scope="module")
def bench():
    """The small study."""
    return runs.FieldBench("jelly", reduced_runs.fit_study(STUDY))


def trial(end=GOOD, what="0.4", points=40, **changes):
    return ReducedTrial("jelly", what, "inferred", points, 2.0, end._replace(**changes))


# Ends.

def test_errors_and_ends_are_those_of_the_runs_themselves(bench):
    value, count = STUDY.test[0], STUDY.samples
    found, (end,) = bench.tested.errors(value, count), bench.tests
    assert end.error == pytest.approx(100.0 * found.errors.displacement, rel=1e-5)
    assert end.origin == pytest.approx(100.0 * found.errors.origin, rel=1e-5)
    assert end.stress == pytest.approx(100.0 * found.stress, rel=1e-5)
    assert (end.steps, end.first, end.flags, end.message) == (30, -1, "", "")
    assert trial(end)._replace(usual=bench.usual).kind == FINE
    assert bench.usual == end.error
    assert 0.0 < end.beyond < 1.0
    assert 0.0 < end.departure < 1.0


@pytest.mark.parametrize(("changes", "kind"), [
    ({}, FINE), ({"error": 1.01 * BAD * 2.0}, SILENT), ({"error": np.nan}, SILENT),
    ({"error": 90.0, "flags": "beyond"}, FLAGGED),
    ({"error": np.inf, "flags": "beyond", "message": "no body"}, STOPPED)])
def test_the_four_ends_are_those_of_ldm(changes, kind):
    assert trial(**changes).kind == kind


def test_the_extremes_of_a_run_are_kept():
    sights = [StateCheck(0.1, 0), StateCheck(3.0, 0), StateCheck(0.2, 2)]
    sights[1] = sights[1]._replace(departure=0.4)
    assert runs.summarize_checks(sights, 5) == (2, 1, "beyond blind", 3.0, 3, 0.4)
    steps, first, flags, beyond, rank, departure = runs.summarize_checks([], 5)
    assert (steps, first, flags, rank) == (-1, -1, "", 5)
    assert np.isnan([beyond, departure]).all()


def test_a_full_order_run_that_stops_says_so(bench):
    found, said = runs.simulate_test(STUDY, 0.45)
    assert (found.x.shape[1], said) == (31, "")
    assert runs.simulate_test(STUDY, 50.0)[0] is None
    assert "unstable" in runs.simulate_test(STUDY, 50.0)[1]


def test_a_body_that_hardly_moves_departs_from_those_that_fly(bench):
    """A state at rest is one of the training, at the start; a run that stays there is not."""
    still = bench.tested.study.samples
    fields = bench.tested.fields_of_run(STUDY.test[0])
    rest = start_state(bench.tested.rest)
    report = StepReport(still, 9, fields.r, 0.0, 1, True, {})
    samples = bench.drawn(still)
    last, plain = None, bench.monitor._replace(paths=None)
    for k in range(1, 30):
        state = RunState(float(k), rest.advance(rest.xhat), report, samples)
        assert plain.check(state).out_of_bounds == ()
        last = bench.monitor.check(state, last)
    assert last.out_of_bounds == ("departure",)
    assert "above 0.8" in last.message


# Parameters outside.

def test_rates_are_of_good_and_of_bad_runs():
    found = [trial(), trial(beyond=2.0), trial(error=50.0, beyond=0.7),
             trial(error=50.0, beyond=4.0), trial(error=np.inf, beyond=0.1, message="no body")]
    assert extrapolation.rates(found, (0.3, 1.0, 3.0, 5.0)) == [
        (0.3, 1.0, 0.0, 2, 3), (1.0, 0.5, 1 / 3, 2, 3), (3.0, 0.0, 1 / 3, 2, 3),
        (5.0, 0.0, 2 / 3, 2, 3)]


def test_small_errors_are_not_bad_however_good_the_tests_are():
    small = trial()._replace(usual=0.01)
    assert small.is_bad
    assert not small._replace(end=GOOD._replace(error=0.99 * TOLERABLE)).is_bad


def test_false_alarms_are_of_the_good_runs():
    found = Records()
    extrapolation.record_false_alarms(found, [trial(), trial(flags="beyond"),
                                       trial(error=90.0, flags="beyond")])
    assert found["extremes.nsf.beyond.false_alarms"][0] == 0.5


def test_runs_inside_and_outside_are_told_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "studies", lambda run: {"jelly": STUDY})
    monkeypatch.setattr(extrapolation, "OUTSIDE", {"jelly": {"quick": (1.0, 50.0)}})
    monkeypatch.setattr(extrapolation, "INSIDE", {"jelly": (0.35,)})
    assert not run_all([extrapolation.parameter_range.experiment], RunSetting("quick", tmp_path))
    results, id = ProfileResults(tmp_path), "extremes.nsf.beyond"
    table = results.table(id, "runs")
    assert table["what"].tolist() == [0.4, 0.35, 1.0]
    assert table["beyond"].argmax() == 2
    assert table["error"][2] > 2.0 * table["error"][:2].max()
    note = {r.target: r.note for r in results.records(id)}[f"{id}.silent"]
    assert "full-order runs that stopped: jelly 50" in note


# Samples.

def test_clustered_samples_are_those_nearest_to_the_corner():
    X = np.array([[0.0, 0.0], [1.0, 1.0], [0.1, 0.0], [0.9, 1.0], [0.5, 0.5]])
    places = samples.corners(X)
    assert samples.clustered(X, places["upper"], 2).points.tolist() == [1, 3]
    assert samples.clustered(X, places["lower"], 2).points.tolist() == [0, 2]


def test_fewer_equations_than_coordinates_are_told(bench):
    found = [bench.trial("draw 0", bench.drawn(count)) for count in (1, 2)]
    assert [t.end.rank for t in found] == [3, 5]
    assert [("blind" in t.end.flags, t.points) for t in found] == [(True, 1), (False, 2)]
    records = Records()
    samples.record_short(records, [found[0], trial(points=1)])
    assert records["extremes.nsf.samples.short"][0] == 0.5


def test_samples_in_a_corner_are_worse_than_any(bench):
    X = bench.tested.fields.X
    corner = bench.trial("corner", samples.clustered(X, X.max(axis=0), 10))
    assert corner.end.error > 2.0 * bench.trial("draw 0", bench.drawn(10)).end.error


# Damage.

@pytest.mark.parametrize(("kind", "value"), [
    ("huge", 1e30), ("zero", 0.0), ("highest bit of the fraction", 1.5),
    ("lowest bit of the exponent", 0.5), ("highest bit of the exponent", np.inf), ("sign", -1.0),
    ("lowest bit", 1.0 + 2.0**-52)])
def test_numbers_are_damaged_as_said(kind, value):
    assert damage.damage_number(1.0, kind) == value


@pytest.mark.parametrize("path", damage.ARRAYS)
def test_one_number_of_one_array_is_damaged(bench, path):
    def arrays(fields):
        found = {name: getattr(fields, name) for name in ("U", "X")}
        found |= {"bend.w": fields.bend.w}
        for name in ("tau", "C"):
            part = getattr(fields, name)
            found |= {f"{name}.modes": part.modes, f"{name}.coefficients.w": part.coefficients.w,
                      f"{name}.coefficients.centers": part.coefficients.centers}
        return found

    fields = bench.tested.fields
    changed = damage.damage_array(fields, path, 0.5, "NaN")
    sizes = {name: int(np.sum(a != arrays(fields)[name])) for name, a in arrays(changed).items()}
    assert sizes == dict.fromkeys(sizes, 0) | {path: 1}
    assert np.isnan(arrays(changed)[path].flat[arrays(fields)[path].size // 2])


def test_damage_is_stopped_harmless_or_wrong(bench):
    def ended(path, kind):
        fields = damage.damage_array(bench.tested.fields, path, 0.5, kind)
        return bench.trial(path, bench.drawn(40), fields)

    assert ended("bend.w", "NaN").kind == STOPPED
    assert not np.isfinite(ended("bend.w", "NaN").end.error)
    assert ended("tau.modes", "lowest bit").end.error == pytest.approx(bench.usual, rel=1e-6)
    assert ended("tau.coefficients.w", "huge").kind in (STOPPED, FLAGGED)


def test_any_damage_is_stopped_by_the_seal_and_sound_fields_are_not(bench):
    """The lowest bit of a mode changes no error, and is found all the same."""
    for path in damage.ARRAYS:
        if not path.startswith("bend"):
            fields = damage.damage_array(bench.tested.fields, path, 0.5, "lowest bit")
            found = damage.sealed_trial(bench, trial(), fields)
            assert found.kind == STOPPED
            assert found.end.message == f"changed in memory: {path}"
    assert damage.sealed_trial(bench, trial()).kind == FINE
    assert damage.sealed_trial(bench, trial(error=90.0)).kind == SILENT


def test_files_of_fields_are_refused_where_damaged(bench):
    found = Records()
    run = SimpleNamespace(rng=np.random.default_rng(0), choose=lambda **by: 1,
                          record=found.record)
    tested = reduced_runs.refit(bench.tested, STUDY.sizes, follows=True)
    damage.record_files(run, "jelly", tested)
    assert {id: value for id, (value, _) in found.items()} == {
        f"extremes.nsf.damage.files.{name}": 1.0 for name in ("damaged", "unfit")}


def test_damaged_files_are_those_of_the_scene_that_is_named(monkeypatch):
    """Not of the last one."""
    filed = []
    one, other = (SimpleNamespace(fields=SimpleNamespace(r=r)) for r in (5, 6))
    sealed = SimpleNamespace(monitor=SimpleNamespace(seal={}), tested=one)
    monkeypatch.setattr(damage, "scenes", lambda run: [(damage.FILE_SCENE, one), ("jelly", other)])
    monkeypatch.setattr(damage, "FieldBench", lambda *_: SimpleNamespace(
        count=40, drawn=lambda count: count, trial=lambda what, *_: trial(what=what),
        **vars(sealed)))
    monkeypatch.setattr(damage, "damage_array", lambda *_: None)
    monkeypatch.setattr(damage, "refit", lambda one, sizes, follows: (one, sizes, follows))
    monkeypatch.setattr(damage, "record_files", lambda run, *given: filed.append(given))
    run = Records()
    run.profile, run.rng = "quick", np.random.default_rng(0)
    monkeypatch.setattr(damage, "SHOWN", {"quick": ("U",)})
    damage.damage(run)
    assert filed == [(damage.FILE_SCENE, (one, Sizes(5, *damage.SMALL), True))]
    assert damage.FILE_SCENE in runs.studies(run)


def test_what_passes_is_recorded_with_its_largest_error():
    found = Records()
    run = SimpleNamespace(profile="quick", record=found.record)
    damage.record_ends(run, [trial(what=f"U: {kind}") for kind in damage.KINDS["quick"]]
                       + [trial(what="tau.modes: huge", error=7.0),
                          trial(what="C.modes: huge", message="no")])
    value, note = found["extremes.nsf.damage.huge"]
    assert value == pytest.approx(1.0 / 3.0)
    assert "7 %, jelly, tau.modes: huge" in note


# Long runs.

def test_long_runs_go_on_beside_the_full_order_run(bench):
    scene = STUDY.run(0.4)
    longer = with_(scene, steps=2 * scene.steps, every=10)
    full, stopped = extrapolation.full_run(longer)
    own, said = extrapolation.reduced_run(bench, longer, bench.drawn(40))
    assert (list(full), stopped, said) == ([0, 10, 20, 30, 40, 50, 60], "", "")
    assert list(own) == list(range(61))
    assert own[0][1] < 1e-3 * own[1][1]         # the nearest state to the start, not the start
    assert own[0][2] == pytest.approx(full[0][1], rel=1e-9)
    assert own[30][1] == pytest.approx(full[30][0], rel=0.1)
    assert own[10][2] == pytest.approx(full[10][1], rel=0.1)


def test_kinetic_energy():
    m, v = np.array([2.0, 1.0]), np.array([[3.0, 4.0], [0.0, 2.0]])
    assert extrapolation.kinetic_energy(m, v) == 27.0


def test_a_breakdown_is_recorded_with_its_step():
    found = Records()
    own = {0: (0.1, 0.0, 1.0), 1: (0.5, 0.2, 0.8), 2: (4.0, 0.4, 0.6)}
    full = {0: (0.0, 1.0), 2: (0.3, 0.5)}, ""
    extrapolation.record_end(found, "jelly", (own, "no body"), full, 1)
    value, note = found["extremes.nsf.long.jelly.steps"]
    assert (value, note) == (2, "no body")
    value, note = found["extremes.nsf.long.jelly.beyond"]
    assert value == 4.0
    assert "within the trained steps 0.5; above 1 first in step 2" in note
    assert found["extremes.nsf.long.jelly.kinetic"][0] == 0.6
    assert "the full-order run 0.5, its peak 1" in found["extremes.nsf.long.jelly.kinetic"][1]


def test_a_run_without_a_start_is_recorded(bench, monkeypatch):
    """It breaks down in the search of its first state."""
    def broken(*_):
        raise NoBody("no such body")

    monkeypatch.setattr("mpm_ref.rom.study.run.nsf_start", broken)
    own, said = extrapolation.reduced_run(bench, STUDY.run(0.4), bench.drawn(40))
    assert (own, said) == ({}, "no such body")
    found = Records()
    extrapolation.record_end(found, "jelly", (own, said), ({0: (0.0, 1.0)}, ""), 1)
    assert found == {"extremes.nsf.long.jelly.steps": (-1, "no such body")}


def test_a_full_order_run_without_a_start_is_recorded():
    found = Records()
    extrapolation.record_end(found, "jelly", ({0: (0.1, 0.0, 1.0)}, ""),
                             ({}, "the step is too large"), 1)
    assert found["extremes.nsf.long.jelly.steps"] == (
        0, "finished; the full-order run the step is too large")
    assert {*found} == {f"extremes.nsf.long.jelly.{name}" for name in ("steps", "beyond")}


def test_a_run_that_leaves_all_trained_states_is_ended(bench, monkeypatch):
    scene = STUDY.run(0.4)
    monkeypatch.setattr(runs, "MAX_OUTLYING", 0.5)
    own, said = extrapolation.reduced_run(bench, scene, bench.drawn(40))
    assert 1 <= len(own) < 31
    assert "times as far off" in said
    end = bench.end(0.4, bench.drawn(40))
    assert (end.error, end.message, end.steps) == (np.inf, "", len(own) - 1)


def test_stress_that_is_not_finite_ends_a_run(bench):
    spoilt = damage.damage_array(bench.tested.fields, "tau.coefficients.w", 0.5, "NaN")
    end = bench.trial("NaN", bench.drawn(40), spoilt).end
    assert not np.isfinite(end.error)
    assert (end.steps, "40 of 40 samples have no finite place" in end.message) == (0, True)
    assert 0.0 < bench.tests[0].off < 1.0
