"""How well a body follows a manufactured motion."""

from math import ceil

import numpy as np

from mpm_ref.core.grid import OutOfRange

from ..common.scenes import threads_for
from .convergence import rms

CHECKS = 20          # times at which the error is taken
LOST = 1.0           # error [m] at which a body has nothing to do with its motion: it has this size


def steps_of(end, dt):
    """Number of steps to time `end` with at most dt each, such that all checks are met."""
    return CHECKS * ceil(end / dt / CHECKS)


def put_on(particles, motion, dt):
    """Put particles on the motion at time 0.

    A symplectic Euler step takes v from t - dt/2 to t + dt/2 as it takes x from t to t + dt: so the
    velocities are those of time -dt/2, which makes the time integration of second order.
    """
    particles.x[:], particles.F[:] = motion.position(0.0), motion.gradient(0.0)
    particles.v[:] = motion.velocity(-0.5 * dt)
    if particles.C.ndim == 3:
        growth = (motion.gradient(0.0) - motion.gradient(-dt)) / dt
        particles.C[:] = growth @ np.linalg.inv(motion.gradient(-0.5 * dt))


def follow(body, motion, stepper, end, dt):
    """Largest RMS error of the positions [m] at `CHECKS` times up to `end` [s]; `LOST` beyond that.

    A motion tells position, velocity, gradient and body_force of its particles at any time; which
    of them are `measured`; and `hold` resets those that are not free.
    """
    steps = steps_of(end, dt)
    put_on(body.particles, motion, end / steps)
    stepper.start([body])
    worst = 0.0
    with threads_for([body]):
        try:
            for error in errors(body, motion, stepper, end / steps, steps):
                worst = max(worst, error)
                if not worst < LOST:
                    return LOST
        except OutOfRange:
            return LOST
    return worst


def errors(body, motion, stepper, dt, steps):
    """Advance by so many steps and yield the RMS error of the positions [m] at `CHECKS` times."""
    q = body.particles
    for k in range(1, steps + 1):
        q.b[:] = motion.body_force((k - 1) * dt)
        stepper.step([body], (k - 1) * dt, dt)
        motion.hold(q)
        if k % (steps // CHECKS) == 0:
            yield rms((q.x - motion.position(k * dt))[motion.measured])
