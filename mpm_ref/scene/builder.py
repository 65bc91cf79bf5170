"""Build the parts of a `Problem` from a valid scene: bodies, colliders, motions, clock, limits.

Each `build_*` takes a valid record. It raises SceneError, with the path of the key, for errors that
only the built object can detect.
"""

from math import inf, radians
from typing import NamedTuple

import numpy as np

from ..body import AFFINE, Body, in_precision, particles_at, with_separate_gradient
from ..body_contact import BodyContact, check_contacts
from ..core import motion as rigid
from ..core.boundary import BoxWalls, Conditions, Prescribed
from ..core.boundary import Collider as RigidCollider
from ..core.surface import SurfaceConditions
from ..hot.methods import METHODS, options_of, released
from ..hot.step import check_scheme
from ..materials import Material
from ..materials.learned.guard import guarded, strain_box
from ..materials.learned.strain_range import stored_bounds
from ..monitor import Limits
from ..problem import Clock
from ..sampling import sample
from ..sampling.arrays import read_arrays
from ..shapes import level_set
from ..shapes.inside import rotation, solid
from .messages import SceneError, errors_at
from .records import Keyframes, Oscillation, Ramps, Steady
from .streams import build_sinks, check_streams, held_regions

NAMES = f'expected "explicit" or one of {", ".join(METHODS)}'
CFL = 0.5       # share of the stable time step, for a scene that says nothing about its step


class SceneParts(NamedTuple):
    """The objects of a scene besides its bodies; none of them changes during a run."""

    clock: Clock
    limits: Limits
    conditions: Conditions | None
    solver: object              # `hot.methods.Options`; None for the explicit integrator
    contacts: tuple             # of BodyContact between bodies
    sinks: tuple                # of streams.ParticleSink
    materials: tuple            # of (law, flow) for each body; None where a file holds them


def build_parts(scene):
    """Return the `SceneParts` of a scene. Raises SceneError for a part that cannot be built."""
    check_precision(scene)
    materials = tuple(build_material(body, scene.dim, k) for k, body in enumerate(scene.body))
    clock = build_clock(scene)
    check_streams(scene, clock)
    return SceneParts(clock, build_limits(scene), build_conditions(scene),
                      build_solver(scene), build_contacts(scene), build_sinks(scene), tuple(
                          None if record.material.is_neural else (law, flow)
                          for record, (law, flow, _) in zip(scene.body, materials)))


def check_precision(scene):
    """Raise SceneError where a scene of single precision has a part that only double has."""
    neural = [body.name for body in scene.body if body.material.is_neural]
    if scene.scheme.precision == "single" and neural:
        raise SceneError('scheme.precision = "single": the learned law of body '
                         f'{neural[0]!r} gives its stress in double; expected "double"')


def build_material(body, dim, k):
    """Return law, return map and training range of body number k (see `records.Material.build`).

    The range is None unless the law is learned. Raises SceneError.
    """
    path = f"body[{k}].material"
    with errors_at(path + ("" if body.material.is_neural else ".flow")):
        law, flow, about = body.material.build(dim)
    with errors_at(f"{path}.weights"):
        bounds = None if about is None else stored_bounds(about, dim)
    if bounds is not None and body.material.guard:
        box = strain_box(bounds)
        law, flow = guarded(law, box), guarded(flow, box)
    return law, flow, bounds


def build_bodies(scene, arrays):
    """Return the bodies of a checked scene, and {body: strains of its training} of learned laws.

    arrays: {body: checked arrays of `sampling.arrays`} of bodies without shape and file.

    A file of weights is read again, since it may have changed since the check. Raises SceneError.
    """
    bodies, ranges = [], {}
    for k, record in enumerate(scene.body):
        built = scene.parts.materials[k]
        law, flow, strains = (*built, None) if built else build_material(record, scene.dim, k)
        bodies.append(build_body(scene, k, Material(law, flow), arrays.get(record.name)))
        if strains is not None:
            ranges[record.name] = strains
    return tuple(bodies), ranges


def build_body(scene, k, material, arrays=None):
    """Return body number k of a checked scene. Raises SceneError with the path of what fails."""
    record, path = scene.body[k], f"body[{k}]"
    if record.shape is not None:
        particles = _sampled(scene, record, material, (path, [scene.seed, k]))
    else:
        particles = _particles_of(scene, record, material, (path, arrays))
    with errors_at(path):
        particles = in_precision(particles, scene.step_scheme.real)
    return Body(record.name, particles, *material, np.arange(len(particles.x)))


def _sampled(scene, record, material, where):
    """Return particles that fill the body's shape; `where` is its path and its seed."""
    path, seed = where
    with errors_at(f"{path}.shape"):
        shape = solid(record.shape)
    with errors_at(f"{path}.sampling"):
        x, V0 = sample(record.sampling, shape, scene.dx, seed)
    m = record.density * V0
    return _at_rest(scene, material, x, velocity(record.velocity, x, m), (m, V0))


