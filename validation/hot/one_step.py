"""One implicit step from a state that is given, solved in many ways: what each found and took."""

from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import gather
from mpm_ref.hot.methods import minimise
from mpm_ref.hot.step import write_velocities
from mpm_ref.scene import build
from mpm_ref.simulate import simulate


class Step(NamedTuple):
    """A state and the pose of its next step."""

    bodies: tuple
    stepper: object
    pose: object
    dt: float
    t: float            # at its start [s]


def after(scene, steps, **solver):
    """`Step` of a scene after so many steps, which are solved as the scene says."""
    problem = build(scene)
    frames = list(simulate(problem))
    state, dt = frames[-1].state, frames[-1].dt
    if state.step != steps:
        raise ValueError(f"the scene made {state.step} steps: expected {steps}")
    stepper = problem.stepper()
    return Step(state.bodies, stepper, stepper.problem(state.bodies, state.t, dt), dt, state.t)


def solved(step, method, **changes):
    """`Solution` of the step by a method."""
    return minimise(step.stepper.system(step.pose), method, **changes)


def particle_velocities(step, dv):
    """Velocities of all particles after the step with the increment dv, and their masses."""
    grid, q = step.pose.grid, step.pose.unknowns
    grid = grid._replace(v=grid.v.copy())
    write_velocities(grid, q, q.v + dv)
    v, m = [], []
    for body in step.bodies:
        copy = body._replace(particles=type(body.particles)(*(a.copy() for a in body.particles)))
        gather(copy, grid, step.stepper.scheme, step.dt)
        v.append(copy.particles.v)
        m.append(copy.particles.m)
    return np.concatenate(v), np.concatenate(m)


class Errors(NamedTuple):
    """What an increment leaves in the particles, root mean squares being over their mass."""

    velocity: float         # rms, over the rms increment of the velocity
    velocity_max: float     # largest of a particle, over the same
    cells: float            # of the displacement, rms [dx]
    cells_max: float        # largest of a particle [dx]


def errors(step, dv, exact):
    """`Errors` of an increment dv (n, d) [m/s] beside the exact one."""
    v, m = particle_velocities(step, dv)
    u, _ = particle_velocities(step, exact)
    v0, _ = particle_velocities(step, np.zeros_like(dv))
    rms, most = _spread(v - u, m)
    length, _ = _spread(u - v0, m)
    cells = step.dt / step.pose.grid.dx
    return Errors(rms / length, most / length, rms * cells, most * cells)


def _spread(v, m):
    """Root mean square over mass, and largest, of the lengths of v (N, d)."""
    squares = np.sum(v**2, axis=1)
    return float(np.sqrt(m @ squares / m.sum())), float(np.sqrt(squares.max()))


def difference(step, dv, exact):
    """Root mean square over the particles' mass of the error of their velocity increment, relative
    to that of the increment; and the largest error of their displacement in cells.
    """
    found = errors(step, dv, exact)
    return found.velocity, found.cells_max
