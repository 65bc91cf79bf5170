"""Step the block with the kernels of mpm_ref."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Conditions, nclaw_walls
from mpm_ref.core.jit import set_threads
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, NoFlow
from mpm_ref.simulate import SORT

from .problem import GRAVITY, WALL


class OurBlock:
    """A stepper of a `Block` that sorts the particles by cell as often as `simulate` does."""

    name = "mpm_ref"

    def __init__(self, block, threads):
        set_threads(threads)
        count = len(block.x)
        particles = particles_at(
            block.x.copy(), block.v.copy(), np.full(count, block.m), np.full(count, block.V0)
        )
        particles.F[:] = block.F
        law = FixedCorotated(block.mu, block.lam)
        self.bodies = (Body("block", particles, law, NoFlow(), np.arange(count)),)
        walls = Conditions(walls=nclaw_walls(block.n, WALL))
        self.stepper = Stepper(Scheme(), block.dx, 3, (0.0, 0.0, GRAVITY), walls)
        self.stepper.start(self.bodies)
        self.dt, self.steps = block.dt, 0

    def step(self, steps):
        """Advance by a number of steps."""
        for _ in range(steps):
            if self.steps % SORT == 0:
                self.stepper.sort(self.bodies)
            self.stepper.step(self.bodies, self.steps * self.dt, self.dt)
            self.steps += 1

    def velocity(self):
        """Return the velocities (N, 3)."""
        return self.bodies[0].particles.v
