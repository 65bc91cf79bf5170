"""The adjoint of one step of the kernels, stopped after every stage, backwards.

It does what `adjoint.StepAdjoint` does, and what a tape does at its start: the stress that the step
reads is that of its F.
"""

import numpy as np

from .. import explicit
from ..adjoint import deform_body_adjoint, initial_stress_adjoint, zero_bars, zero_sums
from ..core.adjoint.boundary import solve_adjoint
from ..core.adjoint.grid import Update, update_adjoint
from ..core.adjoint.transfer import Exchange, g2p_adjoint, p2g_adjoint
from ..core.boundary import solve
from ..core.grid import Storage
from ..core.order import slabs_of
from . import kernel_stages

CARRIED = ("x", "v", "C", "tau", "m", "V0", "b")        # by what p2g reads


def step(problem, bodies, after, seeds, when):
    """{key: array} of the bars of all stages of the step from time t by dt, when = (t, dt).

    bodies hold the state before the step, with its stress, and keep it; after has what
    `stages.step` saw of the step, seeds the `Seeds` of each body.
    """
    (t, dt), scheme, seen = when, problem.scheme, {}
    grid, free, touched = forwards(problem, bodies, t, dt)
    full = grid.m > 0.0
    bars, sums = [seeded(*pair) for pair in zip(bodies, seeds)], [zero_sums(b) for b in bodies]
    for body, bar, parts in zip(bodies, bars, sums):
        deform(body, after[f"{body.name}/L"], (bar, parts), (scheme, dt), seen)
    how = Exchange(scheme.stencil, dt, scheme.flip, scheme.transfer == "mls")
    nodes = storage(problem).cover([body.particles.x for body in bodies])
    for body, bar in zip(bodies, bars):
        x = body.particles.x
        g2p_adjoint(x, grid, bar, nodes, how, slabs_of(x, grid, scheme.stencil))
        seen[f"{body.name}/x_g2p_grad"] = bar.x.copy()
    of_grid(problem, (grid._replace(v=free), touched), nodes, dt, seen)
    for body, bar, parts in zip(bodies, bars, sums):
        p2g_adjoint(body.particles, nodes, bar, how)
        initial_stress_adjoint(body, bar, parts)
        put_particles(body, bar, parts, seen)
    return {key: a[full] if a.shape[:full.ndim] == full.shape and "/" not in key else a
            for key, a in seen.items()}


def storage(problem):
    """Room for the nodes of a step."""
    scheme = problem.scheme
    return Storage(problem.dx, scheme.stencil, problem.dim, flip=scheme.transfer == "flip")


def forwards(problem, bodies, t, dt):
    """The grid of the step, its velocities before the conditions, and what touches its nodes."""
    scheme = problem.scheme
    grid = explicit.scatter(bodies, storage(problem), scheme, dt)
    explicit.update(grid, problem.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
    free, touched = grid.v.copy(), ([], [], [])
    if problem.conditions is not None:
        touched = problem.conditions.touched(grid, t + dt, dt)
        solve(*touched, grid)
    return grid, free, touched


def seeded(body, seed):
    """Bars of a body that hold the seeds."""
    bar = zero_bars(body)
    for name, a in seed._asdict().items():
        if a is not None:
            getattr(bar, name)[:] = a
    return bar


def deform(body, L, bar_and_sums, how, seen):
    """From the bars after the step to those that g2p's adjoint reads, in place."""
    (bar, parts), (scheme, dt), name = bar_and_sums, how, body.name
    q = body.particles
    if q.F.ndim == 3:
        trial = type(bar)(*(a.copy() for a in bar))
        there = body._replace(particles=q._replace(F=kernel_stages.trial(q.F, L, dt)))
        deform_body_adjoint(there, np.zeros_like(L), trial, zero_sums(body), dt)
        seen[f"{name}/F_trial_grad"] = trial.F
    deform_body_adjoint(body, L, bar, parts, dt)
    seen[f"{name}/L_grad"], seen[f"{name}/F_strain_grad"] = bar.L.copy(), bar.F.copy()
    if q.y.ndim == 1:
        seen[f"{name}/y_grad"] = bar.y.copy()
    explicit.damp(body._replace(particles=bar), scheme)     # symmetric, hence its own adjoint
    if scheme.transfer == "mls":
        bar.C[:] += bar.L


def of_grid(problem, grid_and_touched, nodes, dt, seen):
    """From the bars of velocities after the conditions to those of momenta, in place."""
    (grid, touched), scheme = grid_and_touched, problem.scheme
    seen["velocity_bc_grad"] = nodes.v.copy()
    if nodes.v_old.ndim > 1:
        seen["velocity_old_grad"] = nodes.v_old.copy()
    solve_adjoint(touched, grid, nodes)
    seen["velocity_grad"] = nodes.v.copy()
    how = Update(dt, scheme.mass_eps, scheme.gravity_on_empty)
    seen["gravity_grad"] = update_adjoint(grid, nodes, problem.gravity, how)
    seen["mass_grad"], seen["momentum_grad"] = nodes.m.copy(), nodes.v.copy()
    seen["force_grad"] = dt * nodes.v if nodes.f.ndim == 1 else nodes.f.copy()


def put_particles(body, bar, parts, seen):
    """The bars of one body before the step, and of its parameters."""
    seen[f"{body.name}/F_grad"] = bar.F
    for field in CARRIED:
        if len(getattr(body.particles, field)):
            seen[f"{body.name}/{field}_grad"] = getattr(bar, field)
    of_law, of_flow = np.split(parts.sum(axis=0), [len(body.law)])
    seen[f"{body.name}/law_grad"] = of_law
    if len(of_flow):
        seen[f"{body.name}/flow_grad"] = of_flow
