"""The adjoint of one step of the plain twin, stage by stage backwards, with the scale of each bar.

Every stage is computed from values, and once more from values with scales (see `rough`). What
enters it has the scale that it was found with: the arrays of the step those of `scaling`, bars that
of the stage before. Seeds are exact, and rounded.
"""

from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.step import isotropic
from . import adjoint_boundary, adjoint_sums, scales
from .adjoint_clouds import cloud
from .adjoint_material import returned, stressed
from .adjoint_sums import Gathered, Scattered
from .known import Known, given, known, total
from .scales import size
from .scaling import EPS


class Deformed(NamedTuple):
    """Bars that the deformation of one body hands on, `Known`; None where there is none."""

    F_trial: Known
    y: Known
    F: Known        # through F_trial alone
    L: Known
    law: tuple      # of (N,), for each parameter
    flow: tuple


class Stage(NamedTuple):
    """A step of a `Twin` that was made: from `before`, with the scales `found` of its arrays."""

    twin: object
    before: list        # of Matter
    done: object        # Step
    found: dict         # {key: scale}, grid arrays over the box
    errors: list        # see `scales.inputs`
    contacts: dict      # by the node's index in the box
    on_empty: bool      # whether gravity is that of nodes without mass too


class Backwards:
    """The adjoint of a `Stage`."""

    def __init__(self, stage):
        self.stage, self.method, self.dt = stage, stage.twin.method, stage.done.dt
        self.box, self.D = stage.done.nodes.box, adjoint_sums.moment(self.method)
        self.inputs = [scales.inputs(q, e, EPS) for q, e in zip(stage.before, stage.errors)]
        self.clouds = [cloud(ip, self.method, S.x) for ip, S in zip(stage.done.clouds, self.inputs)]
        nodes, found = stage.done.nodes, stage.found
        self.full = nodes.m > 0
        m, S_m = np.where(self.full, nodes.m, 1), found["mass"]
        self.over = [given(np.where(self.full, 1 / a, 0), np.where(self.full, S_m / a**2, 0))
                     for a in (m, m + self.method.mass_eps)]
        self.v = given(nodes.v, found["velocity_bc"])
        self.v_old = given(nodes.mv / m[..., None], found["swing"] / m)

    def seen(self, seeds):
        """{key: `Known`} of all stages, from `Seeds` of each body; grid arrays lie over the box."""
        names = self.stage.twin.names
        shapes = [self.deformed(k, seed) for k, seed in enumerate(seeds)]
        bars = [self.gathered(seed, shape) for seed, shape in zip(seeds, shapes)]
        of_v, of_v_old = self.to_nodes(bars)
        free = self.conditioned(of_v)
        nodes = self.updated(free, of_v_old)
        found = {"velocity_bc": of_v, "velocity_old": of_v_old, "velocity": free, "mass": nodes.m,
                 "momentum": nodes.mv, "force": nodes.f, "gravity": self.of_gravity(free)}
        for k, (name, seed, shape) in enumerate(zip(names, seeds, shapes)):
            moved = total([given(seed.x), self.positions(k, bars[k])])
            own = self.particles(k, nodes, seed, moved) | {
                "F_trial": shape.F_trial, "y": shape.y, "L": shape.L, "F_strain": shape.F,
                "x_g2p": moved}
            own |= self.material(k, own["tau"], shape)
            found |= {f"{name}/{field}": a for field, a in own.items()}
        return {f"{key}_grad": a for key, a in found.items() if a is not None}

    def deformed(self, k, seed):
        """`Deformed` of one body."""
        q, step, name = self.stage.before[k], self.stage.done, self.stage.twin.names[k]
        L, F = step.moved[k].L, given(q.F, self.inputs[k].F)
        G = given(np.eye(L.shape[1], dtype=L.dtype) + self.dt * L,
                  1 + self.dt * self.stage.found[f"{name}/L"])
        if q.F.ndim == 1:
            none = tuple(given(0 * q.m) for _ in q.law)
            J_bar, L_bar = known(adjoint_sums.swollen, G, F, given(seed.F), self.dt)
            return Deformed(None, None, J_bar, L_bar, none, ())
        F_trial = step.deformed[k].F_trial, self.stage.found[f"{name}/F_trial"]
        back = returned(q, F_trial, self.dt, seed)
        F_bar, L_bar = known(adjoint_sums.grown, G, F, back.F, self.dt)
        return Deformed(back.F, back.y, F_bar, L_bar, back.law, back.flow)

    def gathered(self, seed, shape):
        """`Gathered` of one body, `Known`."""
        method, mls = self.method, self.method.transfer == "mls"
        u = given(seed.v + self.dt * seed.x, size(seed.v) + self.dt * size(seed.x))
        lag = given(method.flip * seed.v) if method.transfer == "flip" else None
        L = None if mls else shape.L
        if seed.C is None:
            return Gathered(u, None, L, lag)
        C = given(transfer.rpic(seed.C, method.rpic), size(seed.C))
        C = total([C, shape.L]) if mls else C
        D = transfer.moment(method.dx, method.degree)
        return Gathered(u, Known(C.value / D, C.S / D), L, lag)

    def to_nodes(self, bars):
        """Bars of v_i after conditions and, for FLIP, of v_old_i (or None)."""
        both = list(zip(bars, self.clouds))
        of_v = total([known(adjoint_sums.velocities, bar, ip, self.box) for bar, ip in both])
        if self.method.transfer != "flip":
            return of_v, None
        return of_v, total([known(adjoint_sums.old_velocities, bar, ip, self.box)
                            for bar, ip in both])

    def conditioned(self, of_v):
        """Bars of v_i before the conditions."""
        v, d = self.stage.done.nodes.v_free, len(self.box.shape)
        value, S = adjoint_boundary.before(v, self.stage.found["velocity"], self.stage.contacts,
                                        (of_v.value, size(of_v.S, d)))
        return given(value, S)

    def updated(self, free, of_v_old):
        """`OfNodes`, `Known`."""
        over_m, over = self.over
        pull = self.stage.done.nodes.v_free - self.dt * self.stage.twin.gravity
        v = given(np.where(self.full[..., None], pull, 0), self.stage.found["velocity"])
        of = known(adjoint_sums.updated, free, over, v, self.dt)
        if of_v_old is None:
            return of
        return known(adjoint_sums.with_old, of, of_v_old, over_m, self.v_old)

    def of_gravity(self, free):
        """The bar of gravity (d,), `Known`."""
        on = np.ones_like(self.full) if self.stage.on_empty else self.full
        return Known(*(self.dt * a[on].sum(axis=0) for a in free))

    def positions(self, k, bar):
        """What g2p adds to the bar of x of one body."""
        at = transfer.at(self.stage.done.clouds[k], self.box)
        v_old = None if bar.lag is None else self.v_old.at(at)
        return known(adjoint_sums.positions, bar, self.clouds[k], self.v.at(at), v_old)

    def particles(self, k, nodes, seed, moved):
        """{field: `Known`} of what p2g's adjoint leaves in one body."""
        q, S = self.stage.before[k], self.inputs[k]
        at, d = transfer.at(self.stage.done.clouds[k], self.box), q.x.shape[1]
        tau = isotropic(q.tau, d) if q.tau.ndim == 1 else q.tau
        what = Scattered(given(q.m), given(q.V0), given(q.v, S.v),
                         None if q.C is None else given(q.C, S.C), given(tau, S.tau),
                         None if q.b is None else given(q.b))
        new = known(adjoint_sums.scattered, what, self.clouds[k],
                    type(nodes)(*(a.at(at) for a in nodes)), self.D)
        found = new._asdict() | {"x": total([moved, new.x])}
        if self.method.transfer == "flip":
            found["v"] = total([new.v, given(self.method.flip * seed.v)])
        if q.tau.ndim == 1:
            found["tau"] = Known(*(np.einsum("paa->p", a) for a in new.tau))
        return found

    def material(self, k, tau_bar, shape):
        """{field: `Known`} of what the stress at the start of the step adds, and of parameters."""
        q = self.stage.before[k]
        of = stressed(q, self.inputs[k].F, tau_bar)
        law = [total(pair) for pair in zip(of.law, shape.law)]
        found = {"F": total([shape.F, of.F]), "law": summed(law)}
        return found | ({"flow": summed(shape.flow)} if shape.flow else {})


def summed(parts):
    """Sums over particles of a list of `Known`, as one."""
    return Known(*(np.array([a.sum() for a in column]) for column in zip(*parts)))
