"""The adjoint of one step of the plain twin, stage by stage backwards.

It is written independently of the kernels' adjoint: the sums between particles and nodes are those
of `plain_adjoint_transfer`, return maps and stresses are differentiated by complex steps
(`plain_adjoint_laws`), and contact along each axis (below). The bar of a field is the gradient of
the loss by it.
"""

from typing import NamedTuple

import numpy as np

from ..plain import boundary, transfer
from ..plain.step import isotropic
from . import plain_adjoint_laws, plain_adjoint_transfer
from .error_bounds import size
from .plain_adjoint_transfer import GatherBars, ScatteredFields, curved_pairs
from .plain_twin import values_at
from .schema import LOCATION


class Seeds(NamedTuple):
    """Gradient of a loss by the state of one body after the step; None is not carried."""

    x: np.ndarray           # (N, d)
    v: np.ndarray           # (N, d)
    C: np.ndarray | None    # (N, d, d)
    F: np.ndarray           # (N, d, d), or (N,) of J
    y: np.ndarray | None    # (N,)

    def cast(self, real):
        """Return the seeds in a floating type."""
        return Seeds(*(None if a is None else a.astype(real) for a in self))

    def reversed(self):
        """Return the seeds of the particles in reverse order."""
        return Seeds(*(None if a is None else a[::-1] for a in self))


class DeformationBars(NamedTuple):
    """Bars before the deformation of one body; None where there is none."""

    F_trial: np.ndarray | None
    y: np.ndarray | None
    F: np.ndarray       # through F_trial alone
    L: np.ndarray
    law: tuple          # of (N,), for each parameter
    flow: tuple


def gradients(twin, step, seeds, gravity_on_empty, nodes):
    """Return {key: array} of all stages backwards of the `TwinStep` step of a twin.

    `seeds` has the `Seeds` of each body. Grid arrays are those of the given nodes (M, d).
    """
    bars = TwinAdjoint(twin, step, gravity_on_empty).bars([seed.cast(twin.real) for seed in seeds])
    box = step.stages.nodes.box
    return {key: values_at(a, box, nodes) if LOCATION[key.split("/")[-1]] == "nodes" else a
            for key, a in bars.items()}


