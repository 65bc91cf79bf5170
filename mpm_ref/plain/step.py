"""One step of explicit MPM (NSF-alg-mpm), from the functions of the other modules:

1. P2G: mass, momentum and force of the particles, with the stress of their F, go to the nodes.
2. Grid: the nodes' velocities advance by explicit Euler, and contact changes them.
3. G2P: particles take velocity, position, affine field C and velocity gradient L from the nodes.
4. Deformation: F_trial = (I + dt L) F, the return map of the material, and the new stress tau. With
   F-bar, L is changed so that volumes grow by their mean over cells.
"""

from typing import NamedTuple

import numpy as np

from . import transfer
from .f_bar import averaged
from .flows import intact, return_map
from .laws import energy, kirchhoff
from .spline import pairs
from .tensors import det


class Matter(NamedTuple):
    """The N material points of one body, with its law and flow; C, y, b are None if not carried."""

    x: np.ndarray           # (N, d)     position [m]
    v: np.ndarray           # (N, d)     velocity [m/s]
    C: np.ndarray | None    # (N, d, d)  affine velocity field [1/s]
    F: np.ndarray           # (N, d, d)  elastic deformation gradient; (N,) of J in a fluid
    tau: np.ndarray         # (N, d, d)  Kirchhoff stress [Pa]; (N,) in a fluid, isotropic
    m: np.ndarray           # (N,)       mass [kg]
    V0: np.ndarray          # (N,)       volume at rest [m^d]
    y: np.ndarray | None    # (N,)       plastic history
    b: np.ndarray | None    # (N, d)     body force per mass [m/s^2]
    law: tuple              # record of the elastic law's parameters
    flow: tuple             # record of the plastic flow's parameters

    def cast(self, real):
        """Return the material points with arrays of the floating type `real`."""
        return self._replace(**{name: a.astype(real) for name, a in self._asdict().items()
                                if isinstance(a, np.ndarray)})


class Method(NamedTuple):
    """The grid, the spline and the transfer of a step, as in `explicit.Scheme`."""

    dx: float               # grid spacing [m]
    degree: int             # of the B-splines
    transfer: str           # "pic", "flip", "apic" or "mls"
    flip: float = 1         # share of FLIP, see `transfer.flip`
    rpic: float = 0         # damping, see `transfer.rpic`
    relaxation: float = 0   # time in which v and C relax to the grid [s]; 0: in each step
    mass_eps: float = 0     # see `transfer.grid_velocity` [kg]
    f_bar: bool = False     # whether volumes are averaged, see `f_bar`
    gimp: float = 0         # particles per cell and axis of GIMP, see `gimp`; 0: B-splines

    @property
    def moment(self):
        """Return D [m^2], the second moment of the weights (see `transfer.moment`)."""
        return transfer.moment(self.dx, self.degree)


class Nodes(NamedTuple):
    """Nodal fields of one step, arrays over `box`."""

    box: transfer.NodeBox
    m: np.ndarray          # (..)     mass [kg]
    mv: np.ndarray         # (.., d)  momentum [kg m/s]
    f: np.ndarray          # (.., d)  force [N]
    v_free: np.ndarray     # (.., d)  velocity before the boundary conditions [m/s]
    v: np.ndarray          # (.., d)  velocity after them [m/s]


class ParticleMotion(NamedTuple):
    """New velocity, position and velocity gradients that the particles of a body gather."""

    v: np.ndarray           # (N, d)
    x: np.ndarray           # (N, d)
    C: np.ndarray | None    # (N, d, d)  after the damping of RPIC
    L: np.ndarray           # (N, d, d)


class ConstitutiveUpdate(NamedTuple):
    """Deformation, plastic history and stress of a body that follow from its velocity gradient."""

    F_trial: np.ndarray     # (N, d, d), or (N,)
    F: np.ndarray           # (N, d, d), or (N,)
    y: np.ndarray | None    # (N,)
    tau: np.ndarray         # (N, d, d), or (N,)


class StepStages(NamedTuple):
    """All intermediate results of one step; the lists have one entry for each body."""

    stencils: list          # of `spline.Pairs`
    nodes: Nodes
    motions: list           # of `ParticleMotion`
    updates: list           # of `ConstitutiveUpdate`
    dt: float               # [s]


def step(bodies, method, gravity, dt, conditions=None):
    """Return the `StepStages` of one step of length dt [s] of a list of `Matter`.

    gravity is (d,) [m/s^2]; conditions(v, m, box) returns the nodal velocities that satisfy the
    boundary conditions. `new_state` gives each body at the end of the step.
    """
    stencils = [pairs(q.x, method.dx, method.degree, method.gimp) for q in bodies]
    nodes = particles_to_grid(bodies, stencils, method, gravity, dt)
    if conditions is not None:
        nodes = nodes._replace(v=conditions(nodes.v_free, nodes.m, nodes.box))
    motions = [grid_to_particles(q, ip, nodes, method, dt) for q, ip in zip(bodies, stencils)]
    updates = [deform(q, deforming(q, motion, method, dt), dt)
               for q, motion in zip(bodies, motions)]
    return StepStages(stencils, nodes, motions, updates, dt)


def new_state(q, motion, update):
    """Return a body at the end of a step, from its `ParticleMotion` and `ConstitutiveUpdate`."""
    return q._replace(x=motion.x, v=motion.v, C=motion.C, F=update.F, y=update.y, tau=update.tau)


