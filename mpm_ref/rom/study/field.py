"""The full field of a reduced run at any points of the body, however many it was trained with
(LDM-sec5.2.1).
"""

from typing import NamedTuple

import msgspec
import numpy as np
from scipy.spatial import KDTree

from ...body import Body
from ...explicit import initial_stress
from ...sampling import Poisson
from ..fields.pod import Modes
from ..fields.polynomial_manifold import Curved
from ..kinematics import evaluate
from ..latent import velocities


class Field(NamedTuple):
    """Points at which a reduced run is shown."""

    map: object
    X: np.ndarray       # (n, d) at rest [m]
    body: Body          # these points with their masses, in their own order

    def at(self, latent, dt, velocity):
        """The body in a reduced state: x, v, F and the stress that follows; velocity is one of
        `rom.latent.VELOCITIES`, dt [s] the step that led here.
        """
        now = evaluate(self.map, self.X, latent.xhat)
        v = velocities(self.map, latent, dt, self.X)[velocity](now)
        body = self.body._replace(particles=self.body.particles._replace(x=now.x, v=v, F=now.F))
        initial_stress(body)
        return body


def field(map, body):
    """`Field` of a map at the points of a body at rest."""
    X = body.particles.x.copy()
    return Field(tabulated(map, X), X, body)


def tabulated(map, X):
    """`Modes` with their values at points X (n, d), so that they are not fitted anew in each step
    where these are not those of the data; also those of a `Curved` map. A network as it is.
    """
    if isinstance(map, Curved):
        return map._replace(modes=tabulated(map.modes, X))
    if not isinstance(map, Modes):
        return map
    slope = [map.derivatives(X, axis)[1] - np.eye(map.dim) for axis in np.eye(map.r)]
    return Modes(X, map.derivatives(X, np.zeros(map.r))[2], np.stack(slope, axis=-1), KDTree(X))


def resampled(scene, count):
    """The scene with so many random points in its body's shape, no two of them close."""
    body, replace = scene.body[0], msgspec.structs.replace
    random = Poisson(count=count, seed=getattr(body.sampling, "seed", None))
    return replace(scene, body=(replace(body, sampling=random),))
