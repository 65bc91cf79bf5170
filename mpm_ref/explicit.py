"""One symplectic Euler step of explicit MPM, phase by phase.

    order -> p2g -> grid update -> boundaries -> g2p -> deform (F, return map, stress) -> damp

NSF-alg-mpm with APIC, LDM-alg1 with PIC and NCLAW-alg3 with MLS-MPM are choices of a `Scheme`.
The stress of the particles belongs to their F at the start of a step; `deform` leaves it so for
the next one.
"""

from dataclasses import dataclass
from math import exp, inf

import numpy as np

from .body import AFFINE, check_fit, permute
from .core import corotated, deform
from .core.f_bar import NODES, averaged
from .core.gimp import gimp_stencil
from .core.grid import Storage, update
from .core.law import returned
from .core.order import by_cell, slabs_of
from .core.precision import PRECISIONS, converted
from .core.sparse_grid import SparseStorage
from .core.spline import STENCILS
from .core.transfer import g2p, p2g, rpic
from .materials import NoFlow

TRANSFERS = ("pic", "flip", "apic", "mls")
MOST_PER_CELL = 100     # particles of GIMP per cell and axis: thinner ones are points


@dataclass(frozen=True)
class Scheme:
    """The exchange of momentum between particles and grid.

    degree of the B-spline (1, 2, 3); transfer "pic", "flip", "apic" or "mls"; flip is the share
    of FLIP (1) against PIC (0); rpic in [0, 1] damps the strain rate in C (NSF-rpic); relaxation
    [s] is the time in which v and C of the particles relax to those of the grid, 0 for at once;
    mass_eps [kg] and gravity_on_empty are NCLAW's, the latter without effect on particles; f_bar
    averages the growth of volume over cells, against locking (see `core.f_bar`); gimp, if not 0, is
    the number of particles per cell and axis over whose lengths linear splines are averaged, in
    place of a spline (see `core.gimp`); precision "single" stores and computes in floats of 4
    bytes. Raises ValueError for a combination that does not exist.
    """

    degree: int = 2
    transfer: str = "mls"
    flip: float = 1.0
    rpic: float = 0.0
    relaxation: float = 0.0
    mass_eps: float = 0.0
    gravity_on_empty: bool = False
    f_bar: bool = False
    gimp: float = 0.0
    precision: str = "double"

    def __post_init__(self):
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision = {self.precision!r}: expected one of "
                             f"{', '.join(PRECISIONS)}")
        if self.transfer not in TRANSFERS:
            known = ", ".join(TRANSFERS)
            raise ValueError(f"transfer = {self.transfer!r}: expected one of {known}")
        if self.degree not in STENCILS:
            raise ValueError(f"degree = {self.degree}: expected 1, 2 or 3")
        if self.affine and self.degree == 1:
            raise ValueError(
                f"transfer {self.transfer!r} with degree 1: the moment sum_i w_ip r_ip r_ip^T of "
                "linear splines is singular; take degree 2 or 3, or the transfer 'pic' or 'flip'"
            )
        for name in ("flip", "rpic"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a number in [0, 1]")
        if self.rpic and not self.affine:
            raise ValueError(
                f"rpic = {self.rpic} with transfer {self.transfer!r}: it damps the affine field, "
                "which only apic and mls have"
            )
        if not self.mass_eps >= 0.0:
            raise ValueError(f"mass_eps = {self.mass_eps}: expected a mass >= 0 in kg")
        if self.mass_eps and self.transfer == "flip":
            raise ValueError("mass_eps with transfer 'flip': take it with pic, apic or mls")
        self._check_relaxation()
        self._check_gimp()

    def _check_gimp(self):
        if self.gimp and not 1.0 <= self.gimp <= MOST_PER_CELL:
            raise ValueError(f"gimp = {self.gimp}: expected the number of particles per cell and "
                             f"axis, from 1 to {MOST_PER_CELL}, or 0 for splines")
        if self.gimp and self.degree != 2:
            raise ValueError(f"gimp = {self.gimp} with degree = {self.degree}: it averages linear "
                             "splines, which gives weights of degree 2; leave degree out")
        if self.gimp and self.affine:
            raise ValueError(
                f"gimp = {self.gimp} with transfer {self.transfer!r}: the moment sum_i w_ip r_ip "
                "r_ip^T of GIMP varies with the place in a cell; take the transfer 'pic' or 'flip'"
            )

    def _check_relaxation(self):
        if not 0.0 <= self.relaxation < inf:
            raise ValueError(f"relaxation = {self.relaxation}: expected a time >= 0 in s, such as "
                             "dx/c with the speed c of the fastest wave")
        if self.relaxation and not self.affine:
            raise ValueError(f"relaxation = {self.relaxation} with transfer {self.transfer!r}: it "
                             "belongs to apic and mls; FLIP has its share, flip")
        for name in ("rpic", "mass_eps"):
            if self.relaxation and getattr(self, name):
                raise ValueError(f"relaxation = {self.relaxation} with {name} = "
                                 f"{getattr(self, name)}: these two have no common step; leave one "
                                 "of them out")

    @property
    def real(self):
        """Return the type of the floats of particles and nodes."""
        return PRECISIONS[self.precision]

    @property
    def affine(self):
        """True if particles carry C."""
        return self.transfer in AFFINE

    @property
    def keeps_old_velocity(self):
        """True if the grid carries its velocity before the forces, and these separately."""
        return self.transfer == "flip" or self.relaxation > 0.0

    @property
    def one_gradient(self):
        """True if L and C of the particles are one array."""
        return self.transfer == "mls" and not self.relaxation

    def share(self, dt):
        """Return the share of a particle's own change, against the grid, that a step of dt [s]
        leaves: `flip`, or exp(-dt/relaxation).
        """
        return exp(-dt / self.relaxation) if self.relaxation else self.flip

    @property
    def stencil(self):
        """Offsets (0, .., degree) of the nodes that a particle reaches, per axis, or a `Gimp`."""
        if self.gimp:
            return converted(gimp_stencil(self.gimp), self.real)
        return STENCILS[self.degree]


class Stepper:
    """Advances bodies by explicit steps, reusing grid storage.

    conditions is any object with `apply(grid, t, dt)`, which changes the nodal velocities (see
    `core.boundary`). Its grids may be sparse if it has a `read_distance`, the number of cells from
    a node with mass to the nodes that it reads for this one; else they are dense.
    """

    implicit = False     # whether dt is free of the bounds of waves
    contacts = ()        # of bodies with each other (see `body_contact`)
    report = None        # what a solver says of the last step: nothing was solved

    def __init__(self, scheme, dx, dim, gravity, conditions=None):
        self.scheme, self.dx, self.conditions = scheme, dx, conditions
        self.gravity = np.asarray(gravity, dtype=float)
        if self.gravity.shape != (dim,) or not np.isfinite(self.gravity).all():
            raise ValueError(f"gravity = {gravity}: expected {dim} finite numbers, in m/s^2")
        if not 0.0 < dx < np.inf:
            raise ValueError(f"dx = {dx}: expected a positive, finite length in m")
        self.storage, self.cells = self.new_storage(), SparseStorage(dx, NODES, dim)

    def new_storage(self):
        """Return storage for grids of a step, dense ones where conditions may not be sparse."""
        distance = 0 if self.conditions is None else getattr(self.conditions, "read_distance", None)
        size = self.dx, self.scheme.stencil, len(self.gravity), self.scheme.keeps_old_velocity
        return Storage(*size) if distance is None else SparseStorage(*size, gap=distance)

    def start(self, bodies):
        """Check that the bodies fit the scheme, and compute their stress; needed once, before the
        first step. Raises ValueError with what does not fit.
        """
        for body in bodies:
            check_fit(body, self.scheme, len(self.gravity))
            initial_stress(body)

    def step(self, bodies, t, dt):
        """Advance from time t [s] by dt [s]; returns the grid, which holds m and the new v.
        Changes the bodies in place. Raises ValueError unless dt > 0.
        """
        grid = self.advance_grid(bodies, t, dt)
        self.update_particles(bodies, grid, dt)
        return grid

    def advance_grid(self, bodies, t, dt):
        """Return the grid of the step from time t [s] by dt [s], which holds m and the new v. The
        bodies stay as they are. Raises ValueError unless dt > 0.
        """
        if not 0.0 < dt < np.inf:
            raise ValueError(f"dt = {dt}: expected a positive, finite time in s")
        grid = self.accelerate(bodies, dt)
        self.constrain(grid, t, dt)
        return grid

    def parts(self, grid, bodies):
        """Return pairs of a grid of a step and the bodies that move with it."""
        return [(grid, bodies)]

    def accelerate(self, bodies, dt):
        """Return the grid with the velocities that forces and gravity give it in dt [s]."""
        grid = scatter(bodies, self.storage, self.scheme, dt)
        update(grid, self.gravity, dt, self.scheme.mass_eps, self.scheme.gravity_on_empty)
        return grid

    def constrain(self, grid, t, dt):
        """Apply the conditions to a grid, in the step from time t [s] by dt [s]."""
        if self.conditions is not None:
            self.conditions.apply(grid, t + dt, dt)

    def update_particles(self, bodies, grid, dt):
        """Update the bodies in place from the grid that `advance_grid` returned for them."""
        for body in bodies:
            gather(body, grid, self.scheme, dt)
            deform_body(self.deforming(body, dt), dt)
            damp(body, self.scheme)

    def deforming(self, body, dt):
        """Return the body with the velocity gradient that deforms it, with averaged growth of
        volume for F-bar; all other arrays are the body's own.
        """
        if not self.scheme.f_bar:
            return body
        q = body.particles
        Lbar = averaged(q, self.cells.cover([q.x]), dt)
        return body._replace(particles=q._replace(L=Lbar))

    def sort(self, bodies):
        """Sort every body's particles by cell, for locality; results do not depend on it but for
        round-off.
        """
        grid = self.storage.cover([body.particles.x for body in bodies])
        for body in bodies:
            permute(body, by_cell(body.particles.x, grid, self.scheme.stencil))


def scatter(bodies, store, scheme, dt):
    """Return the mass and momentum (with the impulse of the internal forces over dt) of all bodies
    on a grid that covers them.
    """
    grid = store.cover([body.particles.x for body in bodies])
    dt = converted(dt, grid.v.dtype.type)
    for body in bodies:
        slabs = slabs_of(body.particles.x, grid, scheme.stencil)
        p2g(body.particles, grid, scheme.stencil, dt, slabs, scheme.transfer == "mls")
    return grid


def gather(body, grid, scheme, dt):
    """Update velocity, position and velocity gradient of a body's particles from the grid."""
    dt, share = converted((dt, scheme.share(dt)), grid.v.dtype.type)
    g2p(body.particles, grid, scheme.stencil, dt, share, scheme.transfer == "mls")


def damp(body, scheme):
    """Apply the RPIC damping to the affine field, after the deformation, which under MLS-MPM reads
    the same array: the field of the next step is damped, the strain is not (NSF-rpic).
    """
    if scheme.rpic:
        rpic(body.particles.C, scheme.rpic)


def deform_body(body, dt):
    """Update deformation gradient and stress, with the return map, of a body's particles; only what
    its material needs.
    """
    particles, law, flow, dt, like = deformation(body, dt)
    with_flow = () if isinstance(flow, NoFlow) else (flow,)
    deform_driver(body)(particles, law, *with_flow, dt, like)


def deform_driver(body):
    """Return the loop over particles by which `deform_body` updates a body."""
    q, law, flow = body.particles, body.law, body.flow
    if q.F.ndim == 1:
        return deform.fluid
    if isinstance(flow, NoFlow):
        return corotated.elastic if corotated.fits(law, q.x.shape[1]) else deform.elastic
    if type(flow) in returned.methods:
        return deform.full
    return deform.radial if deform.is_radial(law, flow) else deform.plastic


def deformation(body, dt):
    """Return particles, law, flow, dt and a tuple as long as a position: of single particles all in
    their precision, of others as they are, since learned laws may have layers in single.
    """
    particles, real = body.particles, body.particles.F.dtype.type
    like, numbers = tuple(range(particles.x.shape[1])), (body.law, body.flow, dt)
    if real is np.float64:
        return particles, *numbers, like
    return particles, *converted(numbers, real), tuple(map(real, like))


def initial_stress(body):
    """Compute the Kirchhoff stress of a body's current state."""
    particles, law, flow, _, like = deformation(body, 0.0)
    if particles.F.ndim == 1:
        deform.initial_pressure(particles, law)
    else:
        deform.initial_stress(particles, law, flow, like)
