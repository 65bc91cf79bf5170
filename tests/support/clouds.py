"""Random particles on a grid, the transfers to test them with, and their plain twins."""

from math import log
from typing import NamedTuple

import numpy as np

from mpm_ref.body import particles_at, with_separate_gradient
from mpm_ref.core.gimp import gimp_stencil
from mpm_ref.core.grid import Storage
from mpm_ref.core.order import slabs_of
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.transfer import p2g
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.step import Matter, Method, particles_to_grid

DX = 0.11
AFFINE = ("apic", "mls")
SHARE = 0.9                             # that a step leaves, of FLIP and of relaxation
RELAXATION = 0.03 / log(1.0 / SHARE)    # for steps of 0.03 s


class Case(NamedTuple):
    """One specialisation of the transfer kernels."""

    transfer: str
    degree: int
    d: int
    body_force: bool = False
    fluid: bool = False
    relaxed: bool = False
    gimp: float = 0.0

    @property
    def stencil(self):
        return gimp_stencil(self.gimp) if self.gimp else STENCILS[self.degree]

    @property
    def kinks(self):
        """Where slopes have kinks in a cell of stencils, but for its ends [cells]."""
        return (self.stencil.low - 0.5, self.stencil.high - 0.5) if self.gimp else ()

    @property
    def method(self):
        return Method(DX, self.degree, self.transfer, flip=SHARE,
                      relaxation=RELAXATION * self.relaxed, gimp=self.gimp)

    @property
    def separate(self):
        """Whether the grid carries its old velocity, and forces separately."""
        return self.transfer == "flip" or self.relaxed

    @property
    def moment(self):
        return self.method.moment

    @property
    def name(self):
        marks = "-b" * self.body_force + "-fluid" * self.fluid + "-relaxed" * self.relaxed
        marks += f"-gimp{self.gimp:g}" * (self.gimp > 0.0)
        return f"{self.transfer}{self.degree}-{self.d}d{marks}"


# Every transfer and every degree in both dimensions: what is compiled costs seconds. EVERY
# combination runs without compilation, in test_plain_python.
COVER = (
    Case("pic", 1, 2, body_force=True),
    Case("pic", 2, 3),
    Case("flip", 1, 3),
    Case("flip", 3, 2, body_force=True),
    Case("flip", 2, 2, body_force=True, gimp=2.0),
    Case("pic", 2, 3, gimp=1.5),
    Case("apic", 2, 2),
    Case("apic", 3, 3, body_force=True),
    Case("mls", 2, 2, fluid=True),
    Case("mls", 2, 3),
    Case("apic", 3, 2, fluid=True, relaxed=True),
    Case("apic", 2, 3, relaxed=True),
    Case("mls", 2, 2, body_force=True, relaxed=True),
    Case("mls", 3, 3, relaxed=True),
)
EVERY = tuple(
    Case(transfer, degree, d, body_force, fluid, relaxed)
    for transfer in ("pic", "flip", "apic", "mls")
    for degree in ((2, 3) if transfer in AFFINE else (1, 2, 3))
    for d in (2, 3)
    for body_force, fluid in ((False, False), (True, True))
    for relaxed in ((False, True) if transfer in AFFINE else (False,))
) + tuple(
    Case(transfer, 2, d, body_force=both, fluid=both, gimp=2.0)
    for transfer in ("pic", "flip") for d in (2, 3) for both in (False, True)
)


def cloud(case, rng, n=300, width=5.0):
    """n random particles in a box of `width` cells, with random v, C, tau, mass and volume."""
    d = case.d
    x = DX * rng.uniform(-0.4 * width, 0.6 * width, (n, d))
    m, V0 = rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, n) * 1e-2
    q = particles_at(x, rng.normal(size=(n, d)), m, V0, case.transfer, fluid=case.fluid)
    if case.body_force:
        q = q._replace(b=rng.normal(size=(n, d)))
    if case.relaxed:
        q = with_separate_gradient(q)
    if case.transfer in AFFINE:
        q.C[:] = rng.normal(size=(n, d, d)) / DX
    tau = rng.normal(size=q.tau.shape)
    q.tau[:] = tau if case.fluid else tau + np.swapaxes(tau, 1, 2)
    return q


def deep(q):
    """Copy of particles that keeps what is shared."""
    C = q.C.copy()
    L = C if q.L is q.C else q.L.copy()
    return type(q)(*(a.copy() for a in q))._replace(C=C, L=L)


def twin(q, law=None, flow=None, dtype=float):
    """The plain twin of particles."""
    def real(a, carried):
        return a.astype(dtype) if carried else None

    always = {name: getattr(q, name).astype(dtype) for name in ("x", "v", "F", "tau", "m", "V0")}
    return Matter(C=real(q.C, q.C.ndim == 3), y=real(q.y, q.y.ndim == 1),
                  b=real(q.b, q.b.ndim == 2), law=law, flow=flow, **always)


def scattered(case, q, dt):
    """Grid that holds the particles' mass and momentum."""
    store = Storage(DX, case.stencil, case.d, flip=case.separate)
    grid = store.cover([q.x])
    p2g(q, grid, case.stencil, dt, slabs_of(q.x, grid, case.stencil), case.transfer == "mls")
    return grid


def over(grid, a, box):
    """An array over a plain box, put on the nodes of a grid that contains the box."""
    out = np.zeros(grid.m.shape + a.shape[len(box.shape):])
    first = box.first - grid.origin
    out[tuple(slice(k, k + n) for k, n in zip(first, box.shape))] = a
    return out


def plain_grid(case, q, dt, gravity):
    """The plain twin of particles, its pairs, and its nodes."""
    matter = twin(q)
    ip = pairs(matter.x, DX, case.degree, case.gimp)
    return matter, ip, particles_to_grid([matter], [ip], case.method, gravity, dt)