class TwinAdjoint:
    """The adjoint of a step that a plain twin made."""

    def __init__(self, twin, step, gravity_on_empty):
        self.twin, self.method, self.stages = twin, twin.method, step.stages
        self.particles_before, self.contacts = step.before, step.contacts
        self.gravity_on_empty, self.dt = gravity_on_empty, step.stages.dt
        nodes = self.stages.nodes
        self.box, self.D = nodes.box, plain_adjoint_transfer.mls_moment(self.method)
        self.pairs = [curved_pairs(ip, self.method) for ip in self.stages.stencils]
        self.full = nodes.m > 0
        m = np.where(self.full, nodes.m, 1)
        self.over_m = np.where(self.full, 1 / m, 0)
        self.over = np.where(self.full, 1 / (m + self.method.mass_eps), 0)
        self.v_old = nodes.mv / m[..., None]

    def bars(self, seeds):
        """Return {key: array} of all stages from `Seeds` of each body; grid arrays lie over the
        box.
        """
        shapes = [self.deformation(k, seed) for k, seed in enumerate(seeds)]
        gathered = [self.gather(seed, shape) for seed, shape in zip(seeds, shapes)]
        v_bar, v_old_bar = self.to_nodes(gathered)
        v_free_bar = before_conditions(self.stages.nodes.v_free, self.contacts, v_bar)
        entering = {i: size(v_bar[i], 0) for i in self.contacts}
        v_free_bar = self.twin.with_round_off(v_free_bar, entering)
        nodes = self.update(v_free_bar, v_old_bar)
        bars = {"velocity_bc": v_bar, "velocity_old": v_old_bar, "velocity": v_free_bar,
                "mass": nodes.m, "momentum": nodes.mv, "force": nodes.f,
                "gravity": self.gravity(v_free_bar)}
        for k, (name, seed, shape) in enumerate(zip(self.twin.names, seeds, shapes)):
            x = seed.x + self.positions(k, gathered[k])
            fields = self.particles(k, nodes, seed, x) | {
                "F_trial": shape.F_trial, "y": shape.y, "L": shape.L, "F_strain": shape.F,
                "x_g2p": x}
            fields |= self.material(k, fields["tau"], shape)
            bars |= {f"{name}/{field}": a for field, a in fields.items()}
        return {f"{key}_grad": a for key, a in bars.items() if a is not None}

    def deformation(self, k, seed):
        """Return the `DeformationBars` of body k."""
        q, L = self.particles_before[k], self.stages.motions[k].L
        G = np.eye(L.shape[1], dtype=L.dtype) + self.dt * L
        if q.F.ndim == 1:
            none = tuple(0 * q.m for _ in q.law)
            J_bar, L_bar = plain_adjoint_transfer.volume_adjoint(G, q.F, seed.F, self.dt)
            return DeformationBars(None, None, J_bar, L_bar, none, ())
        F_trial = self.stages.updates[k].F_trial
        back = plain_adjoint_laws.return_map_adjoint(q, F_trial, self.dt, seed.F, seed.y)
        F_bar, L_bar = plain_adjoint_transfer.trial_adjoint(G, q.F, back.F, self.dt)
        return DeformationBars(back.F, back.y, F_bar, L_bar, back.law, back.flow)

    def gather(self, seed, shape):
        """Return the `GatherBars` of one body from its seeds and its `DeformationBars`."""
        method, mls = self.method, self.method.transfer == "mls"
        u = seed.v + self.dt * seed.x
        u_old = method.flip * seed.v if method.transfer == "flip" else None
        L = None if mls else shape.L
        if seed.C is None:
            return GatherBars(u, None, L, u_old)
        C = transfer.rpic(seed.C, method.rpic)
        C = C + shape.L if mls else C
        return GatherBars(u, C / transfer.moment(method.dx, method.degree), L, u_old)

    def to_nodes(self, gathered):
        """Return the bars of v_i after conditions and, for FLIP, of v_old_i (or None)."""
        both = list(zip(gathered, self.pairs))
        v_bar = sum(plain_adjoint_transfer.velocities(bar, ip, self.box) for bar, ip in both)
        if self.method.transfer != "flip":
            return v_bar, None
        return v_bar, sum(plain_adjoint_transfer.old_velocities(bar, ip, self.box)
                          for bar, ip in both)

    def update(self, v_free_bar, v_old_bar):
        """Return the `NodeBars` of mass, momentum and force."""
        v = self.stages.nodes.v_free - self.dt * self.twin.gravity
        v = np.where(self.full[..., None], v, 0)
        bars = plain_adjoint_transfer.update_adjoint(v_free_bar, self.over, v, self.dt)
        if v_old_bar is None:
            return bars
        return plain_adjoint_transfer.add_old_velocity(bars, v_old_bar, self.over_m, self.v_old)

    def gravity(self, v_free_bar):
        """Return the bar of gravity (d,)."""
        falling = np.ones_like(self.full) if self.gravity_on_empty else self.full
        return self.dt * v_free_bar[falling].sum(axis=0)

    def positions(self, k, bar):
        """Return what the adjoint of G2P adds to the bar of x of body k."""
        index = transfer.node_index(self.stages.stencils[k], self.box)
        v_old = None if bar.u_old is None else self.v_old[index]
        return plain_adjoint_transfer.positions(bar, self.pairs[k], self.stages.nodes.v[index],
                                                v_old)

    def particles(self, k, nodes, seed, x):
        """Return {field: array} of what the adjoint of P2G leaves in body k; x is the bar of its
        positions from G2P.
        """
        q = self.particles_before[k]
        index, d = transfer.node_index(self.stages.stencils[k], self.box), q.x.shape[1]
        tau = isotropic(q.tau, d) if q.tau.ndim == 1 else q.tau
        fields = ScatteredFields(q.m, q.V0, q.v, q.C, tau, q.b)
        new = plain_adjoint_transfer.scatter_adjoint(
            fields, self.pairs[k], type(nodes)(*(a[index] for a in nodes)), self.D)
        bars = new._asdict() | {"x": x + new.x}
        if self.method.transfer == "flip":
            bars["v"] = new.v + self.method.flip * seed.v
        if q.tau.ndim == 1:
            bars["tau"] = np.einsum("paa->p", new.tau)
        return bars

    def material(self, k, tau_bar, shape):
        """Return {field: array} of F and the parameters: what the stress at the start of the step
        adds to the `DeformationBars` of body k.
        """
        q = self.particles_before[k]
        back = plain_adjoint_laws.stress_adjoint(q.F, q.y, (q.law, q.flow), tau_bar)
        law = [a + b for a, b in zip(back.law, shape.law)]
        bars = {"F": shape.F + back.F, "law": np.array([a.sum() for a in law])}
        flow = {"flow": np.array([a.sum() for a in shape.flow])} if shape.flow else {}
        return bars | flow


# contact: the branch that `plain.boundary` takes, differentiated along one axis after the other

def before_conditions(v, contacts, bar):
    """Return the bars of the velocities v (.., d) before the conditions, over the box.

    `bar` is that of the velocities after them, contacts are {index of a node: its `Contact`s}.
    """
    out = bar.copy()
    for i, at_node in contacts.items():
        out[i] = contact_jacobian(v[i], at_node).T @ bar[i]
    return out


def contact_jacobian(v, contacts):
    """du/dv (d, d) of u = `plain.boundary.contact_velocity`(v, contacts)."""
    for kinds in (("prescribed",), ("prescribed", "sticky")):
        if boundary.contacts_of_kind(contacts, v, *kinds):
            return np.zeros((len(v), len(v)), v.dtype)
    planes = boundary.active_planes(v, contacts)
    if planes is None:
        return np.zeros((len(v), len(v)), v.dtype)
    return np.stack([friction_slope(v, planes, e) for e in np.eye(len(v), dtype=v.dtype)], axis=1)


def friction_slope(v, planes, e):
    """Return the derivative (d,) of `plain.boundary.apply_friction`(v, planes) along e (d,)."""
    still = [c._replace(v=0 * v) for c in planes]
    u, du = v + boundary.correction(v, planes), e + boundary.correction(e, still)
    loads = boundary.multipliers(v, planes)
    grips = [c.mu * abs(l) for c, l in zip(planes, loads)]
    slopes = boundary.multipliers(e, still)
    dgrips = [c.mu * np.sign(l) * dl for c, l, dl in zip(planes, loads, slopes)]
    grip = sum(grips)
    if not grip > 0:
        return du
    drift = sum(g * c.v for g, c in zip(grips, planes)) / grip
    turning = sum(dg * (c.v - drift) for dg, c in zip(dgrips, planes)) / grip
    t, dt = ((a + boundary.correction(a, still)) for a in (u - drift, du - turning))
    speed = boundary.length(t)
    if grip >= speed:
        return du - dt
    slower = sum(dgrips) / speed - grip * (t @ dt) / speed**3
    return du - grip / speed * dt - slower * t
