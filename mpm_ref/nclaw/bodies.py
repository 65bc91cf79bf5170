"""Copies of bodies with other laws, such as learned ones, and material points without a grid."""

import numpy as np

from ..body import Body, particles_at
from ..materials import Material
from ..materials.learned import learned_flow, learned_law
from ..materials.learned.guard import guarded, strain_box


def body_with_laws(body, law, flow):
    """Return a copy of a body with other laws.

    J becomes F = J^(1/d) I where the laws read F, and F becomes J where they read J alone.
    """
    q, material = body.particles, Material(law, flow)
    transfer = "mls" if q.L is q.C else "apic" if q.C.ndim == 3 else "pic"
    particles = particles_at(q.x, q.v, q.m, q.V0, transfer, fluid=not material.needs_F)
    particles.F[:] = convert_gradients(q.F, particles.F.ndim == 3, q.x.shape[1])
    if q.C.ndim == 3:
        particles.C[:] = q.C
    if material.has_history:
        has_y = q.y.ndim == 1
        y = q.y.copy() if has_y else np.full(len(q.x), material.initial_y)
        particles = particles._replace(y=y)
    return Body(body.name, particles._replace(b=q.b.copy()), law, flow, body.id.copy())


def convert_gradients(F, full, d):
    """Return F (n, d, d) if `full`, else J (n,), from either of them."""
    if full == (F.ndim == 3):
        return F
    return F[:, None, None] ** (1.0 / d) * np.eye(d) if full else np.linalg.det(F)


def copy_body(body):
    """Return a copy of a body with its own laws."""
    return body_with_laws(body, body.law, body.flow)


def body_maker(laws, bounds=None, precision="double"):
    """Return a function that gives a body the laws of `LearnedLaws`.

    bounds: those of a training, to which the guard cuts strains (see `learned.guard`); by default
    there is no guard, and the laws are as they were trained;
    precision: of their layers (see `learned_law`).

    Raises ValueError for an elastic law that is no stress, and a plastic one that is no return map.
    """
    elastic = learned_law(laws.elastic, precision)
    plastic = learned_flow(laws.plastic, precision)
    if bounds is not None:
        box = strain_box(bounds)
        elastic, plastic = guarded(elastic, box), guarded(plastic, box)
    return lambda body: body_with_laws(body, elastic, plastic)


def material_points(law, flow, F):
    """Return a `Body` of material points at rest, of deformation gradients F (n, d, d), that belong
    to no grid.
    """
    n, d, _ = F.shape
    still, one, material = np.zeros((n, d)), np.ones(n), Material(law, flow)
    particles = particles_at(still, still, one, one, fluid=not material.needs_F)
    particles.F[:] = convert_gradients(F, material.needs_F, d)
    if material.has_history:
        particles = particles._replace(y=np.full(n, material.initial_y))
    return Body("points", particles, law, flow, np.arange(n))


def deformation_gradients(body):
    """Return F (n, d, d) of a body's particles, J^(1/d) I where they carry J alone."""
    return convert_gradients(body.particles.F, True, body.particles.x.shape[1])


def kirchhoff_stresses(body):
    """Return tau (n, d, d) [Pa] of a body's particles."""
    tau, d = body.particles.tau, body.particles.x.shape[1]
    return tau if tau.ndim == 3 else tau[:, None, None] * np.eye(d)