def _at_rest(scene, material, x, v, sizes):
    """Return undeformed particles; `sizes` are their masses and volumes."""
    scheme = scene.step_scheme
    particles = particles_at(x, v, *sizes, scheme.transfer, fluid=not material.needs_F)
    if scheme.relaxation:
        particles = with_separate_gradient(particles)
    if not material.has_history:
        return particles
    return particles._replace(y=np.full(len(x), material.initial_y))


def velocity(record, x, m):
    """Return v = linear + angular x (x - center) at points x (N, d) with masses m (N,)."""
    v = np.zeros_like(x)
    if record.linear is not None:
        v += record.linear
    center = np.average(x, axis=0, weights=m) if record.center is None else record.center
    r = x - np.asarray(center)
    if isinstance(record.angular, tuple):
        return v + np.cross(record.angular, r)
    return v + record.angular * np.column_stack([-r[:, 1], r[:, 0]]) if x.shape[1] == 2 else v


def _particles_of(scene, record, material, where):
    """Return particles from arrays of a file, or from `where`: the body's path and arrays."""
    (path, a), source = where, record.particles
    with errors_at(f"{path}.particles"):
        if a is None and source.file is None:
            raise ValueError("its arrays were handed over in Python: use problem_from_arrays")
        if a is None:
            a = read_arrays(source.file, scene.dim, source.group, source.select, source.ignore)
        m, V0 = masses(a, record.density)
        a = _deformation(a, material)
    if "v" in a and record.velocity.moves:
        raise SceneError(f"{path}.velocity: the arrays have velocities v; leave this table out")
    x = a["x"] if source.offset is None else a["x"] + source.offset
    v = a.get("v", velocity(record.velocity, x, m))
    particles = _at_rest(scene, material, x, v, (m, V0))
    if "C" in a and scene.step_scheme.transfer in AFFINE:
        particles.C[:] = a["C"]
    if "y" in a and material.has_history:
        particles.y[:] = a["y"]
    if "J" in a or "F" in a:
        particles.F[:] = a["J"] if "J" in a else a["F"]
    return particles


def masses(a, density):
    """Return masses [kg] and volumes at rest [m^d] of particles from two of m, V0 and the density.

    density: a number, or None [kg/m^3]. Raises ValueError unless two of m, V0 and the density are
    given.
    """
    given = [name for name in ("m", "V0", "density") if name in a]
    given += ["density"] * (density is not None)
    if len(given) != 2 or given[0] == given[1]:
        raise ValueError(f"given of m [kg], V0 [m^d] and density [kg/m^3]: "
                         f"{', '.join(given) or 'none'}; expected two")
    density = a.get("density", density)
    return (a["m"] if "m" in a else density * a["V0"],
            a["V0"] if "V0" in a else a["m"] / density)


def _deformation(a, material):
    """Return the arrays with F if the material needs F, else with J, if need be from F."""
    if material.needs_F and "J" in a and "F" not in a:
        raise ValueError("the array F is missing; J alone is for a fluid that carries no F")
    if material.needs_F:
        return {name: value for name, value in a.items() if name != "J"}
    if "F" in a and "J" not in a:
        J = np.linalg.det(a["F"])
        if not (J > 0.0).all():
            p = int(np.argmin(J))
            raise ValueError(f"the array F has determinant {J[p]:.6g} for particle {p}: expected a "
                             "number > 0")
        return a | {"J": J}
    return a


def build_clock(scene):
    """Return the `Clock` of a scene: time steps, frames and end."""
    for a, b in (("dt", "cfl"), ("steps", "end"), ("every", "interval")):
        if getattr(scene, a) is not None and getattr(scene, b) is not None:
            raise SceneError(f"{a}: given together with `{b}`; give one of the two")
    if scene.steps is None and scene.end is None:
        raise SceneError("steps: this key is missing; give `steps` or `end`")
    cfl = CFL if scene.cfl is None else scene.cfl
    if scene.dt is None and cfl > 1.0 and scene.unstable != "allow":
        raise SceneError(f'cfl = {cfl}: expected at most 1, or with it unstable = "allow"')
    if scene.dt is not None and scene.longest is not None:
        raise SceneError("longest: given together with `dt`, which it could not change")
    longest = inf if scene.longest is None else scene.longest
    return Clock(scene.dt, cfl, scene.steps, scene.end, scene.every, scene.interval, longest)


