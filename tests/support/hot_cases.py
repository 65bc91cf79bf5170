"""Random bodies on one grid, as the tests of the implicit step need them, and their plain twins."""

from typing import NamedTuple

import numpy as np
from clouds import DX, twin
from constitutive import LAW, states

from mpm_ref.body import Body, particles_at
from mpm_ref.core.grid import Grid
from mpm_ref.core.mls_slopes import mls_stencil
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.state import NONE
from mpm_ref.hot.potential import Potential
from mpm_ref.hot.system import Unknowns, unknowns_of
from mpm_ref.materials import NoFlow
from mpm_ref.plain import transfer
from mpm_ref.plain.spline import pairs

DT = 0.3
SPEED = 0.1 * DX / DT       # strains of a step are about 0.1


class Case(NamedTuple):
    """Dimension, degree of the splines, the law of each body, and whether slopes are those of the
    MLS form; bodies overlap.
    """

    d: int
    degree: int
    laws: tuple
    mls: bool = False

    @property
    def name(self):
        form = "mls-" * self.mls
        return f"{self.d}d-{form}degree{self.degree}-" + "-".join(self.laws)

    @property
    def stencil(self):
        return mls_stencil(self.degree) if self.mls else STENCILS[self.degree]

    def pairs(self, x):
        """Pairs of particles and nodes, with D^-1 w_ip r_ip for dw_ip in the MLS form."""
        ip = pairs(x, DX, self.degree)
        D = DX**2 * (self.degree + 1) / 12
        return ip._replace(dw=ip.w[..., None] * ip.r / D) if self.mls else ip


# What is compiled costs seconds: each law once, the paper's one in both dimensions.
CASES = (
    Case(2, 2, ("fixed_corotated", "neo_hookean")),
    Case(3, 2, ("hencky", "fluid")),
    Case(3, 2, ("fixed_corotated",)),
)
DEGREES = (Case(2, 1, ("fixed_corotated",)), Case(2, 3, ("fixed_corotated",)))
MLS = (Case(2, 2, ("fixed_corotated", "neo_hookean"), mls=True),
       Case(2, 3, ("fixed_corotated",), mls=True), Case(3, 2, ("fixed_corotated",), mls=True))


class Problem(NamedTuple):
    """A potential, and what it was made of."""

    potential: Potential
    bodies: tuple
    unknowns: Unknowns
    grid: Grid
    gravity: np.ndarray
    dv: np.ndarray          # (n, d), random
    w: np.ndarray           # (n, d), another one


def body_of(name, d, rng, spread=0.2, length=2.5):
    """A strained body of random particles in a box of 2.5 cells, or longer on the first axis."""
    n = round(12 * length)
    x = rng.uniform(0.0, 2.5, (n, d))
    x[:, 0] *= length / 2.5
    x = DX * (x - 3.0)
    m, V0 = rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, n) * 1e-2
    q = particles_at(x, np.zeros((n, d)), m, V0, "pic", fluid=name == "fluid")
    F = states(rng, n, d, spread)
    q.F[:] = np.linalg.det(F) if name == "fluid" else F
    return Body(name, q, LAW[name], NoFlow(), np.arange(n))


def grid_of(bodies, degree, rng):
    """The mass of all bodies, and random velocities of size SPEED, on a box with a rim to spare."""
    stencils = [pairs(body.particles.x, DX, degree) for body in bodies]
    box = transfer.box_of(*stencils)
    box = transfer.NodeBox(box.first - 1, tuple(k + 2 for k in box.shape))
    m = sum(transfer.mass(b.particles.m, ip, box) for b, ip in zip(bodies, stencils))
    v = SPEED * rng.normal(size=(*box.shape, len(box.shape)))
    return Grid(m, m[..., None] * v, NONE, NONE, np.array(box.first), DX)


def coarser_unknowns(problem, degree, level):
    """The unknowns of a problem's particles on a grid of 2^level times the spacing, at rest."""
    dx = 2**level * DX
    stencils = [pairs(body.particles.x, dx, degree) for body in problem.bodies]
    box = transfer.box_of(*stencils)
    m = sum(transfer.mass(b.particles.m, ip, box) for b, ip in zip(problem.bodies, stencils))
    v = np.zeros((*box.shape, len(box.shape)))
    return unknowns_of(Grid(m, v, NONE, NONE, np.array(box.first), dx))


def problem_of(case, spread=0.2, length=2.5):
    """A `Problem` of a case: strains of size `spread`, bodies of `length` cells."""
    rng = np.random.default_rng(0)
    bodies = tuple(body_of(name, case.d, rng, spread, length) for name in case.laws)
    for k, body in enumerate(bodies):
        body.particles.x[:, 0] += k * DX
    grid = grid_of(bodies, case.degree, rng)
    unknowns = unknowns_of(grid)
    gravity = rng.normal(size=case.d) * SPEED / DT
    dv, w = SPEED * rng.normal(size=(2, *unknowns.v.shape))
    potential = Potential(bodies, unknowns, case.stencil, DT, gravity)
    return Problem(potential, bodies, unknowns, grid, gravity, dv, w)


def over(problem, u):
    """A nodal field (n, d) as an array over the box."""
    out = np.zeros(problem.grid.v.shape)
    out[problem.unknowns.number >= 0] = u
    return out


def plain_bodies(problem, case):
    """Particles, pairs and box for `plain.potential`."""
    box = transfer.NodeBox(problem.grid.origin, problem.grid.m.shape)
    return [(twin(b.particles, b.law), case.pairs(b.particles.x), box) for b in problem.bodies]
