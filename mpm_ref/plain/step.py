"""One step of explicit MPM, from the functions of `transfer`, `laws`, `flows` and `walls`:

tau(F) given -> p2g -> velocity -> boundaries -> g2p -> F trial -> return map -> stress
"""

from typing import NamedTuple

import numpy as np

from . import transfer
from .flows import intact, project
from .laws import energy, kirchhoff
from .spline import pairs
from .tensors import det


class Matter(NamedTuple):
    """Particles of one material; the fields are those of `core.state`.

    C, y, b are None where they are not carried; F and tau have shape (N,) in a fluid.
    """

    x: np.ndarray
    v: np.ndarray
    C: np.ndarray | None
    F: np.ndarray
    tau: np.ndarray
    m: np.ndarray
    V0: np.ndarray
    y: np.ndarray | None
    b: np.ndarray | None
    law: tuple
    flow: tuple

    def cast(self, real):
        """Return the particles in another floating type."""
        return self._replace(**{name: a.astype(real) for name, a in self._asdict().items()
                                if isinstance(a, np.ndarray)})


class Method(NamedTuple):
    """Spacing [m], degree of the spline, transfer and its options, as in `explicit.Scheme`."""

    dx: float
    degree: int
    transfer: str
    flip: float = 1
    rpic: float = 0
    mass_eps: float = 0

    @property
    def moment(self):
        """D, the moment of the weights [m^2]."""
        return transfer.moment(self.dx, self.degree)


class Nodes(NamedTuple):
    """What the grid holds in one step, as arrays over `box`."""

    box: transfer.Box
    m: np.ndarray
    mv: np.ndarray
    f: np.ndarray
    v_free: np.ndarray     # velocity before boundary conditions
    v: np.ndarray          # and after


class Moved(NamedTuple):
    """What the particles of one body get from the grid."""

    v: np.ndarray
    x: np.ndarray
    C: np.ndarray | None
    L: np.ndarray


class Deformed(NamedTuple):
    """What follows from the velocity gradient."""

    F_trial: np.ndarray
    F: np.ndarray
    y: np.ndarray | None
    tau: np.ndarray


class Step(NamedTuple):
    """Every stage of one step; the lists have one entry per body."""

    clouds: list        # of Pairs
    nodes: Nodes
    moved: list         # of Moved
    deformed: list      # of Deformed
    dt: float           # [s]


def step(bodies, method, gravity, dt, conditions=None):
    """One step of length dt [s] of a list of `Matter`: its stages, as a `Step`.

    gravity is (d,) [m/s^2]; conditions(v, m, box) returns the velocities that satisfy the boundary
    conditions.
    """
    clouds = [pairs(q.x, method.dx, method.degree) for q in bodies]
    nodes = to_grid(bodies, clouds, method, gravity, dt)
    if conditions is not None:
        nodes = nodes._replace(v=conditions(nodes.v_free, nodes.m, nodes.box))
    moved = [to_particles(q, ip, nodes, method, dt) for q, ip in zip(bodies, clouds)]
    deformed = [deform(q, new.L, dt) for q, new in zip(bodies, moved)]
    return Step(clouds, nodes, moved, deformed, dt)


def after(q, moved, deformed):
    """A body after the step."""
    return q._replace(x=moved.x, v=moved.v, C=moved.C,
                      F=deformed.F, y=deformed.y, tau=deformed.tau)


def to_grid(bodies, clouds, method, gravity, dt):
    """Mass, momentum and force of all bodies, and the velocity they give the nodes."""
    box = transfer.box_of(*clouds)
    both = list(zip(bodies, clouds))
    m = sum(transfer.mass(q.m, ip, box) for q, ip in both)
    mv = sum(transfer.momentum(q.m, q.v, q.C, ip, box) for q, ip in both)
    f = sum(force(q, ip, method, box) for q, ip in both)
    v = transfer.grid_velocity(m, mv, f, gravity, dt, method.mass_eps)
    return Nodes(box, m, mv, f, v, v)


def force(q, ip, method, box):
    """Internal and body forces of one body on the nodes."""
    tau = isotropic(q.tau, q.x.shape[1]) if q.tau.ndim == 1 else q.tau
    if method.transfer == "mls":
        f = transfer.internal_force_mls(q.V0, tau, method.moment, ip, box)
    else:
        f = transfer.internal_force(q.V0, tau, ip, box)
    return f if q.b is None else f + transfer.body_force(q.m, q.b, ip, box)


def isotropic(s, d):
    """s I (N, d, d)."""
    return s[:, None, None] * np.eye(d, dtype=s.dtype)


def to_particles(q, ip, nodes, method, dt):
    """New velocity, position and velocity gradient of one body."""
    v, box = transfer.velocity(nodes.v, ip, nodes.box), nodes.box
    x, C, L = q.x + dt * v, None, transfer.velocity_gradient(nodes.v, ip, box)
    if method.transfer in ("apic", "mls"):
        C = transfer.affine(nodes.v, method.moment, ip, box)
        L = C if method.transfer == "mls" else L
        C = transfer.rpic(C, method.rpic)
    if method.transfer == "flip":
        v_old = nodes.mv / np.where(nodes.m > 0, nodes.m, 1)[..., None]
        v = transfer.flip(q.v, v, transfer.velocity(v_old, ip, box), method.flip)
    return Moved(v, x, C, L)


def deform(q, L, dt):
    """Trial deformation, return map and stress of one body."""
    F_trial = grown(q.F, L, dt)
    F, y = project(F_trial, q.y, dt, q.law, q.flow)
    return Deformed(F_trial, F, y, stress(F, y, q))


def grown(F, L, dt):
    """F trial = (I + dt L) F (LDM-sec2.2-Frate); of a fluid its determinant det(I + dt L) J."""
    growth = np.eye(L.shape[1], dtype=L.dtype) + dt * L
    return det(growth) * F if F.ndim == 1 else growth @ F


def stress(F, y, q):
    """tau of the law where the material is whole, 0 where it has failed."""
    tau = kirchhoff(F, q.law)
    return tau if q.y is None else tau * intact(y, q.flow)[:, None, None]


def energies(q, method, gravity):
    """Kinetic, elastic and gravitational energy of one body [J], as an array (3,)."""
    kinetic = (q.m * (q.v**2).sum(axis=1)).sum() / 2
    if q.C is not None:
        kinetic = kinetic + method.moment * (q.m * (q.C**2).sum(axis=(1, 2))).sum() / 2
    psi = energy(q.F, q.law)
    whole = 1 if q.y is None else intact(q.y, q.flow)
    height = (q.x * gravity).sum(axis=1)
    return np.stack([kinetic, (q.V0 * whole * psi).sum(), -(q.m * height).sum()])