def build_solver(scene):
    """Return the options of the scene's implicit method; None for the explicit integrator."""
    if scene.integrator == "explicit":
        if scene.solver is not None:
            raise SceneError('solver: given, but the integrator is "explicit"; add integrator = '
                             '"hot", or another implicit method, or remove this table')
        return None
    if scene.integrator not in METHODS:
        raise SceneError(f"integrator = {scene.integrator!r}: {NAMES}")
    with errors_at("scheme"):
        check_scheme(scene.step_scheme)
    if scene.boundary != "nodes":
        raise SceneError(f"boundary = {scene.boundary!r}: expected \"nodes\" with an implicit "
                         "integrator, whose constraints hold at nodes")
    if scene.contact:
        raise SceneError("contact: expected none with an implicit integrator, whose bodies have "
                         "one velocity field")
    if scene.solver is None:
        return options_of(scene.integrator)
    options = released if scene.solver.as_released else options_of
    return options(scene.integrator, **scene.solver.given())


def build_limits(scene):
    """Return the `Limits` within which a run is healthy."""
    limits = scene.limits
    if not limits.J[0] < 1.0 < limits.J[1]:
        raise SceneError(f"limits.J = {list(limits.J)}: expected two numbers, one < 1, one > 1")
    return Limits(limits.cfl, limits.J, limits.growth)


def build_conditions(scene):
    """Return colliders, prescribed regions, those of sources last, and walls; None if there are
    none.
    """
    colliders = tuple(_collider(c, scene.dim, f"collider[{k}]")
                      for k, c in enumerate(scene.collider))
    prescribed = tuple(_prescribed(f, scene.dim, f"fixed[{k}]") for k, f in enumerate(scene.fixed))
    prescribed += held_regions(scene)
    walls = _walls(scene.walls, scene.dim)
    if not colliders and not prescribed and walls is None:
        return None
    conditions = SurfaceConditions if scene.boundary == "surface" else Conditions
    return conditions(colliders, prescribed, walls)


def build_contacts(scene):
    """Return the contacts of bodies with each other."""
    contacts, names = [], [body.name for body in scene.body]
    for k, record in enumerate(scene.contact):
        with errors_at(f"contact[{k}]"):
            contacts.append(BodyContact(record.bodies, record.friction, record.kind))
            check_contacts(contacts, names, scene.step_scheme)
    return tuple(contacts)


def _collider(record, dim, path):
    with errors_at(f"{path}.shape"):
        shape = level_set(record.shape)
    motion = _motion(record.motion, dim, f"{path}.motion")
    with errors_at(path):
        return RigidCollider(shape, record.kind, record.friction, motion, record.inside)


def _prescribed(record, dim, path):
    with errors_at(f"{path}.region"):
        shape = level_set(record.region)
    motion = _motion(record.motion, dim, f"{path}.motion")
    until = inf if record.until is None else record.until
    with errors_at(path):
        return Prescribed(shape, motion, record.inside, record.follows, record.since, until)


def _walls(record, dim):
    if record is None:
        return None
    with errors_at("walls"):
        low, high = _nodes("low", record.low, dim), _nodes("high", record.high, dim)
        return BoxWalls(low, high, record.kind, record.friction)


def _nodes(name, nodes, dim):
    """Return node indices per axis, None for "open"."""
    nodes = nodes or dim * ("open",)
    if len(nodes) != dim:
        raise ValueError(f"{name} = {list(nodes)}: expected {dim} node indices or 'open'")
    return tuple(None if node == "open" else node for node in nodes)


def _motion(record, dim, path):
    """Return the rigid motion of a collider or region."""
    translation = _schedule(record.translation, dim, f"{path}.translation")
    turning = _schedule(record.rotation, 1, f"{path}.rotation")
    with errors_at(path):
        orientation = rotation(record.angle, record.axis, dim) if record.angle else None
        motion = rigid.Motion(translation, turning, record.axis, record.center, orientation)
        motion.pose(1.0, 1.0, dim)        # checks what belongs together
    return motion


def _schedule(record, size, path):
    """Return a schedule of vectors of this size, or of numbers for size 1."""
    if record is None:
        return None
    with errors_at(path):
        match record:
            case Steady():
                return rigid.Steady(_value("rate", record.rate, size), record.start, _stop(record))
            case Keyframes():
                return rigid.Keyframes(record.times, _values("values", record.values, size))
            case Ramps():
                return rigid.Ramps(record.times, _values("rates", record.rates, size))
            case Oscillation():
                amplitude = _value("amplitude", record.amplitude, size)
                return rigid.Oscillation(amplitude, record.frequency, radians(record.phase),
                                         record.start, _stop(record))


def _stop(record):
    return inf if record.stop is None else record.stop


def _values(name, values, size):
    return [_value(f"{name}[{k}]", value, size) for k, value in enumerate(values)]


def _value(name, value, size):
    """Return a vector of this size, or a number for size 1."""
    if np.shape(value) != (() if size == 1 else (size,)):
        expected = "a number" if size == 1 else f"{size} numbers"
        raise ValueError(f"{name} = {value}: expected {expected}")
    return np.array(value) if size > 1 else value
