"""The stages of an explicit step by the plain twin, which goes on from its own states.

In extended precision it is the reference for the kernels' own error; in double precision, from
perturbed inputs, it samples what round-off does (see `error_bounds`).
"""

from typing import NamedTuple

import numpy as np

from ..plain import boundary
from ..plain.laws import kirchhoff
from ..plain.step import Matter, Method, energies, new_state, step, stress
from . import error_bounds
from .error_bounds import size

REAL = np.longdouble


class TwinStep(NamedTuple):
    """One step of a `Twin`."""

    arrays: dict        # {key: array} of its stages, grid arrays on the nodes of the kernels
    before: list        # of `plain.step.Matter`, before the step
    stages: object      # `plain.step.StepStages`
    contacts: dict      # {index of a node in the twin's box: its `Contact`s}


class Twin:
    """The plain twin of a problem: it starts from the same numbers and steps independently.

    With a random generator `rng` its state before each step, and the velocities that boundary
    conditions return, have random errors of up to an ulp.
    """

    def __init__(self, problem, real=REAL, rng=None):
        self.real, self.clip, self.rng = real, problem.clip, rng
        self.gravity = problem.gravity.astype(real)
        self.method = method(problem, real)
        self.names = [body.name for body in problem.bodies]
        self.bodies = [matter(body, real) for body in problem.bodies]

    def step(self, dt, nodes, contacts, bases=None):
        """Advance by dt [s] and return the `TwinStep`.

        Grid arrays are those of the given nodes (M, d); weights are those of the stencils that
        begin at bases[body name] (N, d), by default the twin's own.
        """
        local = {}

        def conditions(v, m, box):
            local.update(contacts_in_box(contacts, box, self.real))
            speeds = {i: size(v[i], 0) + sum(size(c.v, 0) for c in at_node)
                      for i, at_node in local.items()}
            return self.with_round_off(boundary.apply_contacts(v, local), speeds)

        if self.rng is not None:
            self.bodies = [error_bounds.perturb_body(q, self.rng) for q in self.bodies]
        before = self.bodies
        stages = step(before, self.method, self.gravity, self.real(dt), conditions)
        stages = stages._replace(motions=[self.clipped(motion) for motion in stages.motions])
        self.bodies = [new_state(*body) for body in zip(before, stages.motions, stages.updates)]
        return TwinStep(self.arrays(stages, nodes, bases), before, stages, local)

    def with_round_off(self, v, sizes):
        """Return nodal vectors after the conditions, with random errors if the twin has a `rng`.

        See `error_bounds.perturb_constrained`.
        """
        if self.rng is None:
            return v
        return error_bounds.perturb_constrained(v, sizes, self.rng)

    def clipped(self, motion):
        """Return the particles' new state with positions inside the box of the problem, if any."""
        return motion if self.clip is None else motion._replace(x=np.clip(motion.x, *self.clip))

    def arrays(self, stages, nodes, bases=None):
        """Return {key: array} of `plain.step.StepStages`, as `kernel_stages.step` does."""
        grid = stages.nodes
        fields = {"mass": grid.m, "momentum": grid.mv, "force": grid.f,
                  "velocity": grid.v_free, "velocity_bc": grid.v}
        arrays = {name: values_at(a, grid.box, nodes) for name, a in fields.items()}
        for k, name in enumerate(self.names):
            base, w = stages.stencils[k].node[:, 0], stages.stencils[k].w
            motion, update = stages.motions[k], stages.updates[k]
            of_body = {"weights": w if bases is None else align(w, base, bases[name]),
                       "v": motion.v, "x": motion.x, "C": motion.C, "L": motion.L,
                       "F_trial": update.F_trial if update.F.ndim == 3 else None,
                       "F": update.F, "y": update.y, "tau": update.tau,
                       "energy": energies(self.bodies[k], self.method, self.gravity)}
            arrays |= {f"{name}/{field}": a for field, a in of_body.items() if a is not None}
        return arrays


def perturbed_twins(problem):
    """Return plain twins in double precision that sample round-off (see `error_bounds`)."""
    rng = np.random.default_rng(error_bounds.SEED)
    return [Twin(problem, np.float64, rng) for _ in range(error_bounds.SAMPLES)]


def method(problem, real):
    """Return the `Method` of the problem's scheme in a floating type."""
    s = problem.scheme
    return Method(real(problem.dx), s.degree, s.transfer, real(s.flip), real(s.rpic),
                  real(s.relaxation), real(s.mass_eps), s.f_bar, real(s.gimp))


def matter(body, real):
    """Return the `Matter` of a body in a floating type, with the stress of its F."""
    q = body.particles

    def cast(a, carried=True):
        return a.astype(real) if carried else None

    F, y = cast(q.F), cast(q.y, q.y.ndim == 1)
    twin = Matter(cast(q.x), cast(q.v), cast(q.C, q.C.ndim == 3), F, None, cast(q.m), cast(q.V0),
                  y, cast(q.b, q.b.ndim == 2), body.law, body.flow)
    return twin._replace(tau=kirchhoff(F, body.law) if F.ndim == 1 else stress(F, y, twin))


def contacts_in_box(contacts, box, real):
    """Return the contacts by the index of the node in a box, for the nodes inside of it."""
    by_index = {tuple(np.array(i) - box.first): c for i, c in contacts.items()}
    return {i: [c._replace(n=c.n.astype(real), v=c.v.astype(real), mu=real(c.mu)) for c in cs]
            for i, cs in by_index.items() if all(0 <= k < n for k, n in zip(i, box.shape))}


def values_at(a, box, nodes):
    """Return the values of an array over a box at nodes (M, d), 0 outside of it."""
    i = nodes - box.first
    inside = ((i >= 0) & (i < box.shape)).all(axis=1)
    out = np.zeros((len(nodes), *a.shape[len(box.shape):]), a.dtype)
    out[inside] = a[tuple(i[inside].T)]
    return out


def align(w, base, to):
    """Return the weights w (N, S) of stencils that begin at the nodes `base` (N, d), for stencils
    that begin at the nodes `to`: 0 outside of the first stencils.

    At a tie, half-way between two nodes for quadratic splines, precisions differ on where a stencil
    begins; the weight of the node in doubt is 0.
    """
    d = base.shape[1]
    width = round(w.shape[1] ** (1.0 / d))
    offset = (to - base)[:, None] + np.indices((width,) * d).reshape(d, -1).T
    reached = ((offset >= 0) & (offset < width)).all(axis=2)
    k = np.moveaxis(np.clip(offset, 0, width - 1), 2, 0)
    return np.where(reached, np.take_along_axis(w, np.ravel_multi_index(k, (width,) * d), 1), 0)
