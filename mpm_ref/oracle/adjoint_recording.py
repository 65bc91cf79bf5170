"""Recording of explicit steps with their adjoints: see `recording`, which records them forwards.

Each step is differentiated by itself. Its loss is sum <seed, state after the step>, with random
seeds that the file holds, from which another code's adjoint starts. The gradient of the loss by a
field is called the field's bar, as in the literature on automatic differentiation.

`adjoint_stages` is the adjoint of one step of the kernels, stopped after every stage, backwards. It
does what `adjoint.StepAdjoint` does, and what a tape does at its start: the stress that the step
reads is that of its F. `plain_adjoint` is the independent reference.
"""

import numpy as np

from .. import explicit
from ..adjoint import (
    StepAdjoint,
    clip_adjoint,
    deform_body_adjoint,
    initial_stress_adjoint,
    require_adjoint,
    zero_bars,
    zero_sums,
)
from ..core.adjoint.boundary import solve_adjoint
from ..core.adjoint.grid import Update, update_adjoint
from ..core.adjoint.records import packed_bars, packed_velocities, unpack, zero_records
from ..core.adjoint.transfer import Exchange, g2p_adjoint, p2g_adjoint
from ..core.boundary import solve
from ..core.grid import Storage
from ..core.order import slabs_of
from . import error_bounds, kernel_stages, plain_adjoint
from .plain_adjoint import Seeds
from .plain_twin import Twin
from .recording import (
    MARGIN,
    MAX_ERROR,
    ReferenceRuns,
    copy_body,
    golden_array,
    require_within_run,
    restore_order,
)

SEED = 20270
COARSE = 2.0**20        # ulps of the perturbations that distinguish a kink from a steep slope
COARSE_SAMPLES = 4
P2G_FIELDS = ("x", "v", "C", "tau", "m", "V0", "b")     # of particles, as far as they are carried


def record_steps(problem, steps, state=None):
    """Yield one `GoldenStep` for each step, as `recording.record_steps`, with the adjoint's arrays.

    Raises ValueError as that does, and for what has no adjoint.
    """
    require_adjoints(problem)
    runs = ReferenceRuns(problem, state)
    require_within_run(problem.clock, state, runs.dt, steps)
    for k in range(steps):
        before = [tuple(copy_body(body, 1) for body in p.bodies) for p in runs.problems]
        golden = runs.step(k)
        seeds = [draw_seeds(problem, body, runs.dt, k) for body in before[0]]
        x = [golden.arrays[f"{body.name}/x"].value for body in before[0]]
        gradients = StepGradients(runs, golden, clip_seeds(problem.clip, seeds, x))
        inputs = {f"{body.name}/{name}_seed": a for body, seed in zip(before[0], seeds)
                  for name, a in seed._asdict().items() if a is not None}
        yield golden._replace(arrays=golden.arrays | gradients.record(before, k), inputs=inputs)


def require_adjoints(problem):
    """Raise ValueError for an integrator, a scheme, conditions, a law or a flow without an adjoint
    of the kernels or of the plain twin.
    """
    StepAdjoint(problem.stepper())
    if problem.scheme.relaxation:
        raise ValueError(f"relaxation = {problem.scheme.relaxation}: the plain twin has no adjoint "
                         "of it; record the steps without gradients, or leave it out")
    for body in problem.bodies:
        require_adjoint(body)


def clip_seeds(clip, seeds, x):
    """Return the `Seeds` of each body before a clip of positions: 0 where a coordinate is clipped.

    clip is (lower, upper) or None, x the positions (N, d) of each body after it.
    """
    if clip is None:
        return seeds
    seeds = [seed._replace(x=seed.x.copy()) for seed in seeds]
    clip_adjoint(x, seeds, *clip)
    return seeds


def draw_seeds(problem, body, dt, k):
    """Return random `Seeds` of a body after step k, of sizes that make all fields comparable."""
    q, dx = body.particles, problem.dx
    rng = np.random.default_rng((SEED, k, len(q.m)))
    speed = dx / dt
    sizes = {"x": 1 / dt, "v": 1.0, "C": dx, "F": speed, "y": speed / (2 * body.law[0])}
    return Seeds(*(sizes[name] * rng.uniform(-1.0, 1.0, a.shape) if len(a) else None
                   for name in Seeds._fields for a in [getattr(q, name)]))


