"""Describe a run completely by a scene, from a TOML file or from Python.

    scene = load("scenes/hello.toml")           # or Scene(dim=2, dx=0.05, body=(Body(...),), ...)
    problem = build(scene)                      # the `Problem` that `simulate` advances
    problem = problem_from_arrays(bodies, dx, ...)      # from particles in NumPy arrays

The keys of the file are the fields of the records; docs/reference/scenes.md explains each of them.
"""

from ..sampling import Jittered, Lattice, Poisson, Regular
from ..shapes import (
    Box,
    Capsule,
    Cylinder,
    Difference,
    HalfSpace,
    Intersection,
    Mesh,
    Sphere,
    Torus,
    Transformed,
    Union,
    Wedge,
)
from .messages import SceneError
from .problem import build, problem_from_arrays
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

__all__ = [
    "Arrays",
    "Body",
    "Box",
    "Capsule",
    "Clip",
    "Collider",
    "Cylinder",
    "Difference",
    "Fixed",
    "Flow",
    "HalfSpace",
    "Intersection",
    "Jittered",
    "Keyframes",
    "Lattice",
    "Limits",
    "Material",
    "Mesh",
    "Motion",
    "Oscillation",
    "Poisson",
    "Ramps",
    "Regular",
    "Scene",
    "SceneError",
    "Scheme",
    "Solver",
    "Sphere",
    "Steady",
    "Torus",
    "Transformed",
    "Union",
    "Velocity",
    "Walls",
    "Wedge",
    "build",
    "canonical",
    "digest",
    "dumps",
    "load",
    "loads",
    "problem_from_arrays",
]
