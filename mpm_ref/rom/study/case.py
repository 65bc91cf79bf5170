"""What a reduced run knows of a scene: its body, law, masses and conditions."""

from typing import NamedTuple

import numpy as np

from ...core.levelset import distances
from ...materials import NoFlow
from ...scene import build
from ...shapes import Difference, Intersection, Union, level_set
from ...trajectories import points_of


class Case(NamedTuple):
    """One run of a study: what a reduced model of it needs to know."""

    problem: object         # `Problem`; its body gives law, points, masses
    shape: object           # of the body at rest, as the scene has it
    X: np.ndarray           # (n, d) points at rest [m]
    m: np.ndarray           # (n,) [kg]
    V0: np.ndarray          # (n,) [m^d]
    near: tuple             # index arrays: the points within a cell, at the start, of each
                            # prescribed region

    @property
    def rho(self):
        """Density at rest [kg/m^d]."""
        return float(self.m.sum() / self.V0.sum())

    def held(self, t):
        """Those of `near` whose region holds in the step from time t [s] on; samples must not miss
        them (LDM-sec3.3-hyper).
        """
        middle = t + 0.5 * self.problem.clock.dt
        parts = zip(self.near, prescribed(self.problem), strict=True)
        return tuple(near for near, part in parts if part.since < middle < part.until)


def prescribed(problem):
    """The regions of a problem that are held or driven."""
    return () if problem.conditions is None else problem.conditions.prescribed


def case(scene):
    """`Case` of a scene. Raises ValueError for what a reduced run does not know: more bodies,
    plastic flow, an affine transfer, a start that moves, forces of single particles, a box.
    """
    problem = build(scene)
    body = problem.bodies[0]
    unknown = {"more than one body": len(problem.bodies) > 1,
               "plastic flow": not isinstance(body.flow, NoFlow),
               f"the transfer {problem.scheme.transfer}": problem.scheme.transfer != "pic",
               "a start that moves": np.any(body.particles.v),
               "forces of single particles": body.particles.b.ndim > 1,
               "a box that clips": problem.clip is not None}
    for what in (name for name, has in unknown.items() if has):
        raise ValueError(f"the scene {problem.title!r} has {what}: reduced runs know none")
    X, m, V0 = points_of(body)
    near = tuple(np.flatnonzero(distances(X, part.shape) <= problem.dx)
                 for part in prescribed(problem))
    return Case(problem, scene.body[0].shape, X, m, V0, near)


def distance(X, shape):
    """Signed distances (n,) of points X (n, d) from a shape of a scene [m], negative inside; of
    shapes made of others, a bound that is not larger.
    """
    match shape:
        case Union():
            return np.min([distance(X, part) for part in shape.shapes], axis=0)
        case Intersection():
            return np.max([distance(X, part) for part in shape.shapes], axis=0)
        case Difference():
            return np.maximum(distance(X, shape.shape), -distance(X, Union(shapes=shape.minus)))
    return distances(X, level_set(shape))