class StepGradients:
    """The gradients of the step that `ReferenceRuns` have just made, by kernels and plain twins."""

    def __init__(self, runs, golden, seeds):
        self.runs, self.golden, self.seeds = runs, golden, seeds

    def record(self, before, k):
        """Return {key: `GoldenArray`} of all stages backwards; k is the number of the step.

        `before` has the bodies of the kernels before it, in order and reversed. Raises ValueError
        on a kink.
        """
        value, other = self.by_kernels(before)
        exact = self.by_twin(self.runs.twin, self.runs.last.exact)
        samples = [self.by_twin(twin, step) for twin, step in
                   zip(self.runs.perturbed, self.runs.last.samples)]
        S = error_bounds.scales(exact, samples, self.runs.count)
        arrays = {key: golden_array(a, S[key], exact[key], other[key])
                  for key, a in value.items()}
        self.require_smoothness(arrays, exact, k)
        return arrays

    def by_kernels(self, before):
        """Return {key: array} of the kernels, and of those with particles reversed."""
        last, when = self.runs.last.kernels, (self.golden.t, self.golden.dt)
        reversed_ = [seed.reversed() for seed in self.seeds]
        value, other = (adjoint_stages(problem, bodies, forward, seeds, when)
                        for problem, bodies, forward, seeds
                        in zip(self.runs.problems, before, last, (self.seeds, reversed_)))
        return value, restore_order(other, last[1]["nodes"], self.golden.nodes)

    def by_twin(self, twin, step):
        """Return {key: array} of a plain twin that made the `TwinStep` step."""
        on_empty = self.runs.problems[0].scheme.gravity_on_empty
        return plain_adjoint.gradients(twin, step, self.seeds, on_empty, self.golden.nodes)

    def require_smoothness(self, arrays, exact, k):
        """Raise ValueError where an own error is neither small nor explained by round-off.

        There the runs took different branches, each with another gradient. A NaN is not small
        either. Samples on a kink are as far apart as the branches, so what a smooth function may do
        is measured by perturbations that are COARSE times as large, their effect divided by COARSE.
        """
        own = {key: max(a.twin, a.reordered) for key, a in arrays.items()}
        unsure = [key for key, a in arrays.items()
                  if not own[key] <= MAX_ERROR * abs(a.value).max()]
        coarse = self.coarse_samples() if unsure else []
        for key in unsure:
            location, a = error_bounds.array_location(key), arrays[key]
            smooth = error_bounds.entity_size(exact[key], location).astype(float)
            spread = error_bounds.deviation(exact[key], [s[key] for s in coarse], location)
            smooth = error_bounds.with_floor(smooth + error_bounds.SAFETY * spread / COARSE)
            error = golden_array(a.value, smooth, exact[key], a.value).error
            if not error <= MARGIN:
                raise ValueError(
                    f"{key} in step {k}: kernels and plain twin differ by {own[key]:.1e}, with a "
                    f"largest entry of {abs(a.value).max():.1e}; this is {error:.1e} times what "
                    "round-off explains. The state stands on a kink (a yield surface, a contact "
                    "that opens, the face of a cell) and has no definite gradient: record "
                    "later steps (--begin K), or another number of them"
                )

    def coarse_samples(self):
        """Return the gradients {key: array} at states that are COARSE ulps away."""
        step, twin = self.runs.last.exact, Twin(self.runs.problems[0], np.float64)
        rng, samples = np.random.default_rng(error_bounds.SEED), []
        contacts = {tuple(np.array(i) + step.stages.nodes.box.first): c
                    for i, c in step.contacts.items()}
        for _ in range(COARSE_SAMPLES):
            twin.bodies = [error_bounds.perturb_body(q.cast(np.float64), rng, COARSE)
                           for q in step.before]
            samples.append(self.by_twin(
                twin, twin.step(self.golden.dt, self.golden.nodes, contacts)))
        return samples


# the adjoint of one step of the kernels

