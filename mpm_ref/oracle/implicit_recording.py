"""Recording an implicit step: as `recording`, but every step begins from the golden state.

Two codes that are both right leave a step by what the tolerance of its solve admits, and would
enter the next one with that difference. So the other code begins step k from the arrays that the
golden file has for the end of step k - 1, and all that comes before the solve is held to round-off.
"""

from dataclasses import replace

import numpy as np

from . import accepted_step, error_bounds, implicit_stages
from .error_bounds import size
from .implicit_twin import SolvedTwin
from .recording import (
    Golden,
    Recorded,
    bases_of,
    copied,
    measured,
    problem_of,
    refuse_past_end,
    refuse_unsure,
    step_length,
)
from .schema import BESIDE, LEVELS

MULTIGRID = "cycle"     # the inverse that is a node-embedding V-cycle


def run(problem, steps, state=None):
    """Yield one `Recorded` for each step; the problem's own arrays stay as they are.

    A run stands at `state`, by default at the start of the problem. Raises ValueError for steps
    past its end, where a step is not solved, or the reference's own error is too large.
    """
    levels = accepted_step.options_of(problem).levels
    if levels > LEVELS:
        raise ValueError(f"levels = {levels}: expected at most {LEVELS}, which the oracle records")
    ours = problem_of(problem, 1)
    stepper = started(ours)
    dt, start = step_length(ours, stepper, state), 0.0 if state is None else state.t
    refuse_past_end(problem.clock, state, dt, steps)
    for k in range(steps):
        yield Step(ours, stepper, start + k * dt, dt).recorded(k)


def started(problem):
    """A stepper, and the stress of its bodies."""
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    return stepper


class Side:
    """One run of the kernels: a step that is posed and not yet solved."""

    def __init__(self, problem, bodies, stepper, t, dt):
        self.problem, self.bodies, self.stepper = problem, bodies, stepper
        self.pose = stepper.problem(bodies, t, dt)
        self.system = stepper.system(self.pose)
        self.A = self.system.matrix(self.system.start)
        self.g = self.system.evaluate(self.system.start)[1]

    def grids(self, options):
        """Return the hierarchy of multigrid at the start."""
        return implicit_stages.grids_of(self.A, self.system.index, options)

    def arrays(self, operands, grids, options):
        """Return {key: array} of all stages before the solve."""
        arrays = implicit_stages.before(self.problem, self.bodies, self.stepper, self.pose)
        arrays |= implicit_stages.of_potential(self.system, operands)
        if grids is not None:
            arrays |= implicit_stages.of_multigrid(grids, operands)
        if options.descent != "admm":
            arrays["direction"] = implicit_stages.direction(self.system, self.A, self.g, options)
        return arrays


