"""Points without mass that move with the grid velocity of a full-order run (tracers)."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import gather
from mpm_ref.materials import NoFlow
from mpm_ref.simulate import SORT


class CoveringStorage:
    """Grid storage that covers tracers too, wherever the bodies are."""

    def __init__(self, storage, tracers):
        self.storage, self.tracers = storage, tracers

    def cover(self, positions):
        """Return the grid that covers positions [(N, d)] and the tracers."""
        return self.storage.cover([*positions, self.tracers.particles.x])


def advected(problem, X):
    """Yield (t [s], x (n, d) [m]) of points X (n, d) after each step of an explicit problem with a
    fixed dt: they take the velocity of the grid at their place, as the particles do. A node without
    mass stands still. The array is that of the next step too: copy what you keep.
    """
    stepper, clock, (n, d) = problem.stepper(), problem.clock, X.shape
    particles = particles_at(X, np.zeros((n, d)), np.zeros(n), np.zeros(n), problem.scheme.transfer)
    tracers = Body("tracers", particles, problem.bodies[0].law, NoFlow(), np.arange(n))
    stepper.storage = CoveringStorage(stepper.storage, tracers)
    stepper.start(problem.bodies)
    for k in range(clock.steps):
        if k % SORT == 0:
            stepper.sort(problem.bodies)
        grid = stepper.step(problem.bodies, k * clock.dt, clock.dt)
        gather(tracers, grid, problem.scheme, clock.dt)
        yield (k + 1) * clock.dt, tracers.particles.x
