"""Runs of `trade.reduced-live`: loads, methods that know no gravity before its time, and what is
recorded of them.
"""

import numpy as np
import pytest

from mpm_ref.rom.fields.pod import directions
from mpm_ref.rom.study.full_model import field_of
from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common.scenes import with_
from validation.trade import live_models
from validation.trade.arm_models import TimedPositions
from validation.trade.live_loads import REPEATED, measured, record_body
from validation.trade.live_models import (
    corrected_method,
    jumps,
    ldm_method,
    operators_method,
    superposition_method,
)
from validation.trade.live_runs import (
    HOLD,
    LEVELS,
    TICKS,
    LiveMethod,
    StepTraining,
    coarse_method,
    drawn_loads,
    full_method,
    full_states,
    load_training,
    played,
    points_of,
    sized,
    step_training,
    sway,
    training_gravity,
)
from validation.trade.reduced import ArmCost, errors

DX = 0.06


@pytest.fixture(scope="module")
def study():
    return sway()


@pytest.fixture(scope="module")
def gravity(study):
    return training_gravity(study)


@pytest.fixture(scope="module")
def scene(study):
    return sized(study.scene(study.mu[0]), DX)


@pytest.fixture(scope="module")
def training(scene, gravity):
    return step_training(scene, gravity)


@pytest.fixture(scope="module")
def methods(scene, training, gravity):
    """All kinds of methods by their names."""
    coarse = sized(scene, 2.0 * DX)
    made = (full_method(scene), coarse_method(coarse, 2.0, training.X),
            corrected_method(training, step_training(coarse, gravity), 2.0),
            ldm_method("ldm", training, 6),
            ldm_method("ldm.evolved", training, 6, deformation_gradient="evolved"),
            superposition_method(training),
            operators_method(load_training(scene, drawn_loads(gravity, 12, 3), 3), 4))
    return {one.name: one for one in made}


NAMES = ("full.pic", "coarse.2.pic", "corrected.2", "ldm", "ldm.evolved", "superposition",
         "operators")


def test_training_gravity_is_that_of_the_study(study, gravity):
    assert gravity[:, [0, 2]].tolist() == study.mu[list(study.train)].tolist()
    assert not gravity[:, 1].any()


def test_loads_are_piecewise_constant_and_differ_between_seeds(gravity):
    loads = drawn_loads(gravity, 40, 0)
    assert loads.shape == (40, TICKS, 3)
    assert ((loads >= gravity.min(axis=0)) & (loads <= gravity.max(axis=0))).all()
    changes = [np.flatnonzero(np.diff(one[:, 0])) + 1 for one in loads]
    ticks = {int(n) for one in changes for n in np.diff(np.append(0, one))}
    assert ticks == set(range(*HOLD))
    assert not np.allclose(loads, drawn_loads(gravity, 40, 1))


def test_a_size_keeps_time_cells_of_a_step_and_particles_of_a_cell(study):
    own = study.scene(study.mu[0])
    assert sized(own, own.dx) == own
    fine = sized(own, own.dx / 3.2, "apic")
    assert fine.scheme.transfer == "apic"
    assert fine.steps % TICKS == 0
    assert fine.steps * fine.dt == pytest.approx(own.steps * own.dt)
    assert own.dt / own.dx * 0.9 < fine.dt / fine.dx <= own.dt / own.dx
    density = [one.body[0].sampling.count * one.dx**3 for one in (own, fine)]
    assert density[1] == pytest.approx(density[0], rel=1e-3)


