"""Small problems and states for the tests of files: two blocks."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.state import Particles
from mpm_ref.energy import Energy
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.monitor import Account
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import Frame, State

DX = 0.05
ENERGY = Energy(1.0, 2.0, -3.0)


def block(name, corner, velocity, cells=4, fluid=False):
    """A square or cubic block of so many cells along an axis, 2 particles along each cell."""
    h, d = 0.5 * DX, len(corner)
    x = (np.indices((2 * cells,) * d).reshape(d, -1).T + 0.5) * h + corner
    n = len(x)
    q = particles_at(x, np.tile(velocity, (n, 1)), np.full(n, 1000.0 * h**d), np.full(n, h**d),
                     "mls", fluid=fluid)
    law = make_law("fluid", lam=1e5) if fluid else make_law("fixed_corotated", E=1e5, nu=0.3)
    return Body(name, q, law, NoFlow(), np.arange(n))


def colliding(clock=None, source="colliding", **rules):
    """Two elastic blocks that meet after 0.06 s."""
    bodies = (block("left", (0.2, 0.5), (1.0, 0.0)), block("right", (0.52, 0.53), (-1.0, 0.0)))
    return Problem(bodies=bodies, dx=DX, clock=clock or Clock(dt=5e-4, steps=100, every=20),
                   gravity=np.array([0.0, -1.0]), scheme=Scheme(), source=source,
                   title="two blocks", **rules)


def state_of(problem, seed=0):
    """A state with random numbers in every array, particles in a random order."""
    rng = np.random.default_rng(seed)
    bodies = tuple(body._replace(particles=scrambled(body.particles, rng),
                                 id=rng.permutation(len(body.id))) for body in problem.bodies)
    return State(bodies, step=int(rng.integers(1000)), t=rng.random(), frame=3, bound=rng.random(),
                 account=Account(ENERGY, rng.random()))


def scrambled(particles, rng):
    """The same arrays with random content; MLS keeps C and L one array."""
    arrays = {name: rng.random(a.shape) for name, a in particles._asdict().items()}
    if particles.C is particles.L:
        arrays["C"] = arrays["L"]
    return Particles(**arrays)


def frame_of(state, index=0):
    """The state as a frame."""
    return Frame(index, state.t, 1e-3, state)
