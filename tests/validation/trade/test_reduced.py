"""The arm of `trade.reduced`: its runs, and what is recorded of the methods for their positions."""

import numpy as np
import pytest

from validation.trade import reduced
from validation.trade.arm import ENDS, LEVELS, arm, draws, histories, simulated
from validation.trade.arm_models import ArmMethod, TimedPositions, Training, looked_up_methods
from validation.trade.reduced import ArmCost, measured, record_gain

DX = 0.08


@pytest.fixture(scope="module")
def training():
    mu, _ = draws(8, 1, 0)
    return Training(DX, mu, [simulated(arm(one, DX), ("x", "F", "tau", "C")) for one in mu])


def test_parameters_lie_within_their_ranges_and_differ_between_seeds():
    (train, test), (other, _) = draws(8, 3, 0), draws(8, 3, 1)
    low, high = np.transpose(ENDS)
    for mu in (train, test):
        assert ((mu >= low) & (mu <= high)).all()
    assert (train.shape, test.shape) == ((8, 6), (3, 6))
    assert not np.allclose(train, other)


def test_an_arm_has_its_parameters():
    mu = np.array([1.0, -2.0, 3.0, 15000.0, 0.1, -0.2])
    scene = arm(mu, DX)
    body = scene.body[0]
    assert scene.gravity == (1.0, -2.0, 3.0)
    assert body.material.E == 15000.0
    assert body.velocity.linear == (0.0, 0.1, -0.2)
    assert scene.steps % LEVELS == 0
    assert scene.steps * scene.dt == pytest.approx(30 / 144)


def test_training_runs_are_states_at_the_levels(training):
    scene = arm(training.mu[0], DX)
    one = histories(training.runs, scene, training.mu)
    assert one.x.shape == (8, LEVELS + 1, len(training.X), 3)
    assert np.array_equal(one.x[2], training.runs[2].x)
    assert np.allclose(one.v[3], [0.0, *training.mu[3, 4:]])
    assert one.dt * LEVELS == pytest.approx(scene.dt * scene.steps)
    assert all(run.cpu > 0.0 for run in training.runs)


def test_training_runs_are_found_again(training):
    """At the parameters of a training run the nearest and the interpolated one are that run, and so
    is the linear function, where the runs are as many as it has numbers.
    """
    few = training._replace(mu=training.mu[:7], runs=training.runs[:7])
    for method in looked_up_methods(few):
        assert np.allclose(method.positions(few.mu[4]).x, few.runs[4].x, atol=1e-6), method.name


def test_errors_are_those_of_the_displacement(training):
    reference = training.runs[0]
    X = training.X

    def scaled(mu):
        return TimedPositions(X + 1.1 * (reference.x - X), 2.0)

    cases = training, training.mu[:1], [reference]
    row = measured(ArmMethod("pod.all", scaled, 3.0), "2k", cases, (5.0, 0.0))
    assert row.error == pytest.approx(0.1, rel=1e-3)
    assert row.worst == row.error
    assert (row.cpu_run, row.first) == (2.0, 8.0)
    assert measured(ArmMethod("coarse.2", scaled), "2k", cases, (5.0, 0.0)).first == 0.0
    broken = ArmMethod("nsf.all", lambda mu: TimedPositions(None, 1.0))
    assert measured(broken, "2k", cases, (5.0, 0.0)).error == np.inf


class Records:
    """Keeps what is recorded."""

    def __init__(self):
        self.found = {}

    def record(self, name, value, **rest):
        self.found[name] = value, rest["note"]


def row(method, error, cpu, first=0.0):
    before = (share * first for share in (0.5, 0.3, 0.2))
    return ArmCost("13k", 9, method, error, error, cpu, *before)


@pytest.mark.parametrize(("rows", "gain", "word"), [
    ([row("full.apic", 0.0, 6.0), row("coarse.2", 0.009, 3.0), row("corrected.4", 0.005, 0.5, 10.0),
      row("pod.few", 0.02, 0.1, 1.0)], 6.0, "after 4 runs"),
    ([row("full.apic", 0.0, 6.0), row("pod.few", 0.02, 0.1, 1.0)], 0.0, "no trained method"),
    ([row("full.apic", 0.0, 6.0), row("nsf.all", 0.005, 12.0, 1.0)], 0.5, "after inf runs")])
def test_the_cheapest_within_the_error_are_compared(rows, gain, word):
    run = Records()
    record_gain(run, "x", rows, "")
    value, note = run.found["x.gain"]
    assert value == pytest.approx(gain)
    assert word in note
    assert reduced.ERROR == 0.01
