"""One step of the kernels, stopped after every stage."""

import numpy as np

from .. import explicit
from ..body import keep_inside
from ..core import boundary
from ..core.contact import PRESCRIBED
from ..core.deform import growth
from ..core.jit import kernel
from ..core.stencil import column, columns, locate, product, weights_per_axis
from ..core.tensor import mat, mm, put_mat, vec
from ..energy import energy
from ..plain.boundary import Contact

KINDS = {PRESCRIBED: "prescribed", **{number: name for name, number in boundary.KINDS.items()}}


def step(problem, bodies, stepper, t, dt):
    """Advance the bodies as `Stepper.step` does; returns what was seen, {key: array}, and contacts.

    Keys are those of `schema`. The contacts of nodes with the boundary conditions are data for the
    plain twin, see `contacts`.
    """
    scheme, seen = problem.scheme, {}
    apart(bodies, stepper.storage, scheme, seen)
    grid = explicit.scatter(bodies, stepper.storage, scheme, dt)
    explicit.update(grid, stepper.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
    full = grid.m > 0.0
    seen["velocity"] = grid.v[full]
    touching = contacts(problem.conditions, grid, t + dt, dt)
    if problem.conditions is not None:
        problem.conditions.apply(grid, t + dt, dt)
    seen["velocity_bc"] = grid.v[full]
    for body in bodies:
        advance(problem, body, grid, dt, seen)
    return seen, touching


def apart(bodies, store, scheme, seen):
    """Nodes with mass, and mass, momentum and force on them, each scattered by itself."""
    grid = explicit.scatter(bodies, store, scheme, 0.0)
    full = grid.m > 0.0
    seen["nodes"] = np.argwhere(full) + grid.origin
    seen["mass"], seen["momentum"] = grid.m[full], grid.v[full]
    for body in bodies:
        base, w = weights(body.particles.x, grid, scheme.stencil)
        seen[f"{body.name}/base"], seen[f"{body.name}/weights"] = base, w
    grid = explicit.scatter([at_rest(body) for body in bodies], store, scheme, 1.0)
    seen["force"] = (grid.v if grid.f.ndim == 1 else grid.f)[full]


def at_rest(body):
    """The body without motion, so that all momentum it scatters is the impulse of its forces."""
    q = body.particles
    C = np.zeros_like(q.C)
    L = C if q.L is q.C else q.L
    return body._replace(particles=q._replace(v=np.zeros_like(q.v), C=C, L=L))


def advance(problem, body, grid, dt, seen):
    """Grid to particles and deformation of one body."""
    q, name = body.particles, body.name
    F = q.F.copy()
    explicit.gather(body, grid, problem.scheme, dt)
    if problem.clip is not None:
        keep_inside((body,), *problem.clip)
    if q.F.ndim == 3:
        seen[f"{name}/F_trial"] = trial(F, q.L, dt)
    explicit.deform_body(body, dt)
    seen[f"{name}/L"] = q.L.copy()               # under MLS-MPM the array of C, damped next
    explicit.damp(body, problem.scheme)
    for field in ("v", "x", "C", "F", "y", "tau"):
        a = getattr(q, field)
        if len(a):
            seen[f"{name}/{field}"] = a.copy()
    seen[f"{name}/energy"] = np.array(energy([body], problem.gravity, problem.inertia))


def contacts(conditions, grid, t, dt):
    """{integer coordinates of a node: its `Contact`s} with the boundary conditions at time t.

    Which nodes a condition holds, its normals and its velocities there are taken as they are.
    """
    found = {}
    if conditions is None:
        return found
    for touch, rule, friction in zip(*conditions.touched(grid, t, dt), strict=True):
        nodes = np.array(np.unravel_index(touch.node, grid.m.shape)).T + grid.origin
        for i, n, v in zip(nodes, touch.n, touch.v):
            contact = Contact(n, v, KINDS[rule], friction)
            found.setdefault(tuple(map(int, i)), []).append(contact)
    return found


# What the kernels compute in a step and do not store: weights and trial deformation.

@kernel
def _weights(x, grid, stencil, base, w):
    d = grid.m.shape
    for p in range(len(x)):
        first, s = locate(vec(x, p, d), grid, stencil)
        per_axis = weights_per_axis(s, stencil)
        for a in range(len(first)):
            base[p, a] = first[a] + grid.origin[a]
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                w[p, c * len(stencil) + l] = product(k, l, per_axis)


@kernel
def _trial(F, L, dt, like, out):
    for p in range(len(F)):
        put_mat(out, p, mm(growth(L, p, dt, like), mat(F, p, like)))


def weights(x, grid, stencil):
    """First node (N, d) that each particle at x reaches, and all its weights (N, (degree + 1)^d).

    Nodes are in order, the last axis fastest.
    """
    base = np.empty(x.shape, dtype=np.int64)
    w = np.empty((len(x), len(stencil) ** x.shape[1]))
    _weights(x, grid, stencil, base, w)
    return base, w


def trial(F, L, dt):
    """(I + dt L) F of all particles (N, d, d)."""
    out = np.empty_like(F)
    _trial(F, L, dt, tuple(range(F.shape[1])), out)
    return out
