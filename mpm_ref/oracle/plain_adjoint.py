"""The adjoint of one step of the plain twin, stage by stage backwards.

It is another text than the kernels' adjoint: sums over pairs as in `plain_adjoint_sums`, return
maps and stresses by complex steps (`plain_adjoint_laws`), walls along each axis
(`plain_adjoint_boundary`). A bar is the gradient of a loss by the field of the same name.
"""

from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.step import isotropic
from . import plain_adjoint_laws, plain_adjoint_sums
from .error_bounds import size
from .plain_adjoint_boundary import before_conditions
from .plain_adjoint_sums import GatherBars, ScatteredFields, curved_pairs
from .plain_twin import values_at
from .schema import WHERE


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

    F_trial: np.ndarray
    y: np.ndarray
    F: np.ndarray       # through F_trial alone
    L: np.ndarray
    law: tuple          # of (N,), for each parameter
    flow: tuple


def gradients(twin, done, seeds, gravity_on_empty, nodes):
    """Return {key: array} of all stages backwards of the `TwinStep` `done` of a twin.

    `seeds` has the `Seeds` of each body. Grid arrays are those of the given nodes (M, d).
    """
    pulled = Backwards(twin, done, gravity_on_empty).bars([seed.cast(twin.real) for seed in seeds])
    box = done.stages.nodes.box
    return {key: values_at(a, box, nodes) if WHERE[key.split("/")[-1]] == "nodes" else a
            for key, a in pulled.items()}