def adjoint_stages(problem, bodies, forward, seeds, when):
    """Return {key: array}, the bars of all stages of the step from time t by dt, when = (t, dt).

    bodies hold the state before the step, with its stress, and keep it; forward has the arrays that
    `kernel_stages.step` returned for the step, seeds the `Seeds` of each body.
    """
    (t, dt), scheme, arrays = when, problem.scheme, {}
    grid, v_free, contacts = grid_of_step(problem, bodies, t, dt)
    full = grid.m > 0.0
    bars, sums = [seed_bars(*pair) for pair in zip(bodies, seeds)], [zero_sums(b) for b in bodies]
    for body, bar, parts in zip(bodies, bars, sums):
        deformation_adjoint(body, forward[f"{body.name}/L"], (bar, parts), (scheme, dt), arrays)
    exchange = Exchange(scheme.stencil, dt, scheme.flip, scheme.transfer == "mls")
    nodes = storage(problem).cover([body.particles.x for body in bodies])
    moved, of_moved = packed_velocities(grid), zero_records(nodes)
    for body, bar in zip(bodies, bars):
        slabs = slabs_of(body.particles.x, grid, scheme.stencil)
        g2p_adjoint(body.particles, moved, bar, of_moved, exchange, slabs)
        arrays[f"{body.name}/x_g2p_grad"] = bar.x.copy()
    unpack(of_moved, nodes)
    grid_adjoint(problem, (grid._replace(v=v_free), contacts), nodes, dt, arrays)
    for body, bar, parts in zip(bodies, bars, sums):
        p2g_adjoint(body.particles, packed_bars(nodes), bar, exchange)
        initial_stress_adjoint(body, bar, parts)
        put_particle_bars(body, bar, parts, arrays)
    return {key: a[full] if a.shape[:full.ndim] == full.shape and "/" not in key else a
            for key, a in arrays.items()}


def storage(problem):
    """Return the `Storage` that holds the nodes of a step."""
    scheme = problem.scheme
    return Storage(problem.dx, scheme.stencil, problem.dim, flip=scheme.transfer == "flip")


def grid_of_step(problem, bodies, t, dt):
    """Return the grid of the step, its velocities before the conditions, and the contacts."""
    scheme = problem.scheme
    grid = explicit.scatter(bodies, storage(problem), scheme, dt)
    explicit.update(grid, problem.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
    v_free, contacts = grid.v.copy(), ([], [], [])
    if problem.conditions is not None:
        contacts = problem.conditions.touched(grid, t + dt, dt)
        solve(*contacts, grid)
    return grid, v_free, contacts


def seed_bars(body, seed):
    """Return the bars of a body that hold its seeds, 0 in all other fields."""
    bar = zero_bars(body)
    for name, a in seed._asdict().items():
        if a is not None:
            getattr(bar, name)[:] = a
    return bar


def deformation_adjoint(body, L, bar_and_sums, scheme_and_dt, arrays):
    """Turn the bars after the step into those that the adjoint of G2P reads, in place."""
    (bar, parts), (scheme, dt), name = bar_and_sums, scheme_and_dt, body.name
    q = body.particles
    if q.F.ndim == 3:
        trial = type(bar)(*(a.copy() for a in bar))
        F_trial = kernel_stages.trial_deformation(q.F, L, dt)
        there = body._replace(particles=q._replace(F=F_trial))
        deform_body_adjoint(there, np.zeros_like(L), trial, zero_sums(body), dt)
        arrays[f"{name}/F_trial_grad"] = trial.F
    deform_body_adjoint(body, L, bar, parts, dt)
    arrays[f"{name}/L_grad"], arrays[f"{name}/F_strain_grad"] = bar.L.copy(), bar.F.copy()
    if q.y.ndim == 1:
        arrays[f"{name}/y_grad"] = bar.y.copy()
    explicit.damp(body._replace(particles=bar), scheme)     # symmetric, hence its own adjoint
    if scheme.transfer == "mls":
        bar.C[:] += bar.L


def grid_adjoint(problem, grid_and_contacts, nodes, dt, arrays):
    """Turn the bars of velocities after the conditions into those of momenta, in place."""
    (grid, contacts), scheme = grid_and_contacts, problem.scheme
    arrays["velocity_bc_grad"] = nodes.v.copy()
    if nodes.v_old.ndim > 1:
        arrays["velocity_old_grad"] = nodes.v_old.copy()
    solve_adjoint(contacts, grid, nodes)
    arrays["velocity_grad"] = nodes.v.copy()
    update = Update(dt, scheme.mass_eps, scheme.gravity_on_empty)
    arrays["gravity_grad"] = update_adjoint(grid, nodes, problem.gravity, update)
    arrays["mass_grad"], arrays["momentum_grad"] = nodes.m.copy(), nodes.v.copy()
    arrays["force_grad"] = dt * nodes.v if nodes.f.ndim == 1 else nodes.f.copy()


def put_particle_bars(body, bar, parts, arrays):
    """Put the bars of one body before the step, and of its parameters, into `arrays`."""
    arrays[f"{body.name}/F_grad"] = bar.F
    for field in P2G_FIELDS:
        if len(getattr(body.particles, field)):
            arrays[f"{body.name}/{field}_grad"] = getattr(bar, field)
    law, flow = np.split(parts.sum(axis=0), [len(body.law)])
    arrays[f"{body.name}/law_grad"] = law
    if len(flow):
        arrays[f"{body.name}/flow_grad"] = flow
