"""One step of a reduced model: kinematics at a few points, the grid, projection.

    quadrature points -> p2g -> grid update -> boundaries -> g2p at samples -> projection

The middle is a step of the full model (`explicit`), on fewer points. What is before and after it
are options, of which the two methods are choices:

               LDM (LDM-alg2)                       NSF (NSF-sec5.2)
    field      a map, stress from its F             position, stress and affine field
    quadrature Lagrangian or Eulerian               points that share a node with a sample
    transfer   PIC; ours also APIC and MLS-MPM      APIC
    velocity   dg/dxhat vhat (see `latent`)         difference of positions over the step
    projection of velocities, then positions        of positions (NSF-eq10)
    F          of the map; ours also evolved        none

`ldm_stepper` and `nsf_stepper` make them. In NSF there is no deformation gradient, no return map
and no singular value decomposition: the material's memory is in the fields.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..body import Body, particles_at
from ..core.grid import OutOfRange, Storage, update
from ..core.heap import keep_freed_memory
from ..explicit import Scheme, gather, scatter
from ..materials import NoFlow
from .evolution import EVOLVED, GRADIENTS, MAP, EvolvedGradients, evolved
from .fields import ReducedField
from .fields.elastic import ElasticMap
from .kinematics import NoBody
from .latent import VELOCITIES, velocities
from .projection import PositionInversion, RateProjection
from .quadrature import Quadrature
from .quadrature.lagrangian import NumberedPoints

GAUSS_NEWTON = PositionInversion()
GRID_BYTES = 1e9        # that the grid of a step may always have, and
GRID_GROWTH = 8.0       # its size over that of the first step, if that is more
BREAKDOWNS = (NoBody, OutOfRange, np.linalg.LinAlgError)    # with which a run may end midway


class MaterialPoints(NamedTuple):
    """All material points P of a reduced run, of one body or several."""

    m: np.ndarray       # (n,) mass [kg]
    V0: np.ndarray      # (n,) volume at rest [m^d]
    v: np.ndarray       # (n, d) velocity at the start [m/s]


class StepReport(NamedTuple):
    """Counts and residual of a reduced step."""

    samples: int
    points: int             # quadrature points that carried mass
    rank: int               # of dg/dxhat at the samples
    residual: float         # rms distance of the samples' trial states from the manifold: of their
                            # velocities [m/s] where rates are fitted, else of their positions [m]
    iterations: int         # of Gauss-Newton; 0 of a linear projection of rates
    converged: bool         # whether they ended before they ran out
    quadrature: dict        # counts of the quadrature


@dataclass
class ReducedStepper:
    """Advances latent coordinates by steps; `step` keeps no state but the grid's storage
    and the bound of its size.

    The spacing of the grid and the degree of its splines are the quadrature's. velocity is one of
    `latent.VELOCITIES`; v0 the velocities of numbered points that "previous" and "difference" take
    at the start. dt may differ from that of the data (NSF-sec5.1). Raises ValueError for a
    velocity, transfer or deformation gradient that does not exist or does not suit the others, and
    a gravity of another dimension.
    """

    field: ReducedField
    quadrature: Quadrature
    projection: object          # `projection.RateProjection` or `PositionInversion`
    gravity: np.ndarray         # (d,) [m/s^2]
    conditions: object = None   # with apply(grid, t, dt); see core.boundary
    transfer: str = "pic"       # or "apic", "mls", with an affine velocity field: of the field, or
                                # with rates the gradient of its velocity
    velocity: str = "previous"
    v0: np.ndarray | None = None
    deformation_gradient: str = MAP     # or "evolved", where the quadrature points are material
                                        # points: see `evolution`

    def __post_init__(self):
        d = self.field.dim
        self.gravity = np.asarray(self.gravity, dtype=float)
        if self.gravity.shape != (d,) or not np.isfinite(self.gravity).all():
            raise ValueError(f"gravity = {self.gravity}: expected {d} finite numbers, in m/s^2")
        if self.velocity not in VELOCITIES:
            raise ValueError(f"velocity = {self.velocity!r}: expected one of "
                             + ", ".join(VELOCITIES))
        known = ("pic", "apic", "mls") if self.has_rates else ("pic", "apic")
        if self.transfer not in known:
            raise ValueError(f"transfer = {self.transfer!r}: expected one of {', '.join(known)}")
        if self.has_gradient and self.velocity != "previous":
            raise ValueError(f"velocity = {self.velocity!r} with transfer {self.transfer!r}: "
                             "expected 'previous', whose gradient is known")
        if self.deformation_gradient not in GRADIENTS:
            raise ValueError(f"deformation_gradient = {self.deformation_gradient!r}: expected one "
                             "of " + ", ".join(GRADIENTS))
        if self.evolves and not self.has_rates:
            raise ValueError("deformation_gradient = 'evolved' without rates: expected a "
                             "projection of rates, as LDM has it; NSF's stress is a field and "
                             "needs no F")
        if self.evolves and self.quadrature.feather:
            raise ValueError("deformation_gradient = 'evolved': expected 'map', since the points "
                             "of this quadrature change from step to step and keep no F")
        keep_freed_memory()
        self.scheme = Scheme(self.quadrature.degree, self.transfer)
        self.storage = Storage(self.quadrature.dx, self.scheme.stencil, d)
        self.most_bytes = None      # of a grid; see `require_moderate_grid`

    @property
    def has_rates(self):
        """Return whether rates of the latent coordinates are fitted, as LDM does."""
        return isinstance(self.projection, RateProjection)

    @property
    def evolves(self):
        """Return whether deformation gradients are evolved, and not the map's."""
        return self.deformation_gradient == EVOLVED

    @property
    def has_gradient(self):
        """Return whether the affine velocity field is the gradient of the map's velocity."""
        return self.transfer != "pic" and self.has_rates

    def step(self, latent, samples, t, dt, weights=None):
        """Return the `Latent` and `Report` after a step from time t [s] by dt [s].

        samples (m,) are numbers of material points, sorted, which count in the projection by
        weights (m,), or all the same. Raises one of BREAKDOWNS where the coordinates give no body.
        """
        if not np.isfinite(latent.xhat).all():
            raise NoBody(f"t = {t:.6g} s: latent coordinates {latent.xhat} are not finite")
        cloud = self.cloud(latent, samples)
        if not len(cloud.m):
            raise NoBody(f"t = {t:.6g} s: no quadrature point near the {len(samples)} samples lies "
                         f"within the body ({cloud.report}); have the latent coordinates left the "
                         "range that the map was trained with?")
        if self.evolves:
            cloud = with_gradients(cloud, latent.gradients)
        body, carriers = self.bodies(cloud, latent, dt)
        trial = self.on_grid(body, carriers, t, dt)
        lost = samples[~np.isfinite(trial.x).all(axis=1)]
        if len(lost):
            raise NoBody(f"t = {t:.6g} s: {len(lost)} of {len(samples)} samples have no finite "
                         f"place after the step, the first is point {lost[0]}; are the fields "
                         "damaged?")
        xhat, vhat, fit = self.project(latent, cloud.samples, trial, dt, weights)
        report = StepReport(len(samples), cloud.report["points"], fit.rank, fit.residual,
                        fit.iterations, fit.converged, cloud.report)
        gradients = next_gradients(cloud, body.particles.L, t, dt) if self.evolves else None
        return latent.advance(xhat, vhat, gradients), report

    def cloud(self, latent, samples):
        """Return the `quadrature.Cloud` of a state with these samples."""
        return self.quadrature.cloud(self.field, latent.xhat, samples)

    def bodies(self, cloud, latent, dt):
        """Return the `Body` of the quadrature points of a `Cloud`, and that of the samples: these
        carry mass where they are no quadrature points.
        """
        velocity = velocities(self.field, latent, dt, cloud.samples.points, self.v0)[self.velocity]
        count, feather = len(cloud.samples.x), self.quadrature.feather
        if not feather:
            nothing = np.zeros(count)
            x = cloud.samples.x
            samples = particles_at(x, np.zeros_like(x), nothing, nothing, transfer="pic")
            return (self.body(cloud.points, latent, velocity, (cloud.m, cloud.V0)),
                    Body("samples", samples, None, NoFlow(), np.arange(count)))
        mass = np.full(count, feather * cloud.m.mean())
        return (self.body(cloud.points, latent, velocity, (cloud.m, cloud.V0)),
                self.body(cloud.samples, latent, velocity, (mass, np.zeros(count))))

    def body(self, state, latent, velocity, sizes):
        """Return a `Body` of points with these masses and volumes, with the velocity, stress and
        affine field that a step starts from (NSF-sec5.1).
        """
        particles = particles_at(state.x, velocity(state), *sizes, transfer=self.transfer)
        particles.tau[:] = self.field.stress(state.points, latent.xhat, state.F)
        if self.has_gradient and latent.before is not None:     # scenes start without
            particles.C[:] = self.field.velocity_gradient(state.points, latent.before, latent.vhat)
        elif self.transfer == "apic" and not self.has_rates:
            particles.C[:] = self.field.affine(state.points, latent.xhat)
        return Body("reduced", particles, None, NoFlow(), np.arange(len(state.x)))

    def on_grid(self, body, samples, t, dt):
        """Return the samples' particles after a step on the grid: their trial state (LDM-alg5).
        Where F is evolved, the body's are updated too.
        """
        grid = self.grid(body, samples, t, dt)
        gather(samples, grid, self.scheme, dt)
        if self.evolves:
            gather(body, grid, self.scheme, dt)
        return samples.particles

    def grid(self, body, samples, t, dt):
        """Return the `Grid` of these bodies after a step on it. Conditions are met on the grid
        alone (LDM-sec3.1-bc).
        """
        bodies = (body, samples) if self.quadrature.feather else (body,)
        self.require_moderate_grid([one.particles.x for one in bodies], t)
        grid = scatter(bodies, self.storage, self.scheme, dt)
        update(grid, self.gravity, dt)
        if self.conditions is not None:
            self.conditions.apply(grid, t + dt, dt)
        return grid

    def require_moderate_grid(self, clouds, t):
        """Raise `NoBody` where the grid that points (.., d) need in a step from t [s] is larger
        than GRID_BYTES and GRID_GROWTH times the first one: a body that latent coordinates have
        blown up asks for all memory.
        """
        box = self.storage.box(clouds)
        size = self.storage.bytes(box.shape, box)
        if self.most_bytes is None:
            self.most_bytes = max(GRID_BYTES, GRID_GROWTH * size)
        if size > self.most_bytes:
            extent = " x ".join(f"{n * self.storage.dx:.3g}" for n in box.shape)
            raise NoBody(f"t = {t:.6g} s: the points need a grid of {extent} m with {size:.1e} "
                         f"bytes, and this run has at most {self.most_bytes:.1e}; have the latent "
                         "coordinates left the range that the map was trained with?")

    def project(self, latent, samples, trial, dt, weights=None):
        """Return `projection.Projected` from the samples' `Kinematics` and trial particles."""
        return self.projection(self.field, latent, samples, trial, dt, weights)


