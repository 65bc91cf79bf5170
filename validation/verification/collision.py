"""What is measured while two bodies collide."""

from typing import NamedTuple

import numpy as np

from mpm_ref.energy import energy, momentum
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.scenes import mean, threads_for, with_

TRANSFERS = ("pic", "mls", "apic", "flip")


class CollisionHistory(NamedTuple):
    """CollisionHistory of a collision at S times."""

    t: np.ndarray           # (S,)    [s]
    speed: np.ndarray       # (S,)    of the first body's centre, relative to its first [1]
    kinetic: np.ndarray     # (S,)    [J], affine motion included
    elastic: np.ndarray     # (S,)    [J]
    momentum: np.ndarray    # (S, d)  of all bodies [kg m/s]
    particles: int

    @property
    def steps(self):
        """Number of steps."""
        return len(self.t) - 1

    @property
    def total(self):
        """Kinetic and elastic energy (S,) [J]."""
        return self.kinetic + self.elastic


def collision_history(scene):
    """Run a scene of bodies in free flight and measure after each step."""
    problem, rows = build(with_(scene, every=1, interval=None)), []
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            bodies = frame.state.bodies
            E = energy(bodies, problem.gravity, problem.inertia)
            v = np.linalg.norm(mean(bodies[0], "v"))
            rows.append((frame.t, v, E.kinetic, E.elastic, momentum(bodies)))
    t, v, kinetic, elastic, p = map(np.array, zip(*rows, strict=True))
    count = sum(len(body.particles.x) for body in problem.bodies)
    return CollisionHistory(t, v / v[0], kinetic, elastic, p, count)


def thinned(transfer, c, rows):
    """Return at most so many rows (transfer, t, kinetic, elastic), energies relative."""
    chosen = np.unique(np.linspace(0, len(c.t) - 1, rows).round().astype(int))
    return [(transfer, c.t[k], c.kinetic[k] / c.total[0], c.elastic[k] / c.total[0])
            for k in chosen]
