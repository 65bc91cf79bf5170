"""Bodies that melt: their points change from one pair of laws to another, the lowest ones first
(Figure 4b, NCLAW-multi).

Points of each body are ordered by their height at the start. As in the authors' release a threshold
moves through that order from step 500 to step 1500; here it moves every `HOLD` steps. All share one
grid. Positions, velocities and deformation gradients stay as they are when a point changes.
"""

import numpy as np

from mpm_ref.body import Body, keep_inside, particles_at, restore_order
from mpm_ref.core.grid import OutOfRange
from mpm_ref.nclaw.study.compare import RunBroken

FIRST, LAST = 500, 1500     # steps
HOLD = 20                   # steps between changes


def melting(problem, before, after):
    """Yield positions (n, 3) of the points of a problem's bodies, one after the other, at the start
    and at each frame.

    before, after: functions that make of a body the same one of other laws. Frames are multiples of
    `HOLD` steps. Raises `RunBroken` where a point has no finite place after `HOLD` steps.
    """
    clock, stepper = problem.clock, problem.stepper()
    ranks = [np.argsort(np.argsort(body.particles.x[np.argsort(body.id), 1]))
             for body in problem.bodies]
    state = joined_body([before(body) for body in with_ids_in_turn(problem.bodies)])
    yield state.particles.x.copy()
    for k in range(0, clock.steps, HOLD):
        melted = np.concatenate([rank < melted_points(k, len(rank)) for rank in ranks])
        parts = [law(part(state, which)) for law, which in ((before, ~melted), (after, melted))
                 if which.any()]
        try:
            step_parts(problem, stepper, parts, k)
        except OutOfRange as fault:
            raise RunBroken(k + HOLD, str(fault)) from None
        state = joined_body(parts)
        if not np.isfinite(state.particles.x).all():
            raise RunBroken(k + HOLD, "a point has no finite place")
        if (k + HOLD) % clock.every == 0:
            yield state.particles.x.copy()


def step_parts(problem, stepper, parts, k):
    """Move parts from step k on until points change again. Raises `OutOfRange`."""
    dt = problem.clock.dt
    stepper.start(parts)
    stepper.sort(parts)
    for step in range(k, k + HOLD):
        stepper.step(parts, step * dt, dt)
        keep_inside(parts, *problem.clip)


def melted_points(step, n):
    """Return the number of n points that have changed."""
    return round(n * min(max((step - FIRST) / (LAST - FIRST), 0.0), 1.0))


def part(body, which):
    """Return the points of a body for which `which` (n,) is set, with their ids in that body."""
    q = body.particles
    particles = particles_at(*(a[which] for a in (q.x, q.v, q.m, q.V0)))
    particles.C[:], particles.F[:] = q.C[which], q.F[which]
    return Body(body.name, particles, body.law, body.flow, body.id[which])


def with_ids_in_turn(bodies):
    """Return bodies whose ids go on from those of the body before."""
    first = np.cumsum([0, *(len(body.id) for body in bodies)])
    return [body._replace(id=body.id + k) for body, k in zip(bodies, first[:-1], strict=True)]


def joined_body(parts):
    """Return one body of all points of some parts, in their own order."""
    ids = np.concatenate([one.id for one in parts])
    x, v, m, V0, C, F = (
        restore_order(np.concatenate([getattr(one.particles, name) for one in parts]), ids)
        for name in ("x", "v", "m", "V0", "C", "F"))
    particles = particles_at(x, v, m, V0)
    particles.C[:], particles.F[:] = C, F
    return Body(parts[0].name, particles, parts[0].law, parts[0].flow, np.arange(len(ids)))
