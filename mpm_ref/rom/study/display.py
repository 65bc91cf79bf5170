"""The bodies of a reduced state, with all fields that a results file stores.

LDM's map is continuous in space: a single body is shown at any number of points, not only at those
that it was trained with (LDM-sec5.2.1). Maps of several bodies, and NSF's fields, are known at the
points of their data.
"""

from typing import NamedTuple

import msgspec
import numpy as np
from scipy.spatial import KDTree

from ...body import Body, particles_at
from ...explicit import initial_stress
from ...materials import NoFlow
from ...sampling import Poisson
from ..fields.pod import PodModes
from ..fields.polynomial_manifold import Curved
from ..kinematics import evaluate
from ..latent import velocities
from .full_model import FullModel


class MapDisplay(NamedTuple):
    """A body of a run of LDM, at n points."""

    g: object           # the map, `tabulated` at these points
    X: np.ndarray       # (n, d) at rest [m]; of several bodies, numbers (n,)
    body: Body          # these points with their masses, in their own order
    velocity: str       # one of `rom.latent.VELOCITIES`
    v0: np.ndarray | None = None    # velocities at the start [m/s] of points that have numbers

    @property
    def count(self):
        """Number of points."""
        return len(self.X)

    def bodies(self, latent, dt):
        """Return the body in a reduced state, as a tuple: x, v, F and the stress that follows; dt
        [s]: length of the step that led here.
        """
        points = evaluate(self.g, self.X, latent.xhat)
        v = velocities(self.g, latent, dt, self.X, self.v0)[self.velocity](points)
        particles = self.body.particles._replace(x=points.x, v=v, F=points.F)
        body = self.body._replace(particles=particles)
        initial_stress(body)
        return (body,)


class BodiesDisplay(NamedTuple):
    """The bodies of a run of LDM with several."""

    parts: tuple        # of `MapDisplay`

    @property
    def count(self):
        """Number of points."""
        return sum(one.count for one in self.parts)

    def bodies(self, latent, dt):
        """Return the bodies in a reduced state; dt [s]: length of the step that led here."""
        return sum((one.bodies(latent, dt) for one in self.parts), ())


def bodies_display(g, full, velocity):
    """Return the `BodiesDisplay` of a map of numbered points at those of a `FullModel`."""
    points = zip(full.bodies, full.body_points, strict=True)
    return BodiesDisplay(tuple(MapDisplay(g, numbers[body.id], body, velocity, full.v)
                               for body, numbers in points))


class FieldDisplay(NamedTuple):
    """The bodies of a run of NSF. They have no law: of a stress that is inferred no strain and no
    elastic energy is known.
    """

    full: FullModel
    fields: object          # of this run

    @property
    def count(self):
        """Number of points."""
        return len(self.full.X)

    def bodies(self, latent, dt):
        """Return the bodies in a reduced state; dt [s]: length of the step that led here."""
        points, fields, full = np.arange(self.count), self.fields, self.full
        x, v = fields.place(points, latent.xhat), full.v
        if latent.before is not None:
            v = (x - fields.place(points, latent.before)) / dt
        tau, C = (field(points, latent.xhat) for field in (fields.stress, fields.affine))
        ends = np.cumsum([len(body.id) for body in full.problem.bodies])
        bodies = zip(full.problem.bodies, np.split(points, ends[:-1]), strict=True)
        return tuple(self.body(body.name, p, (x[p], v[p], tau[p], C[p])) for body, p in bodies)

    def body(self, name, points, values):
        """Return a `Body` of points with positions, velocities, stress and affine field."""
        x, v, tau, C = values
        m, V0 = self.full.m[points], self.full.V0[points]
        particles = particles_at(x, v, m, V0, transfer="apic")._replace(tau=tau, C=C)
        return Body(name, particles, None, NoFlow(), np.arange(len(points)))


def map_display(g, body, velocity):
    """Return the `MapDisplay` of a map at the points of a body at rest."""
    X = body.particles.x.copy()
    return MapDisplay(tabulated(g, X), X, body, velocity)


def tabulated(g, X):
    """Return `Modes` with their values at points X (n, d), so that they are not fitted anew in each
    step where these are not those of the data; also those of a `Curved` map. Return a network
    itself.
    """
    if isinstance(g, Curved):
        return g._replace(modes=tabulated(g.modes, X))
    if not isinstance(g, PodModes):
        return g
    slope = [g.derivatives(X, axis)[1] - np.eye(g.dim) for axis in np.eye(g.r)]
    return PodModes(X, g.derivatives(X, np.zeros(g.r))[2], np.stack(slope, axis=-1), KDTree(X))


def resampled(scene, count):
    """Return the scene with `count` random points in its body's shape, no two of them close."""
    body, replace = scene.body[0], msgspec.structs.replace
    random = Poisson(count=count, seed=getattr(body.sampling, "seed", None))
    return replace(scene, body=(replace(body, sampling=random),))
