"""One implicit step from a given state, solved by many methods, and the errors they leave."""

from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import gather
from mpm_ref.hot.methods import minimise, printed
from mpm_ref.hot.step import write_velocities
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.scenes import particle_count


class ImplicitStep(NamedTuple):
    """A state and the pose of its next step."""

    bodies: tuple
    stepper: object
    pose: object
    dt: float
    t: float            # at its start [s]

    @property
    def particles(self):
        """Return the number of particles."""
        return particle_count(self.bodies)


def step_after(scene, steps, **solver):
    """Return the `ImplicitStep` after a number of steps of a scene, by the scene's own solver.

    Raises ValueError if the scene ends earlier.
    """
    problem = build(scene)
    frames = list(simulate(problem))
    state, dt = frames[-1].state, frames[-1].dt
    if state.step != steps:
        raise ValueError(f"the scene ended after {state.step} steps: expected {steps}")
    return implicit_step(problem.stepper(), state, dt)


def implicit_step(stepper, state, dt):
    """Return the `ImplicitStep` of length dt [s] that a stepper makes from a state."""
    pose = stepper.problem(state.bodies, state.t, dt)
    return ImplicitStep(state.bodies, stepper, pose, dt, state.t)


def solve_step(step, method, **changes):
    """Return the `Solution` of the step by a method: its name, as HOT prints it, or options."""
    options = printed(method) if isinstance(method, str) else method
    return minimise(step.stepper.system(step.pose), options, **changes)


def particle_velocities(step, dv):
    """Return the velocities of all particles after the step by the increment dv, and the masses."""
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


class ParticleErrors(NamedTuple):
    """The particles' errors by an increment; root mean squares are over their mass."""

    velocity: float         # rms, over the rms increment of the velocity
    velocity_max: float     # largest of a particle, over the same
    cells: float            # of the displacement, rms [dx]
    cells_max: float        # largest of a particle [dx]


def particle_errors(step, dv, exact):
    """Return the `ParticleErrors` of an increment dv (n, d) [m/s], given the exact one."""
    v, m = particle_velocities(step, dv)
    u, _ = particle_velocities(step, exact)
    v0, _ = particle_velocities(step, np.zeros_like(dv))
    rms, most = _spread(v - u, m)
    length, _ = _spread(u - v0, m)
    cells = step.dt / step.pose.grid.dx
    return ParticleErrors(rms / length, most / length, rms * cells, most * cells)


def _spread(v, m):
    """Return the root mean square over mass, and the largest, of the lengths of v (N, d)."""
    squares = np.sum(v**2, axis=1)
    return float(np.sqrt(m @ squares / m.sum())), float(np.sqrt(squares.max()))


def difference(step, dv, exact):
    """Return the relative error of the particles' velocity increment, and that in cells.

    The first is a root mean square over the particles' mass, over that of the increment; the second
    the largest error of a displacement in cells.
    """
    errors = particle_errors(step, dv, exact)
    return errors.velocity, errors.cells_max