class Backwards:
    """The adjoint of a step that a twin made."""

    def __init__(self, twin, done, gravity_on_empty):
        self.twin, self.method, self.done = twin, twin.method, done.stages
        self.particles_before, self.contacts = done.before, done.contacts
        self.gravity_on_empty, self.dt = gravity_on_empty, done.stages.dt
        nodes = self.done.nodes
        self.box, self.D = nodes.box, plain_adjoint_sums.moment(self.method)
        self.pairs = [curved_pairs(ip, self.method) for ip in self.done.stencils]
        self.full = nodes.m > 0
        m = np.where(self.full, nodes.m, 1)
        self.over_m = np.where(self.full, 1 / m, 0)
        self.over = np.where(self.full, 1 / (m + self.method.mass_eps), 0)
        self.v_old = nodes.mv / m[..., None]

    def bars(self, seeds):
        """Return {key: array} of all stages, from `Seeds` of each body; grid arrays lie over the
        box.
        """
        shapes = [self.deformation(k, seed) for k, seed in enumerate(seeds)]
        gathered = [self.gather(seed, shape) for seed, shape in zip(seeds, shapes)]
        v_bar, v_old_bar = self.to_nodes(gathered)
        free = before_conditions(self.done.nodes.v_free, self.contacts, v_bar)
        free = self.twin.with_round_off(free, {i: size(v_bar[i], 0) for i in self.contacts})
        nodes = self.update(free, v_old_bar)
        bars = {"velocity_bc": v_bar, "velocity_old": v_old_bar, "velocity": free, "mass": nodes.m,
                "momentum": nodes.mv, "force": nodes.f, "gravity": self.gravity(free)}
        for k, (name, seed, shape) in enumerate(zip(self.twin.names, seeds, shapes)):
            x = seed.x + self.positions(k, gathered[k])
            own = self.particles(k, nodes, seed, x) | {
                "F_trial": shape.F_trial, "y": shape.y, "L": shape.L, "F_strain": shape.F,
                "x_g2p": x}
            own |= self.material(k, own["tau"], shape)
            bars |= {f"{name}/{field}": a for field, a in own.items()}
        return {f"{key}_grad": a for key, a in bars.items() if a is not None}

    def deformation(self, k, seed):
        """Return the `DeformationBars` of one body."""
        q, L = self.particles_before[k], self.done.motions[k].L
        G = np.eye(L.shape[1], dtype=L.dtype) + self.dt * L
        if q.F.ndim == 1:
            none = tuple(0 * q.m for _ in q.law)
            J_bar, L_bar = plain_adjoint_sums.swollen(G, q.F, seed.F, self.dt)
            return DeformationBars(None, None, J_bar, L_bar, none, ())
        F_trial = self.done.updates[k].F_trial
        back = plain_adjoint_laws.of_return(q, F_trial, self.dt, seed.F, seed.y)
        F_bar, L_bar = plain_adjoint_sums.grown(G, q.F, back.F, self.dt)
        return DeformationBars(back.F, back.y, F_bar, L_bar, back.law, back.flow)

    def gather(self, seed, shape):
        """Return the `GatherBars` of one body."""
        method, mls = self.method, self.method.transfer == "mls"
        u = seed.v + self.dt * seed.x
        lag = method.flip * seed.v if method.transfer == "flip" else None
        L = None if mls else shape.L
        if seed.C is None:
            return GatherBars(u, None, L, lag)
        C = transfer.rpic(seed.C, method.rpic)
        C = C + shape.L if mls else C
        return GatherBars(u, C / transfer.moment(method.dx, method.degree), L, lag)

    def to_nodes(self, gathered):
        """Return the bars of v_i after conditions and, for FLIP, of v_old_i (or None)."""
        both = list(zip(gathered, self.pairs))
        v_bar = sum(plain_adjoint_sums.velocities(bar, ip, self.box) for bar, ip in both)
        if self.method.transfer != "flip":
            return v_bar, None
        return v_bar, sum(plain_adjoint_sums.old_velocities(bar, ip, self.box) for bar, ip in both)

    def update(self, free, v_old_bar):
        """Return the `NodeBars` of mass, momentum and force."""
        v = self.done.nodes.v_free - self.dt * self.twin.gravity
        v = np.where(self.full[..., None], v, 0)
        bars = plain_adjoint_sums.updated(free, self.over, v, self.dt)
        if v_old_bar is None:
            return bars
        return plain_adjoint_sums.with_old(bars, v_old_bar, self.over_m, self.v_old)

    def gravity(self, free):
        """Return the bar of gravity (d,)."""
        on = np.ones_like(self.full) if self.gravity_on_empty else self.full
        return self.dt * free[on].sum(axis=0)

    def positions(self, k, bar):
        """Return what g2p adds to the bar of x of one body."""
        index = transfer.node_index(self.done.stencils[k], self.box)
        v_old = None if bar.lag is None else self.v_old[index]
        return plain_adjoint_sums.positions(bar, self.pairs[k], self.done.nodes.v[index], v_old)

    def particles(self, k, nodes, seed, x):
        """Return {field: array} of what p2g's adjoint leaves in one body; x is the bar of its
        positions from g2p.
        """
        q = self.particles_before[k]
        index, d = transfer.node_index(self.done.stencils[k], self.box), q.x.shape[1]
        tau = isotropic(q.tau, d) if q.tau.ndim == 1 else q.tau
        fields = ScatteredFields(q.m, q.V0, q.v, q.C, tau, q.b)
        new = plain_adjoint_sums.scattered(fields, self.pairs[k],
                                           type(nodes)(*(a[index] for a in nodes)), self.D)
        bars = new._asdict() | {"x": x + new.x}
        if self.method.transfer == "flip":
            bars["v"] = new.v + self.method.flip * seed.v
        if q.tau.ndim == 1:
            bars["tau"] = np.einsum("paa->p", new.tau)
        return bars

    def material(self, k, tau_bar, shape):
        """Return {field: array} of what the stress at the start of the step adds, and of
        parameters.
        """
        q = self.particles_before[k]
        back = plain_adjoint_laws.of_stress(q.F, q.y, (q.law, q.flow), tau_bar)
        law = [a + b for a, b in zip(back.law, shape.law)]
        bars = {"F": shape.F + back.F, "law": np.array([a.sum() for a in law])}
        flow = {"flow": np.array([a.sum() for a in shape.flow])} if shape.flow else {}
        return bars | flow
