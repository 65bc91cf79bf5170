"""Recording explicit steps with their adjoints, stage by stage: see `recording`.

Each step is differentiated by itself: its loss is sum <seed, state after the step>, with random
seeds that the file holds, in which another code's adjoint begins.
"""

import numpy as np

from ..adjoint import StepAdjoint, clip_adjoint, require_adjoint
from . import adjoint_stages
from .adjoint_material import Seeds
from .adjoint_twin import Backwards, Stage
from .plain_twin import on
from .recording import (
    MARGIN,
    UNSURE,
    Sides,
    copied,
    golden,
    measured,
    refuse_past_end,
    unmirrored,
)
from .scales import size
from .schema import WHERE

SEED = 20270


def run(problem, steps, state=None):
    """Yield one `Recorded` for each step, as `recording.run`, with the arrays of its adjoint too.

    Raises ValueError as that does, and for what has no adjoint.
    """
    require_adjoints(problem)
    sides = Sides(problem, state)
    refuse_past_end(problem.clock, state, sides.dt, steps)
    for k in range(steps):
        before = [tuple(copied(body, 1) for body in p.bodies) for p in sides.runs]
        done = sides.step(k)
        seeds = [seeds_of(problem, body, sides.dt, k) for body in before[0]]
        x = [done.arrays[f"{body.name}/x"].value for body in before[0]]
        arrays = backwards(sides, before, unclipped(problem.clip, seeds, x), done)
        refuse_kinks(arrays, k)
        beside = {f"{body.name}/{name}_seed": a for body, seed in zip(before[0], seeds)
                  for name, a in seed._asdict().items() if a is not None}
        yield done._replace(arrays=done.arrays | arrays, beside=beside)


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


def refuse_kinks(arrays, k):
    """Raise ValueError where an own error is neither small nor what round-off explains: there the
    runs took different branches, of which each has another gradient. A NaN is not small either.
    """
    for key, a in arrays.items():
        own, largest = max(a.twin, a.reordered), abs(a.value).max()
        if not (own <= UNSURE * largest or a.error <= MARGIN):
            raise ValueError(
                f"{key} in step {k}: kernels and plain twin differ by {own:.1e} beside its largest "
                f"entry {largest:.1e}, {a.error:.1e} times what round-off explains; something "
                "stands on a kink (a yield surface, a contact that opens, the face of a cell) and "
                "has no definite gradient: take another state"
            )


def seeds_of(problem, body, dt, k):
    """`Seeds` of a body after step k: random, of a size at which all of them tell on a node."""
    q, dx = body.particles, problem.dx
    rng = np.random.default_rng((SEED, k, len(q.m)))
    speed = dx / dt
    sizes = {"x": 1 / dt, "v": 1.0, "C": dx, "F": speed, "y": speed / (2 * body.law[0])}
    return Seeds(*(sizes[name] * rng.uniform(-1.0, 1.0, a.shape) if len(a) else None
                   for name in Seeds._fields for a in [getattr(q, name)]))


def backwards(sides, before, seeds, done):
    """{key: `Golden`} of the adjoint of the last step of the sides, which is `done`."""
    when, last = (done.t, done.dt), sides.last
    turned = [Seeds(*(None if a is None else a[::-1] for a in seed)) for seed in seeds]
    seen, other = (adjoint_stages.step(p, bodies, after, s, when) for p, bodies, after, s in
                   zip(sides.runs, before, last.seen, (seeds, turned)))
    other = unmirrored(other, last.seen[1]["nodes"], done.nodes)
    twin, box = sides.twin, last.done.nodes.box
    on_empty = sides.runs[0].scheme.gravity_on_empty
    stage = Stage(twin, last.before, last.done, last.found, last.errors, last.contacts, on_empty)
    exact = Backwards(stage).seen([Seeds(*(None if a is None else a.astype(twin.real)
                                           for a in seed)) for seed in seeds])
    arrays = {}
    for key, a in seen.items():
        value, S = exact[key]
        where = WHERE[key.split("/")[-1]]
        if where == "nodes":
            value, S = on(value, box, done.nodes), on(S, box, done.nodes)
        if where in ("nodes", "particles"):
            S = size(S[:, None])
        judge = measured if where == "parameters" else golden   # parameters have units of their own
        arrays[key] = judge(a, S.astype(float), value, other[key])
    return arrays