def with_gradients(cloud, gradients):
    """Return a `Cloud` whose points have the `EvolvedGradients` of the step before, if any."""
    if gradients is None:
        return cloud
    F = gradients.gradients_of(cloud.numbers, cloud.points.F)
    return cloud._replace(points=cloud.points._replace(F=F))


def next_gradients(cloud, L, t, dt):
    """Return the `EvolvedGradients` of a `Cloud` after a step from t [s] with velocity gradients L
    (n, d, d) [1/s]. Raises `NoBody` where one is not finite.
    """
    F = evolved(cloud.points.F, L, dt)
    lost = cloud.numbers[~np.isfinite(F).all(axis=(1, 2))]
    if len(lost):
        raise NoBody(f"t = {t:.6g} s: the deformation gradients of {len(lost)} of {len(F)} points "
                     f"are not finite after the step, the first that of point {lost[0]}; take a "
                     "smaller dt")
    return EvolvedGradients(cloud.numbers, F)


def ldm_stepper(g, quadrature, law, gravity, projection="linear", **options):
    """Return the `ReducedStepper` of LDM (LDM-alg2) on a deformation map g of a body of an elastic
    law, or of several bodies and their `elastic.BodyLaws`; projection: see
    `projection.RateProjection`; options: conditions, transfer, velocity, deformation_gradient, and
    v0 of several bodies.
    """
    return ReducedStepper(ElasticMap(g, law), quadrature, RateProjection(projection), gravity,
                          **options)


def nsf_stepper(fields, material, dx, degree, gravity, inversion=GAUSS_NEWTON, **options):
    """Return the `ReducedStepper` of NSF (NSF-sec5.2) on fields of `MaterialPoints`, on a grid of
    spacing dx [m] with splines of a degree; inversion: a `projection.PositionInversion`; options:
    conditions.
    """
    quadrature = NumberedPoints(material.m, material.V0, dx, degree)
    return ReducedStepper(fields, quadrature, inversion, gravity, transfer="apic",
                          velocity="difference", v0=material.v, **options)
