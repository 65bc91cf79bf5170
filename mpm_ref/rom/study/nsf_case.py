"""A scene as NSF's reduced runs see it: the points of all its bodies in one list, whatever they are
made of; and the full-order runs that its fields are made of.
"""

from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from ...scene import build
from ...simulate import simulate
from ..snapshots import Histories
from ..step import MaterialPoints
from ..symmetric import values


class Whole(NamedTuple):
    """One run of a scene."""

    problem: object         # `Problem`
    X: np.ndarray           # (n, d) points at the start [m]
    matter: MaterialPoints  # of these points


def whole(scene):
    """`Whole` of a scene. Raises ValueError for what NSF's reduced runs do not know: an implicit
    integrator, a transfer other than apic, a fluid, forces of single particles, a box that clips.
    """
    problem = build(scene)
    particles = [body.particles for body in problem.bodies]
    unknown = (
        (problem.integrator != "explicit", f"the {problem.integrator} integrator",
         'integrator = "explicit", whose step they make'),
        (problem.scheme.transfer != "apic", f"the transfer {problem.scheme.transfer}",
         'scheme.transfer = "apic", whose affine field is one of theirs'),
        (any(p.F.ndim == 1 for p in particles), "a fluid", "solids, which have a shear stress"),
        (any(p.b.ndim > 1 for p in particles), "forces of single particles", "gravity alone"),
        (problem.clip is not None, "a box that clips", "none"))
    for what, expected in ((what, expected) for has, what, expected in unknown if has):
        raise ValueError(f"the scene {problem.title!r} has {what}: reduced runs with inferred "
                         f"stress expect {expected}")
    X, v, m, V0 = (at_once(problem.bodies, name) for name in ("x", "v", "m", "V0"))
    return Whole(problem, X, MaterialPoints(m, V0, v))


def at_once(bodies, name):
    """A field of all bodies' particles, each body's in the order in which it was sampled."""
    return np.concatenate([getattr(body.particles, name)[np.argsort(body.id)] for body in bodies])


def history(scene, mu, kind=np.float64, every=1):
    """`Histories` of one run with parameters mu, of each step or of one in `every`; stored as
    numbers of a kind.

    Raises ValueError as `whole` does, where the time step is adaptive, and where `every` does not
    divide the number of steps; `Unstable` and `TooLarge` as `simulate` does.
    """
    one = whole(replace(scene, every=every, interval=None))
    clock, (n, d) = one.problem.clock, one.X.shape
    if clock.dt is None:
        raise ValueError("the time step is adaptive: expected a fixed dt")
    if clock.steps % every:
        raise ValueError(f"one in {every} of {clock.steps} steps: expected a divisor of the steps, "
                         "so that the last is one of them")
    levels = clock.steps // every + 1
    x, C = (np.empty((1, levels, n, k), kind) for k in (d, d * d))
    tau = np.empty((1, levels, n, d * (d + 1) // 2), kind)
    for frame in simulate(one.problem):
        bodies = frame.state.bodies
        x[0, frame.index] = at_once(bodies, "x")
        tau[0, frame.index] = values(at_once(bodies, "tau"))
        C[0, frame.index] = at_once(bodies, "C").reshape(n, -1)
    return Histories(one.X, one.matter.m, one.matter.V0, one.matter.v[None],
                     np.array(mu, dtype=float)[None], x, tau, C, every * clock.dt)
