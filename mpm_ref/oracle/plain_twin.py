"""The same stages by the plain twin, in extended precision, carried on from its own states."""

import numpy as np

from ..plain import boundary
from ..plain.laws import kirchhoff
from ..plain.step import Matter, Method, after, energies, step, stress

REAL = np.longdouble


class Twin:
    """The plain twin of a problem: it starts from the same numbers and goes its own way."""

    def __init__(self, problem, real=REAL):
        self.real, self.clip = real, problem.clip
        self.gravity = problem.gravity.astype(real)
        self.method = method(problem, real)
        self.names = [body.name for body in problem.bodies]
        self.bodies = [matter(body, real) for body in problem.bodies]

    def step(self, dt, nodes, contacts):
        """Advance by dt [s]: what was seen, with grid arrays on the given nodes, and the `Step`."""
        def conditions(v, m, box):
            return boundary.conditioned(v, placed(contacts, box, self.real))

        done = step(self.bodies, self.method, self.gravity, self.real(dt), conditions)
        done = done._replace(moved=[self.clipped(new) for new in done.moved])
        self.bodies = [after(*body) for body in zip(self.bodies, done.moved, done.deformed)]
        return self.seen(done, nodes), done

    def clipped(self, new):
        """Positions kept inside the box of the problem, if it has one."""
        return new if self.clip is None else new._replace(x=np.clip(new.x, *self.clip))

    def seen(self, done, nodes):
        """{key: array} of a step, as `stages.step` returns it."""
        grid = done.nodes
        fields = {"mass": grid.m, "momentum": grid.mv, "force": grid.f,
                  "velocity": grid.v_free, "velocity_bc": grid.v}
        seen = {name: on(a, grid.box, nodes) for name, a in fields.items()}
        for k, name in enumerate(self.names):
            new, shape = done.moved[k], done.deformed[k]
            own = {"base": done.clouds[k].node[:, 0], "weights": done.clouds[k].w,
                   "v": new.v, "x": new.x, "C": new.C, "L": new.L, "F": shape.F,
                   "F_trial": shape.F_trial if shape.F.ndim == 3 else None,
                   "y": shape.y, "tau": shape.tau,
                   "energy": energies(self.bodies[k], self.method, self.gravity)}
            seen |= {f"{name}/{field}": a for field, a in own.items() if a is not None}
        return seen


def method(problem, real):
    """`Method` of the problem's scheme."""
    s = problem.scheme
    return Method(real(problem.dx), s.degree, s.transfer,
                  real(s.flip), real(s.rpic), real(s.mass_eps))


def matter(body, real):
    """`Matter` of a body, with the stress of its F."""
    q = body.particles

    def cast(a, carried=True):
        return a.astype(real) if carried else None

    F, y = cast(q.F), cast(q.y, q.y.ndim == 1)
    twin = Matter(cast(q.x), cast(q.v), cast(q.C, q.C.ndim == 3), F, None, cast(q.m), cast(q.V0),
                  y, cast(q.b, q.b.ndim == 2), body.law, body.flow)
    return twin._replace(tau=kirchhoff(F, body.law) if F.ndim == 1 else stress(F, y, twin))


def placed(contacts, box, real):
    """Contacts by the node's index in a box, for those inside of it."""
    at = {tuple(np.array(i) - box.first): c for i, c in contacts.items()}
    return {i: [c._replace(n=c.n.astype(real), v=c.v.astype(real), mu=real(c.mu)) for c in cs]
            for i, cs in at.items() if all(0 <= k < n for k, n in zip(i, box.shape))}


def on(a, box, nodes):
    """Values of an array over a box at nodes (M, d), 0 outside of it."""
    i = nodes - box.first
    inside = ((i >= 0) & (i < box.shape)).all(axis=1)
    out = np.zeros((len(nodes), *a.shape[len(box.shape):]), a.dtype)
    out[inside] = a[tuple(i[inside].T)]
    return out
