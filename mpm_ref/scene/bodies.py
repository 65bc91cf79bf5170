"""The bodies of a scene: sampled from shapes, or read from arrays."""

import numpy as np

from ..body import AFFINE, Body, particles_at
from ..materials import Material
from ..sampling import sample
from ..sampling.arrays import read_arrays
from ..shapes.inside import solid
from .error import SceneError, at


def build_body(scene, k):
    """Body number k of a checked scene. Raises SceneError with the path of what does not work."""
    record, path = scene.body[k], f"body[{k}]"
    law = record.material.elastic()
    material = Material(law, record.material.flowing(scene.dim))
    if record.shape is not None:
        particles = _sampled(scene, record, material, (path, [scene.seed, k]))
    else:
        particles = _read(scene, record, material, path)
    return Body(record.name, particles, law, material.flow, np.arange(len(particles.x)))


def seen_by(record, dim, k):
    """What the laws of body number k have seen in training, or None; errors as of `build_body`."""
    with at(f"body[{k}].material.weights"):
        return record.material.seen(dim)


def _sampled(scene, record, material, where):
    """Particles that fill the body's shape; `where` is its path and its seed."""
    path, seed = where
    with at(f"{path}.shape"):
        shape = solid(record.shape)
    with at(f"{path}.sampling"):
        x, V0 = sample(record.sampling, shape, scene.dx, seed)
    m = record.density * V0
    return _at_rest(scene, material, x, velocity(record.velocity, x, m), (m, V0))


def _at_rest(scene, material, x, v, sizes):
    """Particles without deformation; `sizes` are their masses and volumes."""
    particles = particles_at(x, v, *sizes, scene.step_scheme.transfer, fluid=not material.needs_F)
    if not material.has_history:
        return particles
    return particles._replace(y=np.full(len(x), material.initial_y))


def velocity(record, x, m):
    """v = linear + angular x (x - center) at points x (N, d) with masses m (N,)."""
    v = np.zeros_like(x)
    if record.linear is not None:
        v += record.linear
    center = np.average(x, axis=0, weights=m) if record.center is None else record.center
    r = x - np.asarray(center)
    if isinstance(record.angular, tuple):
        return v + np.cross(record.angular, r)
    return v + record.angular * np.column_stack([-r[:, 1], r[:, 0]]) if x.shape[1] == 2 else v


def _read(scene, record, material, path):
    """Particles from a file of arrays."""
    source = record.particles
    with at(f"{path}.particles"):
        a = read_arrays(source.file, scene.dim, source.group, source.select)
        m, V0 = masses(a, record.density)
        _check_deformation(a, material)
    if "v" in a and record.velocity.moves:
        raise SceneError(f"{path}.velocity: the file has velocities v; leave this table out")
    v = a.get("v", velocity(record.velocity, a["x"], m))
    particles = _at_rest(scene, material, a["x"], v, (m, V0))
    if "C" in a and scene.step_scheme.transfer in AFFINE:
        particles.C[:] = a["C"]
    if "y" in a and material.has_history:
        particles.y[:] = a["y"]
    if "J" in a or "F" in a:
        particles.F[:] = a["J"] if "J" in a else a["F"]
    return particles


def masses(a, density):
    """Masses [kg] and volumes at rest [m^d] of arrays, the one from the other by the density.

    Raises ValueError unless two of m, V0 and the density are known.
    """
    known = [name for name in ("m", "V0") if name in a] + ["density"] * (density is not None)
    if len(known) != 2:
        raise ValueError(f"known of m, V0 and density: {', '.join(known) or 'none'}; expected two")
    return (a["m"] if "m" in a else density * a["V0"],
            a["V0"] if "V0" in a else a["m"] / density)


def _check_deformation(a, material):
    """F for what carries F, J (or an F whose determinant is J) for what carries J."""
    if not material.needs_F and "F" in a and "J" not in a:
        a["J"] = np.linalg.det(a["F"])
        if not (a["J"] > 0.0).all():
            p = int(np.argmin(a["J"]))
            raise ValueError(f"the array F has determinant {a['J'][p]:.6g} for particle {p}: "
                             "expected a number > 0")
    if material.needs_F and "J" in a:
        if "F" not in a:
            raise ValueError("the array F is missing; J alone is for a fluid that carries no F")
        del a["J"]
