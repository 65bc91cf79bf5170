"""Recording of implicit steps: as `recording`, but every step starts from the golden state.

Two correct codes leave a step at a distance that the tolerance of its solve admits, and would enter
the next one with that difference. So the other code starts step k from the arrays that the golden
file has for the end of step k - 1, and all stages before the solve are compared to round-off.

Operators are applied to random vectors, drawn once with a fixed seed and stored: another code reads
them from the file.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..explicit import scatter
from ..hot.linearization import matrix_product
from ..hot.methods import descent_method
from ..hot.multigrid.blocks.transfer import prolong
from ..hot.multigrid.hierarchy import hierarchy
from ..hot.report import Profiler
from . import accepted_step, error_bounds, kernel_stages
from .error_bounds import size
from .implicit_twin import ImplicitTwin
from .recording import (
    GoldenArray,
    GoldenStep,
    copy_body,
    copy_problem,
    golden_array,
    require_small_error,
    require_within_run,
    start_stepper,
    stencil_bases,
    step_length,
)
from .schema import AUXILIARY, LEVELS

MULTIGRID = "cycle"     # the approximate inverse that is a node-embedding V-cycle
SEED = 20200            # of the probe vectors
STRAIN = 0.01           # of a step by the trial increment, about
HALVINGS = 60           # of the trial increment, at most, until all laws admit it


def record_steps(problem, steps, state=None):
    """Yield one `GoldenStep` for each step; the problem's own arrays stay as they are.

    The first step starts from `state`, by default from the start of the problem. Raises ValueError
    for steps past the end of the run, where a step is not solved, or the reference's own error is
    too large.
    """
    levels = accepted_step.solver_options(problem).levels
    if levels > LEVELS:
        raise ValueError(f"levels = {levels}: expected at most {LEVELS}, which the oracle records")
    golden = copy_problem(problem, 1)
    stepper = start_stepper(golden)
    dt, start = step_length(golden, stepper, state), 0.0 if state is None else state.t
    require_within_run(problem.clock, state, dt, steps)
    for k in range(steps):
        yield ImplicitStepRecorder(golden, stepper, start + k * dt, dt).record(k)


class ImplicitStepRecorder:
    """One step of the bodies of a problem, from time t by dt; `record` advances them."""

    def __init__(self, problem, stepper, t, dt):
        self.problem, self.stepper, self.t, self.dt = problem, stepper, t, dt
        self.options = stepper.options
        self.forward = KernelRun(problem, problem.bodies, stepper, t, dt)
        bodies = tuple(copy_body(body, -1) for body in problem.bodies)
        self.reversed = KernelRun(problem, bodies, problem.stepper(), t, dt)
        self.volumes = {body.name: body.particles.V0 for body in problem.bodies}
        self.grids = self.probes = None

    def record(self, k):
        """Return the `GoldenStep` of step k."""
        options = self.options
        if options.inverse == MULTIGRID:
            self.grids = self.forward.grids(options)
        coarse = self.grids.levels[1:] if self.grids else ()
        self.probes = draw_probes(self.forward.system, coarse)
        values = self.forward.arrays(self.probes, self.grids, options)
        twin, samples = self.twins()
        arrays, S = self.before_solve(values, twin, samples)
        accepted = accepted_step.solve(self.stepper, self.forward.bodies, self.dt,
                                       S["gradient_start"], self.t)
        arrays["dv"] = GoldenArray(accepted.dv, accepted.S, accepted.error_method,
                                   accepted.error_second, 0.0)
        following, bars = self.after_solve(twin, samples, accepted)
        arrays |= following
        require_small_error({name: a for name, a in arrays.items() if name != "dv"}, k)
        bases = stencil_bases(values, twin.names)
        return GoldenStep(self.t, self.dt, values["nodes"], bases, arrays,
                          bars | {"dv": accepted.bar}, self.inputs(values), accepted.report)

    def twins(self):
        """Return the plain twin in extended precision, and those that sample round-off."""
        rng = np.random.default_rng(error_bounds.SEED)
        unknowns = self.forward.step_problem.unknowns
        samples = [ImplicitTwin(self.problem, unknowns, self.dt, np.float64, rng)
                   for _ in range(error_bounds.SAMPLES)]
        return ImplicitTwin(self.problem, unknowns, self.dt), samples

    def before_solve(self, values, twin, samples):
        """Return {key: `GoldenArray`} and scales {key: scale} of all stages before the solve."""
        start, count = self.forward.system.start, sum(map(len, self.volumes.values()))
        given = stencil_bases(values, twin.names), start
        levels = None if self.grids is None else (self.grids.levels, self.options.kernel)
        exact, *others = (each.before_solve(given, self.probes, levels)
                          for each in (twin, *samples))
        S = error_bounds.scales(exact, others, count) | self.condition_scales(exact, others)
        if self.options.start == "gravity":
            fall = 0 * exact["start"] + twin.dt * twin.gravity
            exact["start"] = exact["start"] + twin.project(fall)
        other = self.by_reversed_run()
        for name, scale in self.solve_scales(S["gradient_start"]).items():
            if name in values:
                S[name], exact[name] = scale(), other[name]     # the twin: SciPy's multigrid
        return {name: golden_array(values[name], S[name], exact[name], other[name])
                for name in S}, S

    def condition_scales(self, exact, others):
        """Return the scales of projectors and starts, which the twins take from the kernels.

        The scale of a projector is 1, that of a start the speed that its condition takes away.
        """
        unknowns, gravity = self.forward.step_problem.unknowns, size(self.problem.gravity, 0)
        speed = size(unknowns.v) + error_bounds.scale(
            exact["velocity_old"], [a["velocity_old"] for a in others], "nodes")
        constrained = (unknowns.B != np.eye(unknowns.B.shape[1])).any(axis=(1, 2))
        start = np.where(constrained, speed + size(unknowns.dv0), 0.0) + self.dt * gravity
        return {"projector": np.ones(len(unknowns.m)), "start": error_bounds.with_floor(start)}

    def solve_scales(self, S_g):
        """Return {key: function that returns the scale} of the results of approximate inverses.

        S_g (n,) is the scale of the gradient.
        """
        system, A = self.forward.system, self.forward.A
        options, load = self.options, self.probes.load
        return {
            "cycle": lambda: error_bounds.with_floor(error_bounds.solve_scale(
                lambda A, b: build_hierarchy(A, system.index, options).cycle(b),
                system, A, load, size(load))),
            "direction": lambda: error_bounds.with_floor(error_bounds.solve_scale(
                lambda A, g: first_direction(system, A, g, options),
                system, A, self.forward.g, S_g)),
        }

    def by_reversed_run(self):
        """Return {key: array} of the reversed run, with the other implementation of multigrid."""
        run, other = self.reversed, {"blocks": "scipy", "scipy": "blocks"}
        options = replace(self.options, implementation=other[self.options.implementation])
        grids = None if self.grids is None else run.grids(options)
        return restore_particle_order(run.arrays(self.probes, grids, options))

    def after_solve(self, twin, samples, accepted):
        """Return {key: `GoldenArray`} and bars of what follows from the accepted velocities."""
        problem, bodies, dt = self.problem, self.problem.bodies, self.dt
        v = accepted.step_problem.unknowns.v + accepted.dv
        bars = accepted_step.error_bars(problem, lambda: [copy_body(body, 1) for body in bodies],
                                        accepted.step_problem, accepted, dt)
        other = kernel_stages.solved_stages(problem, self.reversed.bodies,
                                            self.reversed.step_problem, v, dt)
        values = kernel_stages.solved_stages(problem, bodies, accepted.step_problem, v, dt)
        rng = np.random.default_rng(error_bounds.SEED)
        exact = twin.after_solve(v)
        others = [sample.after_solve(error_bounds.perturb(v, rng, accepted.S))
                  for sample in samples]
        S = error_bounds.scales(exact, others, sum(map(len, self.volumes.values())))
        S, other = error_bounds.with_stress_error(S, self.volumes), restore_particle_order(other)
        return {key: golden_array(a, S[key], exact[key], other[key])
                for key, a in values.items()}, bars

    def inputs(self, values):
        """Return the vectors that operators were applied to, and the nodes of coarse levels."""
        vectors = {name: getattr(self.probes, name) for name in ("trial", "probe", "load")}
        return vectors | {name: a for name, a in values.items()
                          if name in AUXILIARY and name != "nodes"}


def restore_particle_order(arrays):
    """Return the arrays of the reversed run in the order of the other; their nodes are the same."""
    return {key: a[::-1] if "/" in key and not key.endswith("/energy") else a
            for key, a in arrays.items()}


# one step of the kernels before its solve, stage by stage

class KernelRun:
    """A step of the kernels whose problem is set up and not yet solved."""

    def __init__(self, problem, bodies, stepper, t, dt):
        self.problem, self.bodies, self.stepper = problem, bodies, stepper
        self.step_problem = stepper.problem(bodies, t, dt)
        self.system = stepper.system(self.step_problem)
        self.A = self.system.matrix(self.system.start)
        self.g = self.system.evaluate(self.system.start)[1]

    def grids(self, options):
        """Return the hierarchy of multigrid at the start."""
        return build_hierarchy(self.A, self.system.index, options)

    def arrays(self, probes, grids, options):
        """Return {key: array} of all stages before the solve."""
        arrays = self.grid_arrays() | potential_arrays(self.system, probes)
        if grids is not None:
            arrays |= multigrid_arrays(grids, probes)
        if options.descent != "admm":
            arrays["direction"] = first_direction(self.system, self.A, self.g, options)
        return arrays

    def grid_arrays(self):
        """Return {key: array} of particles to grid, and of the inputs of the solve."""
        q, grid = self.step_problem.unknowns, self.step_problem.grid
        full = q.number >= 0
        return weight_arrays(self.bodies, self.stepper.storage, self.problem.scheme) | {
            "nodes": q.index, "mass": q.m, "momentum": grid.v[full], "velocity_old": q.v,
            "projector": q.B, "start": self.system.start, "kappa": self.step_problem.kappa,
        }


class ProbeVectors(NamedTuple):
    """Vectors that operators are applied to, on n nodes and on the m coarse nodes of each level."""

    trial: np.ndarray       # (n, d)  a second increment besides the start [m/s]
    probe: np.ndarray       # (n, d)  for the Hessian [m/s]
    load: np.ndarray        # (n, d)  for the V-cycle [kg m/s]
    coarse: tuple           # of (m, d), for each coarse level [m/s]


class LinearizedSystem:
    """A system as a descent method reads it at its start, with the matrix A given."""

    def __init__(self, system, A):
        self.A, self.start, self.index = A, system.start, system.index
        self.kappa, self.n, self.project, self.matrices = (
            system.kappa, system.n, system.project, system.matrices)

    def matrix(self, dv):
        """Return A, whatever the increment."""
        return self.A

    def product(self, dv):
        """Return the function u -> A u."""
        return matrix_product(self.A)

    def diagonal(self, dv):
        """Return the diagonal blocks (n, d, d) of A."""
        n, d = self.start.shape
        row = np.repeat(np.arange(n), np.diff(self.A.indptr))
        is_diagonal, D = row == self.A.indices, np.zeros((n, d, d))
        D[row[is_diagonal]] = self.A.data[is_diagonal]
        return D


def draw_probes(system, levels):
    """Return random `ProbeVectors` for a system with the given coarse levels."""
    rng, q = np.random.default_rng(SEED), system.unknowns
    speed = STRAIN * q.dx / system.potential.dt
    trial, probe, load = rng.uniform(-1.0, 1.0, (3, *q.v.shape))
    coarse = tuple(apply_blocks(level.B, rng.uniform(-1.0, 1.0, level.index.shape))
                   for level in levels)
    trial, probe = speed * system.project(trial), system.project(probe)
    for _ in range(HALVINGS):
        if np.isfinite(system.energy(system.start + trial)):
            break
        trial /= 2
    load = q.m[:, None] * speed * system.project(load)
    return ProbeVectors(system.start + trial, probe, load, coarse)


def apply_blocks(B, u):
    """Return B u (n, d) of blocks B (n, d, d)."""
    return np.einsum("nab,nb->na", B, u)


def build_hierarchy(A, index, options):
    """Return the multigrid hierarchy of a matrix that the options describe."""
    return hierarchy(A, index, options.levels, options.kernel, options.implementation,
                     **options.cycle._asdict())


def prolongate(level, u):
    """Return P u (n, d) of coarse u (m, d), with either implementation of multigrid."""
    if hasattr(level, "transfer"):
        return prolong(level.transfer, u.copy())
    return (level.P @ u.reshape(-1)).reshape(level.index.shape)


def first_direction(system, A, g, options):
    """Return the first direction of a method, from the gradient and the matrix at the start."""
    linear = LinearizedSystem(system, A)
    return linear.project(descent_method(linear, options, Profiler()).direction(linear.start, g))


def weight_arrays(bodies, storage, scheme):
    """Return {key: array} of weights, and of the first nodes of the particles' stencils."""
    grid, arrays = scatter(bodies, storage, scheme, 0.0), {}
    for body in bodies:
        base, w = kernel_stages.stencil_weights(body.particles.x, grid, scheme.stencil)
        arrays[f"{body.name}/base"], arrays[f"{body.name}/weights"] = base, w
    return arrays


def potential_arrays(system, probes):
    """Return {key: array} of energies, gradients and Hessian products."""
    arrays = {}
    for name, dv in (("start", system.start), ("trial", probes.trial)):
        E, g = system.evaluate(dv)
        arrays |= {f"E_{name}": np.array([E]), f"gradient_{name}": g,
                   f"product_{name}": system.product(dv)(probes.probe)}
    return arrays


def multigrid_arrays(grids, probes):
    """Return {key: array} of prolongations, coarse matrices and the V-cycle."""
    arrays = {"cycle": grids.cycle(probes.load)}
    for k, u in enumerate(probes.coarse, 1):
        fine, level = grids.levels[k - 1 : k + 1]
        arrays[f"prolonged{k}"] = prolongate(fine, u)
        arrays[f"coarse{k}"] = matrix_product(level.A)(u)
        arrays[f"nodes{k}"], arrays[f"probe{k}"] = level.index, u
    return arrays
