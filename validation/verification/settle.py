"""Quasi-static states by damping: a dynamic run in which every particle is braked.

The body force of a particle is its load less 2 omega v_p, where omega is the lowest frequency of the
body: that mode is damped critically, all others decay as exp(-omega t). What is left of the lowest
one after a time t is (1 + omega t) exp(-omega t). At rest the brake does nothing, so that the final
state does not depend on it.
"""

from math import ceil


def settle(body, stepper, load, omega, dt, waits=20.0, ramp=0.0):
    """Load a body by `load` (N, d) [m/s^2] and advance it to the time waits/omega; returns the number
    of steps.

    omega [1/s]; dt [s] is the largest step; the load grows linearly over the time ramp/omega.
    """
    q, steps = body.particles, ceil(waits / (omega * dt))
    dt = waits / (omega * steps)
    stepper.start([body])
    for k in range(steps):
        grown = min(omega * k * dt / ramp, 1.0) if ramp else 1.0
        q.b[:] = grown * load - 2.0 * omega * q.v
        stepper.step([body], k * dt, dt)
    return steps
