"""NSF: full-order runs with longer steps, on a small study."""

from math import inf

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.snapshots import Histories
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.errors import PositionErrors
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.nsf import longer
from validation.nsf.studies import jelly, metal

STUDY = jelly(4)._replace(test=(0.3, 0.35, 0.4), every=8)
FACTORS = (1.0, 1.5, 2.0, 20.0)


@pytest.fixture(autouse=True)
def factors(monkeypatch):
    """Few of them."""
    monkeypatch.setattr(longer, "FACTORS", FACTORS)


def test_steps_are_longer_and_end_within_the_scene():
    scene = STUDY.run(0.35)
    for factor in FACTORS:
        own = longer.stretched(scene, factor)
        assert own.dt == factor * scene.dt
        assert scene.steps - factor < factor * own.steps <= scene.steps


def test_errors_are_those_beside_the_scenes_own_steps():
    same, between, twice, refused = longer.ended_runs(STUDY, 0.35)
    assert max(*same.errors, same.stress) < 1e-6        # states are compared in single precision
    levels = STUDY.run(0.35).steps // STUDY.spacing
    assert (same.states, between.states, twice.states) == (levels, levels // 3, levels)
    assert 0.0 < between.errors.origin < twice.errors.origin < 0.05
    scene = STUDY.run(0.35)
    ours = simulate_history(longer.stretched(scene, 2.0), [0.35])
    theirs = simulate_history(scene, [0.35], np.float32, STUDY.spacing)
    x, reference = ours.x[0, ::STUDY.spacing // 2][1:], theirs.x[0, 1:]
    assert len(x) == len(reference)
    assert twice.errors.origin == pytest.approx(
        np.linalg.norm(x - reference) / np.linalg.norm(reference))
    tau, reference = ours.tau[0, ::STUDY.spacing // 2][1:], theirs.tau[0, 1:]
    assert twice.stress == pytest.approx(np.linalg.norm(tau - reference)
                                         / np.linalg.norm(reference))
    assert refused.errors.origin == refused.stress == inf
    assert "crosses more than 1 dx in a step" in refused.reason


def test_times_are_medians_of_runs_in_turn(monkeypatch):
    spent = iter([4.0, 3.0, 2.0, 6.0, 1.0, 2.5, 5.0, 9.0, 2.0])
    monkeypatch.setattr(longer, "FACTORS", (1.0, 1.5, 2.0))
    monkeypatch.setattr(longer, "seconds", lambda made: next(spent))
    assert longer.run_times(STUDY.run(0.35), 3) == [5.0, 3.0, 2.0]
    assert next(spent, None) is None


def test_a_run_that_ends_before_its_time_took_for_ever():
    scene = longer.stretched(STUDY.run(0.35), 20.0)
    assert longer.run_seconds(scene) == inf
    with pytest.raises(NoBody, match="a particle crosses more than 1 dx"):
        list(longer.states(Histories(*9 * [None])._replace(dt=1.0), scene))


def test_bounds_of_the_time_step_do_not_end_a_run():
    scene = metal(4).run(0.08)
    assert scene.unstable != "allow"
    assert 0.0 < longer.run_seconds(longer.stretched(with_(scene, steps=8), 2.0)) < inf


def test_runs_that_are_clocked_show_their_last_frame_alone(monkeypatch):
    shown = []

    def seconds(made):
        shown.append([frame.state.step for frame in made()])
        return 1.0

    monkeypatch.setattr(longer, "FACTORS", (1.0, 2.0))
    monkeypatch.setattr(longer, "seconds", seconds)
    assert longer.run_times(STUDY.run(0.35), 1) == [1.0, 1.0]
    steps = STUDY.run(0.35).steps
    assert shown == [[0, steps], [0, steps // 2]]


def test_errors_and_times_are_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(longer, "metal", lambda coarser: STUDY)
    monkeypatch.setattr(longer, "cake", lambda coarser: STUDY)
    monkeypatch.setattr(longer, "run_times", lambda scene, repeats: [8.0, 6.0, 4.0, inf])
    assert not run_all([longer.longer.experiment], RunSetting("quick", tmp_path))
    found = ProfileResults(tmp_path)
    table = found.table("nsf.longer", "steps")
    assert table["scene"].tolist() == 4 * ["metal"] + 4 * ["cake"]
    assert table["faster"].tolist() == 2 * list(FACTORS)
    expected = longer.ended_runs(STUDY, 0.35)
    for name, own in (("states", [one.states for one in expected]),
                      ("origin", [one.errors.origin for one in expected]),
                      ("displacement", [one.errors.displacement for one in expected]),
                      ("stress", [one.stress for one in expected])):
        assert table[name].tolist() == pytest.approx(2 * own, rel=1e-6)
    assert table["speedup"].tolist() == pytest.approx(2 * [1.0, 8.0 / 6.0, 2.0, 0.0])
    records = {r.target: r for r in found.records("nsf.longer")}
    assert records["nsf.longer.cake.x2.speedup"].value == 2.0
    assert records["nsf.longer.metal.x2.error"].value == pytest.approx(
        100.0 * expected[2].errors.origin)
    assert records["nsf.longer.metal.x20.ended"].value == 1
    assert "crosses more than 1 dx in a step" in records["nsf.longer.metal.x20.ended"].note
    assert not {"nsf.longer.metal.x20.error", "nsf.longer.metal.x20.speedup"} & set(records)
    assert "dx and dt 4 times as long" in records["nsf.longer.cake.x2.error"].scale


def test_runs_that_broke_down_are_in_no_mean():
    run = Records()
    good = longer.EndedRun(7, PositionErrors(0.01, 0.02, 0.03), 0.4, "")
    longer.record(run, "a",
                  [good, longer.EndedRun(3, PositionErrors(*3 * [inf]), inf, "step 4: no body")],
                  (2.0, 3.0), "")
    value, note = run["a.error"]
    assert value == 1.0
    assert note == ("full-order run, 1 of 2 tests; 1 end in step 4: no body; 7 states; of the "
                    "displacement 3 %, of the stress 40 %")
    assert run["a.speedup"][0] == 1.5
