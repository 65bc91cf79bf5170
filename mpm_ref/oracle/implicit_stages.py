"""One implicit step of the kernels, stopped after every stage.

What operators are applied to is drawn once, with a fixed seed, and stored: another code reads it
from the file.
"""

from typing import NamedTuple

import numpy as np

from ..explicit import scatter
from ..hot.linearization import matrix_product
from ..hot.methods import descent_method
from ..hot.multigrid.blocks.transfer import prolong
from ..hot.multigrid.hierarchy import hierarchy
from ..hot.report import Profiler
from ..hot.step import write_velocities
from . import kernel_stages

SEED = 20200
STRAIN = 0.01       # of a step by the test increment, about
HALVINGS = 60       # of the test increment, at most, until all laws take it


class Fixed(NamedTuple):
    """What operators are applied to, on n nodes and on the coarse nodes of each level."""

    trial: np.ndarray       # (n, d)  an increment beside the start [m/s]
    probe: np.ndarray       # (n, d)  for the Hessian [m/s]
    load: np.ndarray        # (n, d)  for the V-cycle [kg m/s]
    coarse: tuple           # of (m, d), for each coarse level [m/s]


class Frozen:
    """What a method sees of a system at its start, with the matrix A given."""

    def __init__(self, system, A):
        self.A, self.start, self.index = A, system.start, system.index
        self.kappa, self.n, self.project, self.matrices = (
            system.kappa, system.n, system.project, system.matrices)

    def matrix(self, dv):
        """A."""
        return self.A

    def product(self, dv):
        """u -> A u."""
        return matrix_product(self.A)

    def diagonal(self, dv):
        """Diagonal blocks of A."""
        n, d = self.start.shape
        row = np.repeat(np.arange(n), np.diff(self.A.indptr))
        on, D = row == self.A.indices, np.zeros((n, d, d))
        D[row[on]] = self.A.data[on]
        return D


def draw(system, levels):
    """`Fixed` for a system, whose coarse levels are `levels`."""
    rng, q = np.random.default_rng(SEED), system.unknowns
    speed = STRAIN * q.dx / system.potential.dt
    trial, probe, load = rng.uniform(-1.0, 1.0, (3, *q.v.shape))
    coarse = tuple(times(level.B, rng.uniform(-1.0, 1.0, level.index.shape)) for level in levels)
    trial, probe = speed * system.project(trial), system.project(probe)
    for _ in range(HALVINGS):
        if np.isfinite(system.energy(system.start + trial)):
            break
        trial /= 2
    load = q.m[:, None] * speed * system.project(load)
    return Fixed(system.start + trial, probe, load, coarse)


def times(B, u):
    """B u of blocks (n, d, d)."""
    return np.einsum("nab,nb->na", B, u)


def grids_of(A, index, options):
    """The multigrid hierarchy of a matrix that the options describe."""
    return hierarchy(A, index, options.levels, options.kernel, options.implementation,
                     **options.cycle._asdict())


def prolonged(level, u):
    """P u (n, d) of coarse u (m, d), on either path of multigrid."""
    if hasattr(level, "transfer"):
        return prolong(level.transfer, u.copy())
    return (level.P @ u.reshape(-1)).reshape(level.index.shape)


def direction(system, A, g, options):
    """The first direction at the start of a system, from its gradient and its matrix there."""
    frozen = Frozen(system, A)
    return frozen.project(descent_method(frozen, options, Profiler()).direction(frozen.start, g))


def at_particles(bodies, store, scheme):
    """Weights, and the first nodes that particles reach."""
    grid, seen = scatter(bodies, store, scheme, 0.0), {}
    for body in bodies:
        base, w = kernel_stages.weights(body.particles.x, grid, scheme.stencil)
        seen[f"{body.name}/base"], seen[f"{body.name}/weights"] = base, w
    return seen


def before(problem, bodies, stepper, pose):
    """{key: array} of particles to grid, and of what the step is to solve."""
    q, grid = pose.unknowns, pose.grid
    full = q.number >= 0
    return at_particles(bodies, stepper.storage, problem.scheme) | {
        "nodes": q.index, "mass": q.m, "momentum": grid.v[full], "velocity_old": q.v,
        "projector": q.B, "start": stepper.system(pose).start, "kappa": pose.kappa,
    }


def of_potential(system, fixed):
    """{key: array} of energies, gradients and Hessian products."""
    seen = {}
    for name, dv in (("start", system.start), ("trial", fixed.trial)):
        E, g = system.evaluate(dv)
        seen |= {f"E_{name}": np.array([E]), f"gradient_{name}": g,
                 f"product_{name}": system.product(dv)(fixed.probe)}
    return seen


def of_multigrid(grids, fixed):
    """{key: array} of prolongations, coarse matrices and the V-cycle."""
    seen = {"cycle": grids.cycle(fixed.load)}
    for k, u in enumerate(fixed.coarse, 1):
        fine, level = grids.levels[k - 1 : k + 1]
        seen[f"prolonged{k}"] = prolonged(fine, u)
        seen[f"coarse{k}"] = matrix_product(level.A)(u)
        seen[f"nodes{k}"], seen[f"probe{k}"] = level.index, u
    return seen


def after(problem, bodies, pose, v, dt):
    """{key: array} of grid to particles and deformation, for the nodal velocities v (n, d); the
    bodies advance.
    """
    write_velocities(pose.grid, pose.unknowns, v)
    seen = {}
    for body in bodies:
        kernel_stages.advance(problem, body, pose.grid, dt, seen)
    return seen
