"""One step of a reduced model: kinematics at a few points, the grid, projection (LDM-alg2).

    samples -> quadrature points -> p2g -> grid update -> boundaries -> g2p -> projection

The middle is a step of the full model (`explicit`), on fewer points.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..body import Body, particles_at
from ..core.grid import OutOfRange, Storage, update
from ..explicit import Scheme, gather, initial_stress, scatter
from ..materials import NoFlow
from .kinematics import NoBody, placed
from .latent import VELOCITIES, moved, moving, velocities
from .projection import project_position, project_velocity

PROJECTIONS = ("linear", "nonlinear")
BREAKDOWNS = (NoBody, OutOfRange, np.linalg.LinAlgError)    # with which a run may end midway


class Report(NamedTuple):
    """What a reduced step did."""

    samples: int
    points: int             # quadrature points that carried mass
    rank: int               # of dg/dxhat at the samples
    residual: float         # rms distance of the trial velocities from the manifold [m/s]
    iterations: int         # of the nonlinear projection
    converged: bool         # ... whether they ended before they ran out
    quadrature: dict        # what the quadrature says of itself


@dataclass
class Reduced:
    """Advances latent coordinates by steps; `step` keeps no state but the grid's storage.

    The spacing of the grid and the degree of its splines are the quadrature's, the transfer is
    PIC. projection is "linear" (LDM-alg7) or "nonlinear" (LDM-alg6); velocity one of `latent`.
    Raises ValueError for a name that does not exist and a gravity of another dimension.
    """

    map: object
    quadrature: object
    law: tuple                  # the elastic law's parameters (see materials)
    gravity: np.ndarray         # (d,) [m/s^2]
    conditions: object = None   # with apply(grid, t, dt); see core.boundary
    projection: str = "linear"
    velocity: str = "previous"

    def __post_init__(self):
        self.gravity = np.asarray(self.gravity, dtype=float)
        if self.gravity.shape != (self.map.dim,) or not np.isfinite(self.gravity).all():
            raise ValueError(f"gravity = {self.gravity}: expected {self.map.dim} finite numbers, "
                             "in m/s^2")
        for name, known in (("projection", PROJECTIONS), ("velocity", VELOCITIES)):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected one of "
                                 + ", ".join(known))
        self.scheme = Scheme(self.quadrature.degree, "pic")
        self.storage = Storage(self.quadrature.dx, self.scheme.stencil, self.map.dim)

    def step(self, latent, samples, t, dt):
        """`Latent` and `Report` after a step from time t [s] by dt [s], with the samples of these
        indices. Raises one of BREAKDOWNS where the coordinates give no body.
        """
        if not np.isfinite(latent.xhat).all():
            raise NoBody(f"t = {t:.6g} s: latent coordinates {latent.xhat} are not finite")
        X = self.quadrature.X[samples]
        speed = velocities(self.map, latent, dt, X)[self.velocity]
        at_q, m, V0, said, at = self.quadrature.cloud(self.map, latent, samples)
        if not len(m):
            raise NoBody(f"t = {t:.6g} s: no quadrature point near the {len(X)} samples lies "
                         f"within the body ({said}); have the latent coordinates left the range "
                         "that the map was trained with?")
        at = placed(self.map, X, latent.xhat) if at is None else at
        cloud = self.body(moving(at_q, speed), m, V0)
        mass = np.full(len(X), self.quadrature.feather * m.mean())
        trial = self.body(moving(at, speed), mass, np.zeros(len(X)))
        self.on_grid(cloud, trial, t, dt)
        after, fit, place = self.project(latent, at, trial.particles, dt)
        return after, Report(len(X), said["points"], fit.rank, fit.residual, place.iterations,
                             place.converged, said)

    def body(self, at, m, V0):
        """A `Body` of `Points`, with the stress of their F."""
        particles = particles_at(at.x, at.v, m, V0, transfer="pic")._replace(F=at.F)
        body = Body("reduced", particles, self.law, NoFlow(), np.arange(len(m)))
        initial_stress(body)
        return body

    def on_grid(self, cloud, trial, t, dt):
        """Move the samples by the grid's velocities: their trial state (LDM-alg5). Conditions are
        met on the grid alone (LDM-sec3.1-bc).
        """
        grid = scatter((cloud, trial), self.storage, self.scheme, dt)
        update(grid, self.gravity, dt)
        if self.conditions is not None:
            self.conditions.apply(grid, t + dt, dt)
        gather(trial, grid, self.scheme, dt)

    def project(self, latent, at, trial, dt):
        """`Latent` and the `Fit`s of velocity and position, from trial states of samples `at`."""
        fit = project_velocity(at.G, trial.v)
        if self.projection == "linear":
            return moved(latent, latent.xhat + dt * fit.y, fit.y), fit, fit._replace(iterations=0)
        place = project_position(self.map, at.X, trial.x, 2.0 * latent.xhat - latent.before)
        return moved(latent, place.y, fit.y), fit, place
