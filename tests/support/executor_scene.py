"""A tiny run whose bits the tests of executors compare."""

import hashlib

from small_runs import colliding

from mpm_ref.problem import Clock
from mpm_ref.simulate import simulate

STEPS = Clock(dt=5e-4, steps=30, every=30)


def final_positions(speed):
    """Return the sha256 of the positions at the end of a run of two blocks [m]."""
    problem = colliding(STEPS)
    problem.bodies[0].particles.v[:, 1] = speed
    *_, last = simulate(problem)
    digest = hashlib.sha256()
    for body in last.state.bodies:
        digest.update(body.particles.x.tobytes())
    return digest.hexdigest()
