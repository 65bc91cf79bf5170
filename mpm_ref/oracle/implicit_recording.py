"""Recording an implicit step: as `recording`, but every step begins from the golden state.

Two codes that are both right leave a step by what the tolerance of its solve admits, and would
enter the next one with that difference. So the other code begins step k from the arrays that the
golden file has for the end of step k - 1, and all that comes before the solve is held to round-off.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from . import accepted_step, implicit_stages, sampled, scales, scaling
from .implicit_scales import Scales
from .implicit_twin import SolvedTwin, collected, embedding, spread
from .recording import (
    Golden,
    Recorded,
    aligned,
    copied,
    golden,
    problem_of,
    refuse_past_end,
    refuse_unsure,
    step_length,
)
from .scales import size
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
    """One run of the kernels: a step posed, before its solve."""

    def __init__(self, problem, bodies, stepper, t, dt):
        self.problem, self.bodies, self.stepper = problem, bodies, stepper
        self.pose = stepper.problem(bodies, t, dt)
        self.system = stepper.system(self.pose)
        self.A = self.system.matrix(self.system.start)
        self.g = self.system.evaluate(self.system.start)[1]

    def grids(self, options):
        """The hierarchy at the start."""
        return implicit_stages.grids_of(self.A, self.system.index, options)

    def seen(self, fixed, grids, options):
        """{key: array} of all stages before the solve."""
        seen = implicit_stages.before(self.problem, self.bodies, self.stepper, self.pose)
        seen |= implicit_stages.of_potential(self.system, fixed)
        if grids is not None:
            seen |= implicit_stages.of_multigrid(grids, fixed)
        if options.descent != "admm":
            seen["direction"] = implicit_stages.direction(self.system, self.A, self.g, options)
        return seen


class Step:
    """One step of the bodies of a problem, from time t by dt; `recorded` advances them."""

    def __init__(self, problem, stepper, t, dt):
        self.problem, self.stepper, self.t, self.dt = problem, stepper, t, dt
        self.options = stepper.options
        self.ours = Side(problem, problem.bodies, stepper, t, dt)
        mirrored = tuple(copied(body, -1) for body in problem.bodies)
        self.mirrored = Side(problem, mirrored, problem.stepper(), t, dt)
        self.grids = self.fixed = None

    def recorded(self, k):
        """The `Recorded` of step k."""
        options = self.options
        if options.inverse == MULTIGRID:
            self.grids = self.ours.grids(options)
        coarse = self.grids.levels[1:] if self.grids else ()
        self.fixed = implicit_stages.draw(self.ours.system, coarse)
        twin = SolvedTwin(self.problem, self.ours.pose.unknowns, self.dt)
        seen, exact, S = self.before_solve(twin)
        other = self.by_the_other_side()
        for name in twin.names:
            at = exact[f"{name}/base"], seen[f"{name}/base"]
            exact[f"{name}/weights"] = aligned(exact[f"{name}/weights"], *at)
            S[f"{name}/weights"] = aligned(S[f"{name}/weights"], *at)
        for name in ("cycle", "direction"):     # their twin is the other path of multigrid
            if name in seen:
                exact[name] = other[name]
        arrays = {name: golden(seen[name], S[name], exact[name], other[name]) for name in S}
        solved = accepted_step.solve(self.stepper, self.ours.bodies, self.dt, S["gradient_start"],
                                     self.t)
        arrays["dv"] = Golden(solved.dv, solved.S, solved.near, solved.second, 0.0)
        following, bars = self.after_solve(twin, solved)
        arrays |= following
        refuse_unsure({name: a for name, a in arrays.items() if name != "dv"}, k)
        return Recorded(self.t, self.dt, seen["nodes"], bases_of(seen, twin.names), arrays,
                        bars | {"dv": solved.bar}, self.beside(seen), solved.report)

    def before_solve(self, twin):
        """What the kernels see, what the twin sees, and scales: of all stages before the solve."""
        S_of, fixed, system = Scales(twin), self.fixed, self.ours.system
        seen = self.ours.seen(fixed, self.grids, self.options)
        exact = twin.before() | twin.conditions() | {"kappa": twin.kappa()}
        if self.options.start == "gravity":
            exact["start"] = exact["start"] + twin.free(0 * exact["start"] + twin.dt * twin.gravity)
        S = S_of.before()
        for name, dv in (("start", system.start), ("trial", fixed.trial)):
            ats = twin.at(dv)
            stiff = S_of.stiff(ats, dv)
            E, g = twin.potential(dv)
            S_E, S_g = S_of.potential(ats, dv)
            exact |= {f"E_{name}": E, f"gradient_{name}": g,
                      f"product_{name}": twin.product(ats, fixed.probe)}
            S |= {f"E_{name}": S_E, f"gradient_{name}": S_g,
                  f"product_{name}": S_of.product(stiff, fixed.probe, size(fixed.probe))}
            if name == "start":
                self.coarse(twin, (ats, stiff), S_of, (exact, S))
        A, options = self.ours.A, self.options
        if self.grids is not None:
            S["cycle"] = sampled.scale(
                lambda A, b: implicit_stages.grids_of(A, system.index, options).cycle(b),
                system, A, fixed.load, size(fixed.load))
        if "direction" in seen:
            S["direction"] = sampled.scale(
                lambda A, g: implicit_stages.direction(system, A, g, options),
                system, A, self.ours.g, S["gradient_start"])
        return seen, exact, S

    def coarse(self, twin, at, S_of, found):
        """Prolongations and coarse products of the twin, and their scales, into `found`."""
        (ats, stiff), (exact, S) = at, found
        if self.grids is None:
            return
        levels = self.grids.levels
        W = [embedding(fine.index, coarse.index, self.options.kernel)
             for fine, coarse in pairwise(levels)]
        B = [level.B.astype(twin.real) for level in levels]
        whole = [np.ones((len(b), 1, 1)) for b in B]
        for k, u in enumerate(self.fixed.coarse, 1):
            u, a = u.astype(twin.real), size(u)[:, None]
            for l in reversed(range(k)):
                u, a = spread(W[l], B[l], u), spread(W[l], whole[l], a)
                if l == k - 1:
                    exact[f"prolonged{k}"], S[f"prolonged{k}"] = u, a[:, 0]
            g = twin.product(ats, u)
            S_g = S_of.product(stiff, u, a[:, 0])[:, None]
            for l in range(k):
                g = collected(W[l], B[l], g)
                S_g = collected(W[l], whole[l], S_g)
            exact[f"coarse{k}"], S[f"coarse{k}"] = g, S_g[:, 0]

    def by_the_other_side(self):
        """What the reversed run sees, on the other path of multigrid."""
        side, other = self.mirrored, {"blocks": "scipy", "scipy": "blocks"}
        options = replace(self.options, implementation=other[self.options.implementation])
        grids = None if self.grids is None else side.grids(options)
        return turned(side.seen(self.fixed, grids, options))

    def after_solve(self, twin, solved):
        """{key: `Golden`} and bars of what follows from the accepted velocities."""
        problem, bodies, dt = self.problem, self.problem.bodies, self.dt
        v = solved.pose.unknowns.v + solved.dv
        bars = accepted_step.bars(problem, lambda: [copied(body, 1) for body in bodies],
                                  solved.pose, solved, dt)
        mirrored = implicit_stages.after(problem, self.mirrored.bodies, self.mirrored.pose, v, dt)
        seen = implicit_stages.after(problem, bodies, solved.pose, v, dt)
        before, S_of = twin.bodies, Scales(twin)
        done = twin.moved(v)
        grid = {"velocity_bc": size(done.nodes.v, done.nodes.m.ndim) + twin.over(solved.S),
                "swing": S_of.swing}
        found, exact = {}, twin.seen(done, twin.unknowns.index)
        for k, name in enumerate(twin.names):
            new = scaling.particles(twin, before[k], done, k, (S_of.S[k], S_of.W[k], grid))
            psi = new.pop("psi")
            new["energy"] = scales.energies(twin.bodies[k], twin.method, twin.gravity, new,
                                                    psi)
            found |= {f"{name}/{field}": a.astype(float) for field, a in new.items()}
        other = turned(mirrored)
        return {key: golden(a, found[key], exact[key], other[key]) for key, a in seen.items()}, bars

    def beside(self, seen):
        """What operators were applied to, and the nodes of coarse levels."""
        fixed = {name: getattr(self.fixed, name) for name in ("trial", "probe", "load")}
        return fixed | {name: a for name, a in seen.items()
                        if name in BESIDE and name != "nodes"}


def turned(seen):
    """What a run with its particles reversed saw, in their order; its nodes are the same."""
    return {key: a[::-1] if "/" in key and not key.endswith("/energy") else a
            for key, a in seen.items()}


def bases_of(seen, names):
    """{body name: first node of each particle}."""
    return {name: seen[f"{name}/base"] for name in names}
