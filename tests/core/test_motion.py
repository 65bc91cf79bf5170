"""Schedules and rigid motions."""

from math import inf, pi

import numpy as np
import pytest

from mpm_ref.core.motion import (
    STILL,
    Keyframes,
    Motion,
    Oscillation,
    Ramps,
    Steady,
    generator,
    rotation,
)

SCHEDULES = (
    Steady((0.5, -1.0, 2.0), start=0.3, stop=1.7),
    Keyframes((0.0, 0.5, 2.0), ((0, 0, 0), (1, 2, 3), (1, 0, -1))),
    Ramps((0.2, 0.7, 1.9), ((0, 0, 0), (1, -2, 3), (0, 0, 0))),
    Oscillation((0.1, 0.2, 0.0), frequency=1.5, phase=0.4, start=0.25, stop=1.5),
)


@pytest.mark.parametrize(("schedule", "t", "value"), [
    (Steady(2.0), 3.0, 6.0),
    (Steady(2.0, start=1.0, stop=2.0), 0.5, 0.0),
    (Steady(2.0, start=1.0, stop=2.0), 1.25, 0.5),
    (Steady(2.0, start=1.0, stop=2.0), 9.0, 2.0),
    (Keyframes((1.0, 3.0), (0.0, 4.0)), 0.0, 0.0),
    (Keyframes((1.0, 3.0), (0.0, 4.0)), 1.5, 1.0),
    (Keyframes((1.0, 3.0), (0.0, 4.0)), 9.0, 4.0),
    (Ramps((1.0, 3.0), (0.0, 4.0)), 1.0, 0.0),
    (Ramps((1.0, 3.0), (0.0, 4.0)), 2.0, 1.0),
    (Ramps((1.0, 3.0), (0.0, 4.0)), 9.0, 4.0),
    (Ramps((0.0, 1.0, 3.0), (2.0, 2.0, 0.0)), 2.0, 3.5),
    (Oscillation(2.0, frequency=1.0), 0.25, 2.0),
    (Oscillation(2.0, frequency=1.0, phase=pi / 2), 0.5, -4.0),
    (Oscillation(2.0, frequency=1.0, start=1.0, stop=1.25), 9.0, 2.0),
])
def test_values_by_hand(schedule, t, value):
    assert schedule.value(t) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize("schedule", SCHEDULES, ids=lambda s: type(s).__name__)
def test_steps_add_up_to_the_displacement(schedule):
    """Whatever the step: here none of the schedules' corners is the end of a step."""
    dt, moved = 0.0371, np.zeros(3)
    for step in range(1, 60):
        moved += dt * Motion(schedule).pose(step * dt, dt, 3).v[0]
    assert moved == pytest.approx(schedule.value(59 * dt), abs=1e-14)


@pytest.mark.parametrize("schedule", SCHEDULES, ids=lambda s: type(s).__name__)
def test_velocity_is_the_rate_of_the_position(schedule):
    """Of a point fixed to the moving and turning body, for a short step; error O(dt)."""
    motion = Motion(schedule, Oscillation(2.0, 0.7, phase=0.2), (1.0, 2.0, 2.0), (0.3, 0.2, -0.1),
                    rotation(0.5, (0, 1, 1)))
    t, dt, X = 0.9, 1e-6, np.array([0.7, -0.4, 0.5])
    before, now = (motion.pose(s, dt, 3) for s in (t - dt, t))
    x_before, x = (p.center[0] + p.R[0] @ (X - p.origin[0]) for p in (before, now))
    v = now.v[0] + now.W[0] @ (x - now.center[0])
    # |x''| dt / 2 ~ 100 * 1e-6 / 2, and rounding of x 1e-16 / dt
    assert v == pytest.approx((x - x_before) / dt, abs=1e-4)
    assert np.linalg.norm(v) > 0.1


def test_rotation_about_a_moving_centre(d):
    """Half a turn about `center` while that moves by (1, ..): the centre's image is the centre."""
    c = np.array([2.0, 1.0, 0.5])[:d]
    axis = (0, 0, 3) if d == 3 else None
    pose = Motion(Steady(np.ones(d)), Steady(pi), axis, c).pose(1.0, 0.1, d)
    assert pose.center[0] == pytest.approx(c + 1.0)
    assert pose.R[0] == pytest.approx(np.diag((-1.0, -1.0, 1.0)[:d]), abs=1e-15)
    assert pose.v[0] == pytest.approx(np.ones(d))
    spin = np.zeros((d, d))
    spin[1, 0], spin[0, 1] = pi, -pi
    assert pose.W[0] == pytest.approx(spin)


def test_rotation_matrices(rng):
    a = rng.normal(size=3)
    R = rotation(0.8, a)
    assert R @ R.T == pytest.approx(np.eye(3), abs=1e-15)
    assert R @ a == pytest.approx(a)
    assert R @ rotation(-0.8, a) == pytest.approx(np.eye(3), abs=1e-15)
    assert rotation(pi / 2, (0, 0, 1)) @ (1, 0, 0) == pytest.approx((0, 1, 0), abs=1e-15)
    assert rotation(pi / 2) @ (1, 0) == pytest.approx((0, 1), abs=1e-15)
    assert generator(3, (0, 0, 2)) @ (1, 0, 0) == pytest.approx((0, 1, 0))


def test_at_rest():
    assert not STILL.moves
    assert not Motion(orientation=rotation(1.0), center=(1, 1)).moves
    moving = Motion(Steady((1, 0)), center=(1, 1), orientation=rotation(1.0))
    assert moving.moves
    pose = moving.at_rest.pose(7.0, 0.1, 2)
    assert (pose.center == pose.origin).all()
    assert not pose.v.any()
    assert not pose.W.any()
    assert (pose.R == rotation(1.0)).all()


@pytest.mark.parametrize(("make", "said"), [
    (lambda: Steady(np.nan), "rate = nan: expected finite"),
    (lambda: Steady(1.0, start=2.0, stop=1.0), "expected start <= stop"),
    (lambda: Steady(1.0, start=-inf), "expected start <= stop"),
    (lambda: Keyframes((0, 0), (1, 2)), "expected two or more increasing"),
    (lambda: Keyframes((0,), (1,)), "expected two or more increasing"),
    (lambda: Keyframes((0, 1), (1, 2, 3)), "3 values for 2 times"),
    (lambda: Ramps((0, 1), (1, inf)), "rates = .*expected finite"),
    (lambda: Oscillation(1.0, inf), "frequency"),
    (lambda: Motion(Steady((1, 0))).pose(0.0, 0.1, 3), "translation = .*vector of 3 numbers"),
    (lambda: Motion(Steady(1.0)).pose(0.0, 0.1, 3), "translation = .*vector of 3 numbers"),
    (lambda: Motion(rotation=Steady(1.0)).pose(0.0, 0.1, 3), "axis = None in 3D"),
    (lambda: Motion(rotation=Steady(1.0), axis=(0, 0, 1)).pose(0.0, 0.1, 2), "in 2D"),
    (lambda: Motion(rotation=Steady(1.0), axis=(0, 0, 0)).pose(0.0, 0.1, 3), "positive length"),
    (lambda: Motion(center=(0, 0)).pose(0.0, 0.1, 3), "center = .*vector of 3 numbers"),
    (lambda: Motion(orientation=2 * np.eye(2)).pose(0.0, 0.1, 2), "2 x 2 rotation matrix"),
    (lambda: Motion(orientation=np.diag((1, -1))).pose(0.0, 0.1, 2), "2 x 2 rotation matrix"),
    (lambda: STILL.pose(0.0, 0.0, 2), "dt = 0.0: expected"),
])
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
