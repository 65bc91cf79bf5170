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
from .builder import build_bodies
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
from .validate import validate_scene

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
    scene = validate_scene(scene, source)
    with opened_by(source):
        return _built(scene)


def _built(scene):
    (clock, limits, conditions, solver, _), clip = scene.parts, scene.clip
    bodies, strain_bounds = build_bodies(scene)
    return Problem(
        bodies=bodies,
        dx=scene.dx,
        clock=clock,
        gravity=np.zeros(scene.dim) if scene.gravity is None else np.array(scene.gravity),
        scheme=scene.step_scheme,
        conditions=conditions,
        clip=None if clip is None else (np.array(clip.lower), np.array(clip.upper)),
        limits=limits,
        allow_unstable=scene.unstable == "allow",
        title=scene.title,
        source=canonical(scene),
        integrator="explicit" if solver is None else "implicit",
        solver=solver,
        strain_bounds=strain_bounds,
    )
