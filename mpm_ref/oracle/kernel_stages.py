"""One step of the kernels, stopped after every stage to copy its arrays."""

import numpy as np

from .. import explicit
from ..body import keep_inside
from ..core import boundary
from ..core.contact import PRESCRIBED
from ..core.grid import Storage
from ..core.jit import kernel
from ..core.state import growth
from ..core.stencil import column, columns, locate, product, weights_per_axis
from ..core.tensor import mat, mm, put_mat, vec
from ..energy import energy
from ..hot.step import write_velocities
from ..plain.boundary import Contact

KINDS = {PRESCRIBED: "prescribed", **{number: name for name, number in boundary.KINDS.items()}}


def step(problem, bodies, stepper, t, dt):
    """Advance the bodies as `Stepper.step` does; return {key: array} of the stages, and contacts.

    Keys are those of `schema`. The contacts of nodes with the boundary conditions are data for the
    plain twin, see `node_contacts`.
    """
    scheme, arrays = problem.scheme, {}
    storage = Storage(problem.dx, scheme.stencil, problem.dim, flip=scheme.keeps_old_velocity)
    scatter_stages(bodies, storage, scheme, arrays)
    grid = explicit.scatter(bodies, storage, scheme, dt)
    explicit.update(grid, stepper.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
    full = grid.m > 0.0
    arrays["velocity"] = grid.v[full]
    contacts = node_contacts(problem.conditions, grid, t + dt, dt)
    if problem.conditions is not None:
        problem.conditions.apply(grid, t + dt, dt)
    arrays["velocity_bc"] = grid.v[full]
    for body in bodies:
        advance_body(problem, body, grid, dt, arrays)
    return arrays, contacts


def solved_stages(problem, bodies, step_problem, v, dt):
    """Return {key: array} of the stages after an implicit solve, for nodal velocities v (n, d).

    step_problem is the `hot.step.ImplicitProblem` of the step; the bodies advance.
    """
    write_velocities(step_problem.grid, step_problem.unknowns, v)
    arrays = {}
    for body in bodies:
        advance_body(problem, body, step_problem.grid, dt, arrays)
    return arrays


def scatter_stages(bodies, storage, scheme, arrays):
    """Put the nodes with mass, and their mass, momentum and force into `arrays`.

    A step scatters momentum and force as one sum; here each has a sum of its own.
    """
    grid = explicit.scatter(bodies, storage, scheme, 0.0)
    full = grid.m > 0.0
    arrays["nodes"] = np.argwhere(full) + grid.origin
    arrays["mass"], arrays["momentum"] = grid.m[full], grid.v[full]
    for body in bodies:
        base, w = stencil_weights(body.particles.x, grid, scheme.stencil)
        arrays[f"{body.name}/base"], arrays[f"{body.name}/weights"] = base, w
    grid = explicit.scatter([without_motion(body) for body in bodies], storage, scheme, 1.0)
    arrays["force"] = (grid.v if grid.f.ndim == 1 else grid.f)[full]


def without_motion(body):
    """Return the body with v = 0 and C = 0: all momentum that it scatters is due to its forces."""
    q = body.particles
    C = np.zeros_like(q.C)
    L = C if q.L is q.C else q.L
    return body._replace(particles=q._replace(v=np.zeros_like(q.v), C=C, L=L))


def advance_body(problem, body, grid, dt, arrays):
    """Do G2P and the deformation of one body, and put their arrays into `arrays`."""
    q, name = body.particles, body.name
    F = q.F.copy()
    explicit.gather(body, grid, problem.scheme, dt)
    if problem.clip is not None:
        keep_inside((body,), *problem.clip)
    if q.F.ndim == 3:
        arrays[f"{name}/F_trial"] = trial_deformation(F, q.L, dt)
    explicit.deform_body(body, dt)
    arrays[f"{name}/L"] = q.L.copy()               # under MLS-MPM the array of C, damped next
    explicit.damp(body, problem.scheme)
    for field in ("v", "x", "C", "F", "y", "tau"):
        a = getattr(q, field)
        if len(a):
            arrays[f"{name}/{field}"] = a.copy()
    arrays[f"{name}/energy"] = np.array(energy([body], problem.gravity, problem.inertia))


def node_contacts(conditions, grid, t, dt):
    """Return {integer coordinates of a node: its `Contact`s} with the conditions at time t.

    The nodes, normals and velocities are those that the conditions themselves report.
    """
    contacts = {}
    if conditions is None:
        return contacts
    for touch, rule, friction in zip(*conditions.touched(grid, t, dt), strict=True):
        nodes = np.array(np.unravel_index(touch.node, grid.m.shape)).T + grid.origin
        for i, n, v in zip(nodes, touch.n, touch.v):
            contact = Contact(n, v, KINDS[rule], friction)
            contacts.setdefault(tuple(map(int, i)), []).append(contact)
    return contacts


# intermediate results of a step that the kernels do not store: weights and trial deformation

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


def stencil_weights(x, grid, stencil):
    """Return the first node (N, d) of each particle's stencil and its weights (N, (degree + 1)^d).

    The nodes of a stencil are in order, the last axis fastest.
    """
    base = np.empty(x.shape, dtype=np.int64)
    w = np.empty((len(x), len(stencil) ** x.shape[1]))
    _weights(x, grid, stencil, base, w)
    return base, w


def trial_deformation(F, L, dt):
    """F_trial = (I + dt L) F (N, d, d), as the kernels compute it."""
    out = np.empty_like(F)
    _trial(F, L, dt, tuple(range(F.shape[1])), out)
    return out