class Step:
    """One step of the bodies of a problem, from time t by dt; `recorded` advances them."""

    def __init__(self, problem, stepper, t, dt):
        self.problem, self.stepper, self.t, self.dt = problem, stepper, t, dt
        self.options = stepper.options
        self.ours = Side(problem, problem.bodies, stepper, t, dt)
        mirrored = tuple(copied(body, -1) for body in problem.bodies)
        self.mirrored = Side(problem, mirrored, problem.stepper(), t, dt)
        self.volumes = {body.name: body.particles.V0 for body in problem.bodies}
        self.grids = self.operands = None

    def recorded(self, k):
        """Return the `Recorded` of step k."""
        options = self.options
        if options.inverse == MULTIGRID:
            self.grids = self.ours.grids(options)
        coarse = self.grids.levels[1:] if self.grids else ()
        self.operands = implicit_stages.draw(self.ours.system, coarse)
        values = self.ours.arrays(self.operands, self.grids, options)
        twin, samples = self.twins()
        arrays, S = self.before_solve(values, twin, samples)
        solved = accepted_step.solve(self.stepper, self.ours.bodies, self.dt, S["gradient_start"],
                                     self.t)
        arrays["dv"] = Golden(solved.dv, solved.S, solved.near, solved.second, 0.0)
        following, bars = self.after_solve(twin, samples, solved)
        arrays |= following
        refuse_unsure({name: a for name, a in arrays.items() if name != "dv"}, k)
        return Recorded(self.t, self.dt, values["nodes"], bases_of(values, twin.names), arrays,
                        bars | {"dv": solved.bar}, self.inputs(values), solved.report)

    def twins(self):
        """Return the plain twin in extended precision, and those that sample round-off."""
        rng, unknowns = np.random.default_rng(error_bounds.SEED), self.ours.pose.unknowns
        samples = [SolvedTwin(self.problem, unknowns, self.dt, np.float64, rng)
                   for _ in range(error_bounds.SAMPLES)]
        return SolvedTwin(self.problem, unknowns, self.dt), samples

    def before_solve(self, values, twin, samples):
        """Return {key: `Golden`} and scales {key: scale} of all stages before the solve."""
        start, count = self.ours.system.start, sum(map(len, self.volumes.values()))
        given = bases_of(values, twin.names), start
        levels = None if self.grids is None else (self.grids.levels, self.options.kernel)
        exact, *others = (each.before_solve(given, self.operands, levels)
                          for each in (twin, *samples))
        S = error_bounds.scales(exact, others, count) | self.condition_scales(exact, others)
        if self.options.start == "gravity":
            fall = 0 * exact["start"] + twin.dt * twin.gravity
            exact["start"] = exact["start"] + twin.project(fall)
        other = self.by_the_other_side()
        for name, scale in self.solve_scales(S["gradient_start"]).items():
            if name in values:
                S[name], exact[name] = scale(), other[name]     # the twin: SciPy's multigrid
        return {name: measured(values[name], S[name], exact[name], other[name]) for name in S}, S

    def condition_scales(self, exact, others):
        """Return the scales of projectors and starts, which are taken from the kernels: of a
        projector 1, of a start the speed that its condition takes away.
        """
        unknowns, gravity = self.ours.pose.unknowns, size(self.problem.gravity, 0)
        speed = size(unknowns.v) + error_bounds.scale(
            exact["velocity_old"], [a["velocity_old"] for a in others], "nodes")
        tied = (unknowns.B != np.eye(unknowns.B.shape[1])).any(axis=(1, 2))
        start = np.where(tied, speed + size(unknowns.dv0), 0.0) + self.dt * gravity
        return {"projector": np.ones(len(unknowns.m)), "start": error_bounds.floored(start)}

    def solve_scales(self, S_g):
        """Return {key: function that returns the scale} of what approximate inverses give; S_g is
        the scale of the gradient.
        """
        system, A, options, load = self.ours.system, self.ours.A, self.options, self.operands.load
        return {
            "cycle": lambda: error_bounds.floored(error_bounds.scale_of_solve(
                lambda A, b: implicit_stages.grids_of(A, system.index, options).cycle(b),
                system, A, load, size(load))),
            "direction": lambda: error_bounds.floored(error_bounds.scale_of_solve(
                lambda A, g: implicit_stages.direction(system, A, g, options),
                system, A, self.ours.g, S_g)),
        }

    def by_the_other_side(self):
        """Return {key: array} of the reversed run, on the other path of multigrid."""
        side, other = self.mirrored, {"blocks": "scipy", "scipy": "blocks"}
        options = replace(self.options, implementation=other[self.options.implementation])
        grids = None if self.grids is None else side.grids(options)
        return in_order(side.arrays(self.operands, grids, options))

    def after_solve(self, twin, samples, solved):
        """Return {key: `Golden`} and bars of what follows from the accepted velocities."""
        problem, bodies, dt = self.problem, self.problem.bodies, self.dt
        v = solved.pose.unknowns.v + solved.dv
        bars = accepted_step.bars(problem, lambda: [copied(body, 1) for body in bodies],
                                  solved.pose, solved, dt)
        mirrored = implicit_stages.after(problem, self.mirrored.bodies, self.mirrored.pose, v, dt)
        values = implicit_stages.after(problem, bodies, solved.pose, v, dt)
        rng = np.random.default_rng(error_bounds.SEED)
        exact = twin.after_solve(v)
        others = [sample.after_solve(error_bounds.perturbed(v, rng, solved.S))
                  for sample in samples]
        S = error_bounds.scales(exact, others, sum(map(len, self.volumes.values())))
        S, other = error_bounds.with_stress_error(S, self.volumes), in_order(mirrored)
        return {key: measured(a, S[key], exact[key], other[key])
                for key, a in values.items()}, bars

    def inputs(self, values):
        """Return what operators were applied to, and the nodes of coarse levels."""
        operands = {name: getattr(self.operands, name) for name in ("trial", "probe", "load")}
        return operands | {name: a for name, a in values.items()
                           if name in BESIDE and name != "nodes"}


def in_order(arrays):
    """Return the arrays of the reversed run in the order of the other; its nodes are the same."""
    return {key: a[::-1] if "/" in key and not key.endswith("/energy") else a
            for key, a in arrays.items()}
