"""What symplectic Euler does exactly: constant acceleration, and the swing of the energy."""

import numpy as np


def travelled(v, a, t, dt):
    """Way after time t of steps dt [m] from speed v with acceleration a: v t + a t (t + dt)/2.

    Each step uses the new velocity, so that the sum of 1, .., n takes the place of n^2/2.
    """
    return v * t + 0.5 * a * t * (t + dt)


def allowed_gain(elastic):
    """Half the largest change of elastic energy U in a step [J], of its values after each step.

    Symplectic Euler keeps H - (dt/2) dU/dt but for terms in dt^2, of the energy H = kinetic + U;
    from a start without stress, where dU/dt = 0, H rises by at most (dt/2) max dU/dt. What is left
    out is the share omega dt/2 of it, for a vibration of frequency omega: where a transfer does not
    dissipate as much, it shows.
    """
    return 0.5 * float(np.max(np.abs(np.diff(elastic))))
