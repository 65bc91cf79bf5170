"""Scenes: what a run is determined by, from a TOML file or from Python, and the problem it makes.

    scene = load("scenes/hello.toml")           # or Scene(dim=2, dx=0.05, body=(Body(...),), ...)
    problem = build(scene)                      # for simulate.simulate

The keys of the file are the fields of the records; docs/reference/scenes.md explains each of them.
"""

import numpy as np

from ..problem import Problem
from ..sampling import Jittered, Lattice, Poisson, Regular
from ..shapes import (
    Box,
    Capsule,
    Cylinder,
    Difference,
    HalfSpace,
    Intersection,
    Mesh,
    Moved,
    Sphere,
    Torus,
    Union,
    Wedge,
)
from .builder import (
    build_body,
    build_clock,
    build_conditions,
    build_limits,
    build_solver,
    strain_bounds,
)
from .messages import SceneError, opened_by
from .records import (
    Arrays,
    Body,
    Clip,
    Collider,
    Fixed,
    Flow,
    Keyframes,
    Limits,
    Material,
    Motion,
    Oscillation,
    Ramps,
    Scene,
    Scheme,
    Solver,
    Steady,
    Velocity,
    Walls,
)
from .toml import canonical, digest, dumps, load, loads
from .validate import checked

__all__ = [
    "Arrays", "Body", "Box", "Capsule", "Clip", "Collider", "Cylinder", "Difference", "Fixed",
    "Flow", "HalfSpace", "Intersection", "Jittered", "Keyframes", "Lattice", "Limits", "Material",
    "Mesh", "Motion", "Moved", "Oscillation", "Poisson", "Ramps", "Regular", "Scene", "SceneError",
    "Scheme", "Solver", "Sphere", "Steady", "Torus", "Union", "Velocity", "Walls", "Wedge", "build",
    "canonical", "digest", "dumps", "load", "loads",
]


def build(scene, source=""):
    """The `Problem` of a scene: bodies sampled, conditions and clock made.

    `source`, usually a file name, opens error messages. Raises SceneError, which names the key that
    does not work.
    """
    scene = checked(scene, source)
    with opened_by(source):
        return _built(scene)


def _built(scene):
    clip, solver = scene.clip, build_solver(scene)
    return Problem(
        bodies=tuple(build_body(scene, k) for k in range(len(scene.body))),
        dx=scene.dx,
        clock=build_clock(scene),
        gravity=np.zeros(scene.dim) if scene.gravity is None else np.array(scene.gravity),
        scheme=scene.step_scheme,
        conditions=build_conditions(scene),
        clip=None if clip is None else (np.array(clip.lower), np.array(clip.upper)),
        limits=build_limits(scene),
        allow_unstable=scene.unstable == "allow",
        title=scene.title,
        source=canonical(scene),
        integrator="explicit" if solver is None else "implicit",
        solver=solver,
        strain_bounds={body.name: bounds for k, body in enumerate(scene.body)
                       if (bounds := strain_bounds(body, scene.dim, k)) is not None},
    )
