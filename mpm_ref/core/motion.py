"""Rigid motions on a schedule: where a collider is, and how fast it moved in the step before.

A schedule gives a displacement [m] or an angle [rad] as a function of time, `value(t)`. The
velocity in a step that ends at t is (value(t) - value(t - dt)) / dt, so that the displacements of
the steps add up to the schedule's even where it starts, stops, bends or jumps within a step.
"""

from dataclasses import dataclass
from math import cos, inf, pi, sin
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True)
class Steady:
    """Constant rate [m/s or rad/s] from time start to stop [s], at rest before and after."""

    rate: object
    start: float = 0.0
    stop: float = inf

    def __post_init__(self):
        _finite("rate", self.rate)
        _interval(self.start, self.stop)

    def value(self, t):
        """Rate times the time spent moving."""
        return np.multiply(self.rate, min(max(t, self.start), self.stop) - self.start)


@dataclass(frozen=True)
class Keyframes:
    """Values [m or rad] at given times [s], linear in between, constant before and after."""

    times: object
    values: object

    def __post_init__(self):
        _table("values", self.times, self.values)

    def value(self, t):
        """Return the interpolated value at time t."""
        return _interpolate(t, self.times, self.values)


@dataclass(frozen=True)
class Ramps:
    """Rates [m/s or rad/s] at given times [s], linear in between, at rest before and after."""

    times: object
    rates: object

    def __post_init__(self):
        _table("rates", self.times, self.rates)

    def value(self, t):
        """Integral of the rate: trapezoids, exact for a linear rate."""
        times, rates = np.asarray(self.times, float), np.asarray(self.rates, float)
        t = min(max(t, times[0]), times[-1])
        knots = np.append(times[times < t], t)
        r = np.array([_interpolate(s, times, rates) for s in knots])
        return np.tensordot(np.diff(knots), 0.5 * (r[1:] + r[:-1]), 1)


@dataclass(frozen=True)
class Oscillation:
    """amplitude (sin(2 pi frequency s + phase) - sin(phase)), s the time since start, to stop."""

    amplitude: object
    frequency: float          # [1/s]
    phase: float = 0.0        # [rad]
    start: float = 0.0
    stop: float = inf

    def __post_init__(self):
        _finite("amplitude", self.amplitude)
        _finite("frequency, phase", (self.frequency, self.phase))
        _interval(self.start, self.stop)

    def value(self, t):
        """Displacement or angle; 0 at start."""
        s = min(max(t, self.start), self.stop) - self.start
        swing = sin(2.0 * pi * self.frequency * s + self.phase) - sin(self.phase)
        return np.multiply(self.amplitude, swing)


class Pose(NamedTuple):
    """A rigid motion at one time: X -> center + R (X - origin), with velocity v + W (x - center).

    Each array has a leading axis of length one, so that kernels read it as they read particles.
    """

    R: np.ndarray         # (1, d, d)  rotation
    origin: np.ndarray    # (1, d)     centre of rotation in the shape's own frame [m]
    center: np.ndarray    # (1, d)     where it is now [m]
    v: np.ndarray         # (1, d)     its velocity [m/s]
    W: np.ndarray         # (1, d, d)  angular velocity, skew [1/s]