def particles_to_grid(bodies, stencils, method, gravity, dt):
    """Return the `Nodes` with mass, momentum and force of all bodies, and the new velocity."""
    box = transfer.box_of(*stencils)
    both = list(zip(bodies, stencils))
    m = sum(transfer.mass(q.m, ip, box) for q, ip in both)
    mv = sum(transfer.momentum(q.m, q.v, q.C, ip, box) for q, ip in both)
    f = sum(force(q, ip, method, box) for q, ip in both)
    v = transfer.grid_velocity(m, mv, f, gravity, dt, method.mass_eps)
    return Nodes(box, m, mv, f, v, v)


def force(q, ip, method, box):
    """Return the internal and body forces (.., d) [N] of one body on the nodes."""
    tau = isotropic(q.tau, q.x.shape[1]) if q.tau.ndim == 1 else q.tau
    if method.transfer == "mls":
        f = transfer.internal_force_mls(q.V0, tau, method.moment, ip, box)
    else:
        f = transfer.internal_force(q.V0, tau, ip, box)
    return f if q.b is None else f + transfer.body_force(q.m, q.b, ip, box)


def isotropic(s, d):
    """Return s I (N, d, d) of s (N,)."""
    return s[:, None, None] * np.eye(d, dtype=s.dtype)


def grid_to_particles(q, ip, nodes, method, dt):
    """Return the `ParticleMotion` of one body, with x' = x + dt sum_i w_ip v_i.

    APIC and MLS-MPM carry C, and MLS-MPM takes it for the velocity gradient L as well.
    """
    if method.relaxation:
        return relaxed_motion(q, ip, nodes, method, dt)
    v, box = transfer.velocity(nodes.v, ip, nodes.box), nodes.box
    x, C, L = q.x + dt * v, None, transfer.velocity_gradient(nodes.v, ip, box)
    if method.transfer in ("apic", "mls"):
        C = transfer.affine(nodes.v, method.moment, ip, box)
        L = C if method.transfer == "mls" else L
        C = transfer.rpic(C, method.rpic)
    if method.transfer == "flip":
        v_old = transfer.velocity(old_velocity(nodes), ip, box)
        v = transfer.flip(q.v, v, v_old, method.flip)
    return ParticleMotion(v, x, C, L)


def old_velocity(nodes):
    """Return the nodal velocities before the forces (.., d) [m/s]; 0 where there is no mass."""
    return nodes.mv / np.where(nodes.m > 0, nodes.m, 1)[..., None]


def relaxed_motion(q, ip, nodes, method, dt):
    """Return the `ParticleMotion` of one body whose v and C relax to the grid in a time.

    What a particle has beyond the grid, v - u_old and C - C_old, is multiplied by
    exp(-dt/relaxation); the spin of C makes up for a shift dt u that is not along v.
    """
    box, share, D = nodes.box, np.exp(-dt / method.relaxation), method.moment
    u, u_old = (transfer.velocity(v, ip, box) for v in (nodes.v, old_velocity(nodes)))
    affine = tuple(transfer.affine(v, D, ip, box) for v in (nodes.v, old_velocity(nodes)))
    v = transfer.flip(q.v, u, u_old, share)
    spin = transfer.shift_spin(dt * u, v - u)
    L = affine[0] if method.transfer == "mls" else transfer.velocity_gradient(nodes.v, ip, box)
    return ParticleMotion(v, q.x + dt * u, transfer.relaxed_affine(q.C, affine, D, share, spin), L)


def deforming(q, motion, method, dt):
    """Return the velocity gradient (N, d, d) that deforms a body (see `f_bar`)."""
    if not method.f_bar:
        return motion.L
    return averaged(motion, q.V0, method.dx, dt)


def deform(q, L, dt):
    """Return the `ConstitutiveUpdate` of one body under the velocity gradient L (N, d, d)."""
    F_trial = trial_deformation(q.F, L, dt)
    F, y = return_map(F_trial, q.y, dt, q.law, q.flow)
    return ConstitutiveUpdate(F_trial, F, y, stress(F, y, q))


def trial_deformation(F, L, dt):
    """F_trial = (I + dt L) F (LDM-sec2.2-Frate); of a fluid its determinant, det(I + dt L) J."""
    growth = np.eye(L.shape[1], dtype=L.dtype) + dt * L
    return det(growth) * F if F.ndim == 1 else growth @ F


def stress(F, y, q):
    """Return tau of the law (see `laws.kirchhoff`), and 0 where a softening material has failed."""
    tau = kirchhoff(F, q.law)
    return tau if q.y is None else tau * intact(y, q.flow)[:, None, None]


def energies(q, method, gravity):
    """Return the kinetic, elastic and gravitational energy of one body [J], an array (3,).

    sum_p m_p |v_p|^2/2 + D m_p |C_p|^2/2,  sum_p V0_p psi(F_p),  -sum_p m_p g . x_p
    """
    kinetic = (q.m * (q.v**2).sum(axis=1)).sum() / 2
    if q.C is not None:
        kinetic = kinetic + method.moment * (q.m * (q.C**2).sum(axis=(1, 2))).sum() / 2
    psi = energy(q.F, q.law)
    factor = 1 if q.y is None else intact(q.y, q.flow)
    height = (q.x * gravity).sum(axis=1)
    return np.stack([kinetic, (q.V0 * factor * psi).sum(), -(q.m * height).sum()])
