"""The gradient of a loss of the block by the tape of mpm_ref."""

import numpy as np

from mpm_ref.tape import Seed, Tape

from .ours_block import OurBlock


class OurGradient:
    """Runs a `LossOfRun` forward and backward; each time with new particles, sorted once."""

    name = "mpm_ref"

    def __init__(self, problem, threads):
        self.problem, self.threads = problem, threads

    def gradient(self):
        """Return the loss [m], and its gradients by the initial x and v, (N, 3) each."""
        block, w, steps = self.problem
        run = OurBlock(block, self.threads)
        run.stepper.sort(run.bodies)
        (body,) = run.bodies
        tape = Tape(run.stepper, run.bodies)
        for n in range(steps):
            tape.step(n * run.dt, run.dt)
        w = w[body.id]
        loss = float(np.sum(w * body.particles.x))
        (bar,) = tape.gradient({steps: [Seed(x=w)]}).bodies
        return loss, in_order(bar.x, body.id), in_order(bar.v, body.id)


def in_order(a, order):
    """Return the b with b[order] = a, arrays (N, 3)."""
    b = np.empty_like(a)
    b[order] = a
    return b