@dataclass(frozen=True)
class Motion:
    """Translation [m] and rotation [rad] about `center` on schedules; None where there is none.

    `orientation` is a rotation matrix (see `rotation`) that turns the shape about `center` first.
    The centre is the world's origin unless given, and moves with the translation. A rotation
    has an `axis` in 3D and is counter-clockwise in 2D.
    """

    translation: object = None
    rotation: object = None
    axis: object = None
    center: object = None
    orientation: object = None

    @property
    def moves(self):
        """True if the motion depends on time."""
        return self.translation is not None or self.rotation is not None

    @property
    def at_rest(self):
        """The placement without the schedules."""
        return Motion(center=self.center, orientation=self.orientation)

    def pose(self, t, dt, d):
        """`Pose` at time t [s] in d dimensions; velocities are means over the dt [s] before t.

        Raises ValueError for vectors of another dimension, and for an axis missing in 3D or given
        in 2D.
        """
        if not dt > 0.0:
            raise ValueError(f"dt = {dt}: expected the length of the step that ends at t, > 0 in s")
        origin = np.zeros(d) if self.center is None else _sized("center", self.center, d)
        before, now = self._shift(t - dt, d), self._shift(t, d)
        R, W = self._turn(t, dt, d)
        v = (now - before) / dt
        return Pose(R[None], origin[None], (origin + now)[None], v[None], W[None])

    def _shift(self, t, d):
        """Displacement of the centre at time t."""
        if self.translation is None:
            return np.zeros(d)
        return _sized("translation", self.translation.value(t), d)

    def _turn(self, t, dt, d):
        """Rotation and angular velocity."""
        R0 = np.eye(d) if self.orientation is None else _orthogonal(self.orientation, d)
        if self.rotation is None:
            return R0, np.zeros((d, d))
        K, angle = generator(d, self.axis), float(self.rotation.value(t))
        rate = (angle - float(self.rotation.value(t - dt))) / dt
        return _exponential(K, angle) @ R0, rate * K


STILL = Motion()


def rotation(angle, axis=None):
    """Rotation matrix of an angle [rad]: about `axis` in 3D, counter-clockwise in 2D (no axis)."""
    return _exponential(generator(2 if axis is None else 3, axis), angle)


def generator(d, axis=None):
    """The skew matrix K with K x = axis x x (3D, unit axis) or x turned by a right angle (2D)."""
    if (axis is None) == (d == 3):
        raise ValueError(f"axis = {axis} in {d}D: a rotation has an axis in 3D, and none in 2D")
    if d == 2:
        return np.array([[0.0, -1.0], [1.0, 0.0]])
    x, y, z = _sized("axis", axis, 3)
    size = float(np.sqrt(x * x + y * y + z * z))
    if not size > 0.0:
        raise ValueError(f"axis = {axis}: expected a vector of positive length")
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / size


def _exponential(K, angle):
    """exp(angle K) = I + sin(angle) K + (1 - cos(angle)) K^2 (Rodrigues)."""
    return np.eye(len(K)) + sin(angle) * K + (1.0 - cos(angle)) * (K @ K)


def _interpolate(t, times, values):
    """Linear interpolation of numbers or vectors, constant outside."""
    values = np.asarray(values, float)
    columns = values.reshape(len(values), -1).T
    return np.reshape([np.interp(t, times, column) for column in columns], values.shape[1:])


def _finite(name, x):
    x = np.asarray(x, dtype=float)
    if not np.isfinite(x).all():
        raise ValueError(f"{name} = {x}: expected finite numbers")
    return x


def _sized(name, x, d):
    x = _finite(name, x)
    if x.shape != (d,):
        raise ValueError(f"{name} = {x}: expected a vector of {d} numbers")
    return x


def _orthogonal(R, d):
    R = _finite("orientation", R)
    if R.shape != (d, d) or abs(R @ R.T - np.eye(d)).max() > 1e-9 or np.linalg.det(R) < 0.0:
        raise ValueError(f"orientation = {R.tolist()}: expected a {d} x {d} rotation matrix")
    return R


def _interval(start, stop):
    if not -inf < start <= stop:
        raise ValueError(f"start = {start}, stop = {stop}: expected start <= stop in s")


def _table(name, times, values):
    """A table of at least two times that increase, with a value for each."""
    times, values = _finite("times", times), _finite(name, values)
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise ValueError(f"times = {times}: expected two or more increasing numbers in s")
    if len(values) != len(times):
        raise ValueError(f"{len(values)} {name} for {len(times)} times: expected one for each")
