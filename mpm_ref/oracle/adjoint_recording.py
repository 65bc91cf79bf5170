"""Recording explicit steps with their adjoints, stage by stage: see `recording`.

Each step is differentiated by itself: its loss is sum <seed, state after the step>, with random
seeds that the file holds, in which another code's adjoint begins.
"""

import numpy as np

from ..adjoint import StepAdjoint, clip_adjoint, require_adjoint
from . import adjoint_stages, error_bounds, plain_adjoint
from .plain_adjoint import Seeds
from .plain_twin import Twin
from .recording import (
    MARGIN,
    UNSURE,
    Runs,
    copied,
    in_order,
    measured,
    refuse_past_end,
)

SEED = 20270
COARSE = 2.0**20        # ulps of the perturbations that tell a kink from a slope
COARSE_SAMPLES = 4


def run(problem, steps, state=None):
    """Yield one `Recorded` for each step, as `recording.run`, with the arrays of its adjoint too.

    Raises ValueError as that does, and for what has no adjoint.
    """
    require_adjoints(problem)
    runs = Runs(problem, state)
    refuse_past_end(problem.clock, state, runs.dt, steps)
    for k in range(steps):
        before = [tuple(copied(body, 1) for body in p.bodies) for p in runs.problems]
        done = runs.step(k)
        seeds = [seeds_of(problem, body, runs.dt, k) for body in before[0]]
        x = [done.arrays[f"{body.name}/x"].value for body in before[0]]
        arrays = StepGradients(runs, done, unclipped(problem.clip, seeds, x)).recorded(before, k)
        inputs = {f"{body.name}/{name}_seed": a for body, seed in zip(before[0], seeds)
                  for name, a in seed._asdict().items() if a is not None}
        yield done._replace(arrays=done.arrays | arrays, inputs=inputs)


def require_adjoints(problem):
    """Raise ValueError for an integrator, conditions, a law or a flow without an adjoint."""
    StepAdjoint(problem.stepper())
    for body in problem.bodies:
        require_adjoint(body)


def unclipped(clip, seeds, x):
    """The `Seeds` of each body as the step before a clip of positions sees them: 0 for coordinates
    that it holds. clip is (lower, upper) or None, x the positions (N, d) of each body after it.
    """
    if clip is None:
        return seeds
    seeds = [seed._replace(x=seed.x.copy()) for seed in seeds]
    clip_adjoint(x, seeds, *clip)
    return seeds


def seeds_of(problem, body, dt, k):
    """`Seeds` of a body after step k: random, of a size at which all of them tell on a node."""
    q, dx = body.particles, problem.dx
    rng = np.random.default_rng((SEED, k, len(q.m)))
    speed = dx / dt
    sizes = {"x": 1 / dt, "v": 1.0, "C": dx, "F": speed, "y": speed / (2 * body.law[0])}
    return Seeds(*(sizes[name] * rng.uniform(-1.0, 1.0, a.shape) if len(a) else None
                   for name in Seeds._fields for a in [getattr(q, name)]))


class StepGradients:
    """The adjoint of the step `done` that the `Runs` have just made."""

    def __init__(self, runs, done, seeds):
        self.runs, self.done, self.seeds = runs, done, seeds

    def recorded(self, before, k):
        """Return {key: `Golden`} of all stages backwards; k is the number of the step.

        `before` has the bodies of the kernels before it, in order and reversed. Raises ValueError
        on a kink.
        """
        value, other = self.by_kernels(before)
        exact = self.by_twin(self.runs.twin, self.runs.last.exact)
        samples = [self.by_twin(twin, step) for twin, step in
                   zip(self.runs.perturbed, self.runs.last.samples)]
        S = error_bounds.scales(exact, samples, self.runs.count)
        arrays = {key: measured(a, S[key], exact[key], other[key]) for key, a in value.items()}
        self.refuse_kinks(arrays, exact, k)
        return arrays

    def by_kernels(self, before):
        """Return {key: array} of the kernels, and of those with particles reversed."""
        last, when = self.runs.last.kernels, (self.done.t, self.done.dt)
        reversed_ = [seed.reversed() for seed in self.seeds]
        value, other = (adjoint_stages.step(problem, bodies, after, seeds, when)
                        for problem, bodies, after, seeds
                        in zip(self.runs.problems, before, last, (self.seeds, reversed_)))
        return value, in_order(other, last[1]["nodes"], self.done.nodes)

    def by_twin(self, twin, step):
        """Return {key: array} of a plain twin that made the `TwinStep` step."""
        on_empty = self.runs.problems[0].scheme.gravity_on_empty
        return plain_adjoint.gradients(twin, step, self.seeds, on_empty, self.done.nodes)

    def refuse_kinks(self, arrays, exact, k):
        """Raise ValueError where an own error is neither small nor what round-off explains: there
        the runs took different branches, of which each has another gradient. A NaN is not small
        either.

        Samples on a kink are as far apart as the branches. What a smooth function may do is told
        by perturbations that are COARSE times as large, whose effect is divided by COARSE.
        """
        own = {key: max(a.twin, a.reordered) for key, a in arrays.items()}
        unsure = [key for key, a in arrays.items() if not own[key] <= UNSURE * abs(a.value).max()]
        coarse = self.coarse_samples() if unsure else []
        for key in unsure:
            where, a = error_bounds.where_of(key), arrays[key]
            smooth = error_bounds.entity_size(exact[key], where).astype(float)
            spread = error_bounds.deviation(exact[key], [s[key] for s in coarse], where)
            smooth = error_bounds.floored(smooth + error_bounds.SAFETY * spread / COARSE)
            error = measured(a.value, smooth, exact[key], a.value).error
            if not error <= MARGIN:
                raise ValueError(
                    f"{key} in step {k}: kernels and plain twin differ by {own[key]:.1e} beside "
                    f"its largest entry {abs(a.value).max():.1e}, {error:.1e} times what round-off "
                    "explains; something stands on a kink (a yield surface, a contact that opens, "
                    "the face of a cell) and has no definite gradient: take another state"
                )

    def coarse_samples(self):
        """Return the gradients {key: array} at states that are COARSE ulps away."""
        step, twin = self.runs.last.exact, Twin(self.runs.problems[0], np.float64)
        rng, samples = np.random.default_rng(error_bounds.SEED), []
        contacts = {tuple(np.array(i) + step.stages.nodes.box.first): c
                    for i, c in step.contacts.items()}
        for _ in range(COARSE_SAMPLES):
            twin.bodies = [error_bounds.perturbed_body(q.cast(np.float64), rng, COARSE)
                           for q in step.before]
            samples.append(self.by_twin(twin, twin.step(self.done.dt, self.done.nodes, contacts)))
        return samples
