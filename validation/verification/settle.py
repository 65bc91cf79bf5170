"""Quasi-static states by damping: a dynamic run in which every particle is braked.

The body force of a particle is its load less 2 omega v_p, where omega is the lowest frequency of
the body: that mode is damped critically, all others decay as exp(-omega t). After a time t the part
(1 + omega t) exp(-omega t) of the lowest one is left. At rest the brake does nothing, so that the
final state does not depend on it.
"""

from math import ceil
from typing import NamedTuple

from ..common.scenes import threads_for


class Pace(NamedTuple):
    """The settings with which a body is brought to rest."""

    omega: float            # its lowest frequency [1/s]
    dt: float               # largest step [s]
    waits: float = 20.0     # length of the run, times 1/omega
    ramp: float = 0.0       # time in which the load grows linearly, times 1/omega


def settle(body, stepper, load, pace):
    """Load a body by `load` (N, d) [m/s^2] until it has come to rest."""
    q, omega, steps = body.particles, pace.omega, ceil(pace.waits / (pace.omega * pace.dt))
    dt = pace.waits / (omega * steps)
    stepper.start([body])
    with threads_for([body]):
        for k in range(steps):
            grown = min(omega * k * dt / pace.ramp, 1.0) if pace.ramp else 1.0
            q.b[:] = grown * load - 2.0 * omega * q.v
            stepper.step([body], k * dt, dt)
