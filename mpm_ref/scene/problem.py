"""Build a runnable `Problem` from a scene, or from arrays of particles in memory."""

import hashlib

import numpy as np

from ..hot.return_map import check_return_map
from ..hot.step import check_friction
from ..problem import Problem
from ..sampling.arrays import QUANTITIES, check_arrays
from ..streams import first_bodies
from .builder import build_bodies
from .messages import SceneError, errors_at, errors_of
from .streams import build_sources
from .toml import canonical
from .validate import plain, validate_scene

BODY_KEYS = "material", "density", "velocity", "offset"     # of a body, besides its arrays


def build(scene, source=""):
    """Return the `Problem` of a scene, with sampled bodies, boundary conditions and clock.

    source: usually a file name, with which error messages begin. Raises SceneError, which names the
    key at fault.
    """
    scene = validate_scene(scene, source)
    with errors_of(source):
        return _problem_of(scene, {})


def problem_from_arrays(bodies, dx, **keys):
    """Return the `Problem` of particles in NumPy arrays, to run explicitly or implicitly.

        problem = problem_from_arrays(
            {"block": {"material": {"law": "hencky", "E": 1e5, "nu": 0.3},
                       "x": x, "v": v, "F": F, "m": m, "V0": V0}},
            dx=0.05, cfl=0.5, end=1.0, gravity=(0.0, -9.8))

    bodies: {name: dict} with the `material` as in a scene and the arrays of N particles in d
    dimensions: x (N, d) [m]; two of m [kg], V0 (volume at rest [m^d]) and density (at rest
    [kg/m^3], also as one number), each (N,); and any of v (N, d) [m/s], C (N, d, d) (affine
    velocity field [1/s]), F (N, d, d), or J = det F (N,) of a fluid, and the yield stress y (N,)
    [Pa]. Missing ones are those of undeformed particles at rest; `velocity`, as in a scene, stands
    for v. `offset` (d,) [m] is added to x: nodes lie at whole multiples of dx, so that a grid with
    a node at the point o takes offset = -o, and all else of the problem stands in shifted
    coordinates.

    keys: all other keys of a scene (docs/reference/scenes.md): dt or cfl, steps or end, gravity,
    walls, collider, fixed, scheme, integrator, solver, ... as plain values or records. Arrays
    are copied. Raises SceneError, which names the body, the array, its shape and unit, or the key.
    """
    tables, arrays, dim = [], {}, _dimension(bodies)
    for name, body in bodies.items():
        with errors_at(f"bodies[{name!r}]"):
            own, arrays[name] = _split(dict(body), dim)
        particles = {"sha256": _digest(arrays[name]), "offset": own.pop("offset", None)}
        tables.append({"name": name, "particles": particles, **own})
    scene = validate_scene(plain({"dim": dim, "dx": dx, "body": tables, **keys}))
    return _problem_of(scene, arrays)


def _problem_of(scene, arrays):
    (clock, limits, conditions, solver, contacts, sinks, _), clip = scene.parts, scene.clip
    bodies, strain_bounds = build_bodies(scene, arrays)
    sources = build_sources(scene, bodies)
    if solver is not None:
        check_implicit_parts(bodies, conditions, solver)
    return Problem(
        bodies=first_bodies(bodies, sources),
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
        contacts=contacts,
        sources=sources,
        sinks=sinks,
    )


def _dimension(bodies):
    """Return d of the first body's x. Raises SceneError without one."""
    if not bodies:
        raise SceneError("bodies = {}: expected at least one")
    name, body = next(iter(bodies.items()))
    shape = np.shape(body.get("x", ()))
    if len(shape) != 2 or shape[1] not in (2, 3):
        raise SceneError(f"bodies[{name!r}]: the array x has shape {shape}: expected (N, 2) or "
                         "(N, 3), positions [m]")
    return shape[1]


def _split(body, dim):
    """Return the keys of a body for its table, and its checked arrays."""
    own = {key: body.pop(key) for key in BODY_KEYS
           if key in body and (key != "density" or np.ndim(body[key]) == 0)}
    allowed = {name: q.text for name, q in QUANTITIES.items() if name != "body"}
    if unknown := [name for name in body if name not in allowed]:
        texts = ", ".join(f"{name} {text}" for name, text in allowed.items())
        raise ValueError(f"unknown key {unknown[0]!r}; expected {', '.join(BODY_KEYS)}, or the "
                         f"arrays {texts}")
    return own, check_arrays(body, dim)


def _digest(arrays):
    """Return the sha256 of arrays, which stands for them in the text of a problem."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(f"{name}{arrays[name].shape}".encode() + arrays[name].tobytes())
    return digest.hexdigest()


def check_implicit_parts(bodies, conditions, solver):
    """Raise SceneError for friction or a return map that the options of implicit steps exclude."""
    with errors_at("integrator"):
        check_friction(conditions, solver)
    for k, body in enumerate(bodies):
        with errors_at(f"body[{k}].material.flow"):
            check_return_map(body, solver.return_map)
