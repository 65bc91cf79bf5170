"""One step of the kernels, stopped after every stage."""

import numpy as np

from .. import explicit
from ..body import keep_inside
from ..core import boundary
from ..core.contact import PRESCRIBED
from ..energy import energy
from ..plain.walls import Contact
from . import inner

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
        base, w = inner.weights(body.particles.x, grid, scheme.stencil)
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
        seen[f"{name}/F_trial"] = inner.trial(F, q.L, dt)
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