def test_a_run_under_constant_gravity_is_that_of_the_scene(scene):
    own = with_(scene, gravity=(1.0, 0.0, -2.0), every=2 * scene.steps // TICKS)
    expected = [field_of(frame.state.bodies, "x").copy() for frame in simulate(build(own))]
    found = played(full_method(scene), np.tile([1.0, 0.0, -2.0], (TICKS, 1)))
    assert found.x.shape == (LEVELS, len(points_of(scene)), 3)
    assert np.array_equal(found.x, expected[1:])
    assert found.cpu > 0.0


def test_a_run_that_only_a_change_of_gravity_moves_is_not_stopped(scene):
    """Without gravity at the start, all energy is one that the run's account would not know."""
    load = np.zeros((TICKS, 3))
    load[TICKS // 2:, 2] = -3.0
    found = played(full_method(with_(scene, gravity=(0.0, 0.0, 0.0))), load)
    assert np.allclose(found.x[LEVELS // 2 - 1], points_of(scene), atol=1e-12)
    assert found.x[-1][:, 2].mean() < points_of(scene)[:, 2].mean() - 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_no_method_reads_gravity_before_its_tick(methods, gravity, name):
    load, read = drawn_loads(gravity, 1, 2)[0], []

    def ticks():
        for k, one in enumerate(load):
            read.append(k)
            yield one

    states = methods[name].begin(ticks())
    assert read == []
    for k, _ in enumerate(states):
        assert read == [*range(k + 1)]
    assert len(read) == TICKS


@pytest.mark.parametrize("name", NAMES)
def test_a_change_is_seen_after_its_time_alone(methods, gravity, name):
    first = np.tile(gravity[0], (TICKS, 1))
    other, half = first.copy(), 2 * (LEVELS // 2)
    other[half:] = gravity[-1]
    a, b = (played(methods[name], load).x for load in (first, other))
    assert np.array_equal(a[:LEVELS // 2], b[:LEVELS // 2])
    assert (np.abs(a - b).max(axis=(1, 2))[LEVELS // 2:] > 1e-4).all()


def test_methods_follow_a_training_run(methods, training, gravity):
    load = np.tile(gravity[0], (TICKS, 1))
    reference = [played(methods["full.pic"], load)]
    assert np.array_equal(reference[0].x, training.x[0, 1::2])
    error = {name: errors(training.X, [played(one, load)], reference)[0]
             for name, one in methods.items()}
    assert error["ldm"] < 0.05
    assert error["ldm.evolved"] < 0.05
    assert error["corrected.2"] < 0.2 * error["coarse.2.pic"]
    assert error["superposition"] < 0.3
    assert error["operators"] < 0.2


def test_points_of_a_coarse_run_without_gravity_stay(methods, training):
    x = played(methods["coarse.2.pic"], np.zeros((TICKS, 3))).x
    assert np.allclose(x, training.X, atol=1e-12)


def test_responses_to_jumps_are_added():
    """Of a linear body with a response of its own to each component of gravity."""
    rng, gravity = np.random.default_rng(0), np.array([[2.0, 0.0, 0.0], [1.0, 0.0, -3.0]])
    S, X = rng.normal(size=(2, TICKS, 5, 3)), rng.normal(size=(5, 3))
    x = X + np.einsum("ra,atni->rtni", gravity[:, ::2], S)
    method = superposition_method(StepTraining(None, gravity, X, x, None, 1.0))
    load = np.zeros((TICKS, 3))
    load[1:, 0], load[4:, 2] = 1.5, -0.5
    states = [*method.begin(iter(load))]
    assert np.allclose(method.place(states[0]), X)
    expected = X + 1.5 * S[0, 5] - 0.5 * S[1, 2]
    assert np.allclose(method.place(states[6]), expected)
    assert method.data == 1.0


def test_states_of_training_under_loads_are_those_of_the_run(scene, gravity):
    load = drawn_loads(gravity, 1, 3)
    training = load_training(scene, load, 3)
    assert training.parts == 4          # 3 do not divide a tick's steps
    assert training.x.shape == (1, 4 * TICKS, len(training.X), 3)
    assert np.array_equal(training.x[0, 7::8],
                          played(full_method(scene), load[0]).x.astype(np.float32))


def test_modes_of_operators_are_of_the_states_after_each_tick(scene, gravity, monkeypatch):
    training, snapshots = load_training(scene, drawn_loads(gravity, 6, 3), 3), []

    def recorded(X, x, r):
        snapshots.append(x)
        return directions(X, x, r)

    monkeypatch.setattr(live_models, "directions", recorded)
    operators_method(training, 2)
    ends = training.x[:, 3::4].reshape(-1, *training.X.shape)
    assert np.array_equal(snapshots[0], ends.astype(float))


def test_jumps_have_ages():
    load = [np.array(g, dtype=float) for g in ((0, 0, -1), (0, 0, -1), (2, 0, -1))]
    *_, last = jumps(iter(load))
    assert {age: jump.tolist() for age, jump in last.items()} == {
        3: [0.0, 0.0, -1.0], 1: [2.0, 0.0, 0.0]}


def test_training_runs_are_states_after_each_tick(training, scene, gravity):
    n = len(training.X)
    assert training.x.shape == (len(gravity), TICKS, n, 3)
    assert training.F.shape == (len(gravity), TICKS, n, 3, 3)
    last = [*full_states(scene, [gravity[3]] * TICKS)][-1]
    assert np.array_equal(training.F[3, -1], field_of(last, "F"))
    assert training.cpu > 0.0


class Records:
    """Keeps what is recorded."""

    def __init__(self):
        self.values, self.notes = {}, {}

    def record(self, name, value, **rest):
        self.values[name], self.notes[name] = value, rest["note"]


def test_methods_are_compared_with_the_first_on_all_loads():
    X = np.zeros((4, 3))

    def moved(name, size):
        return LiveMethod(name, lambda load: (size * g for g in load), lambda u: X + u, 1.0, 2.0)

    loads = [np.ones((TICKS, 3)), 2.0 * np.ones((TICKS, 3))]
    rows = measured(("400", X), [moved("full.pic", 1.0), moved("ldm", 1.1)], loads)
    assert [row.error for row in rows] == [0.0, pytest.approx(0.1)]
    assert (rows[1].particles, rows[1].first) == (4, 3.0)


def rows_of(**changes):
    """Rows of methods: {name: (error, CPU seconds of a run)}."""
    values = {"full.pic": (0.0, 4.0), "coarse.2.pic": (0.1, 1.0), "corrected.2": (0.03, 1.5),
              "ldm": (0.04, 3.0), "ldm.few": (0.03, 0.1), "ldm.evolved": (0.02, 6.0),
              "superposition": (0.2, 0.01), "operators": (0.05, 0.01), **changes}
    return [ArmCost("400", 9, name, error, error, cpu, 0.0, 0.0, 0.0)
            for name, (error, cpu) in values.items()]


def test_ldm_is_compared_with_the_cheapest_other_of_no_larger_error():
    run = Records()
    record_body(run, "x", rows_of(), "")
    assert run.values["x.ldm.gain"] == pytest.approx(0.5)
    assert "corrected.2" in run.notes["x.ldm.gain"]
    assert run.values["x.ldm.beats-superposition"] == pytest.approx(5.0)
    assert run.values["x.ldm"] == pytest.approx(4.0)
    assert run.values["x.ldm.evolved.gain"] == pytest.approx(4.0 / 6.0)
    assert run.values["x.ldm.evolved.beats-superposition"] == pytest.approx(10.0)
    assert "x.full.pic" not in run.values


def test_a_run_of_ldm_that_broke_down_gains_nothing():
    run = Records()
    record_body(run, "x", rows_of(ldm=(np.inf, 1.0)), "")
    assert run.values["x.ldm.gain"] == run.values["x.ldm.beats-superposition"] == 0.0
    assert "x.ldm" not in run.values


def test_a_method_that_breaks_down_has_no_positions():
    def states(load):
        yield next(load)
        raise np.linalg.LinAlgError

    assert played(LiveMethod("x", states, lambda one: one), np.ones((TICKS, 3))).x is None
    assert isinstance(played(LiveMethod("x", iter, lambda one: one), np.ones((TICKS, 3))),
                      TimedPositions)


def test_operators_are_compared_over_many_runs_with_their_training(scene):
    run, rows = Records(), rows_of()
    rows = [row._replace(cpu_fit=30.0) if row.method == "operators" else row for row in rows]
    record_body(run, "x", rows, "")
    own = 30.0 + REPEATED * 0.01
    assert run.values["x.operators.gain"] == pytest.approx(REPEATED * 0.1 / own)
    assert "ldm.few" in run.notes["x.operators.gain"]
    assert run.values["x.operators.pays"] == pytest.approx(30.0 / (0.1 - 0.01))
    record_body(run, "x", rows_of(operators=(np.inf, 0.01)), "")
    assert run.values["x.operators.gain"] == 0.0
    with pytest.raises(ValueError, match="36 steps: expected at least 108"):
        load_training(with_(scene, steps=36), ())
