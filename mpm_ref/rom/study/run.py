"""Reduced runs, step by step: the four schemes of LDM and their cheaper or steadier variants, and
runs with inferred stress (NSF).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...sampling import Regular, sample
from ...shapes.inside import solid
from ..evolution import EVOLVED, MAP
from ..fields.blocks import body_blocks
from ..fields.numbered import is_numbered, numbered
from ..fields.pod import PodModes
from ..fields.polynomial_manifold import Curved
from ..kinematics import CLOSE
from ..latent import Latent, initial, nearest
from ..projection import PositionInversion
from ..quadrature.eulerian import BOUNDARY_CELLS, WHOLE, Eulerian
from ..quadrature.lagrangian import CELLS, Lagrangian, Resampled, lagrangian
from ..step import StepReport, ldm_stepper, nsf_stepper
from .full_model import has_seams, signed_distance
from .samples import (
    ENOUGH,
    SampleSet,
    ldm_sampler,
    nsf_sampler,
    require_prescribed_region,
    require_valid_sets,
)

PRECISIONS = ("double", "single")
QUADRATURES = ("lagrangian", "eulerian")
PROJECTIONS = ("nonlinear", "linear")
SCHEMES = tuple((q, p) for q in QUADRATURES for p in PROJECTIONS)
SINGLE = 1e-4       # smallest tolerance of preimages in single precision [dx]
COARSE = 8          # blocks over a body's longest side, from which Eulerian points are traced back
ROUNDING = 1e-9     # of a step: one that ends this little after the scene is made


class RunState(NamedTuple):
    """A state of a reduced run, and the step that led to it."""

    t: float                        # [s]
    latent: Latent
    report: StepReport | None = None    # None at the start, like the samples
    samples: SampleSet | None = None


class ReducedRun(NamedTuple):
    """A reduced run that is ready to be stepped."""

    stepper: object         # `rom.step.ReducedStepper`
    find_start: Callable    # () -> `Latent` of the start
    make_sampler: Callable  # latent coordinates of the start -> function of the time [s] and the
                            # `Latent` at which a step begins, which gives its `SampleSet`
    dt: float               # length of a step [s]
    steps: int
    has_memory: bool = False    # whether a state is more than its latent coordinates and rates

    def states(self, earlier=()):
        """Yield the `RunState` of all time levels, the start first. earlier: (`Latent`, `Report` or
        None) of the first states, if these are known; their samples are drawn again, so that those
        of later steps are the run's. Where the run has a memory, all but the start are computed
        again.
        """
        earlier, samples = earlier or [(self.find_start(), None)], None
        if self.has_memory:
            earlier = earlier[:1]
        sampler = self.make_sampler(earlier[0][0].xhat)
        for k, (latent, report) in enumerate(earlier):
            if k > 0:
                samples = sampler((k - 1) * self.dt, earlier[k - 1][0])
            yield RunState(k * self.dt, latent, report, samples)
        for k in range(len(earlier) - 1, self.steps):
            t = k * self.dt
            samples = sampler(t, latent)
            latent, report = self.stepper.step(latent, samples.points, t, self.dt, samples.weights)
            yield RunState((k + 1) * self.dt, latent, report, samples)


# LDM.

class RunOptions(NamedTuple):
    """Options of a reduced run of LDM; `points` samples, or all of them where it is None.

    Samples are "redrawn" for each step (LDM-sec3.3-hyper), "kept" from the start (LDMW-sets), or
    kept and "pivoted": those that determine the latent coordinates best at the start, of
    `samples.ENOUGH` points. The quadrature is that of `SCHEMES`, or "resampled".
    """

    quadrature: str = "lagrangian"
    projection: str = "linear"
    points: int | None = None
    velocity: str = "previous"
    per_cell: int = 2           # quadrature points of a cell per axis, if they are not material
    samples: str = "redrawn"
    preimage_tolerance: float = CLOSE       # distance of Eulerian points from their places [dx]
    precision: str = "double"   # of a learned map, or "single"
    driven_weight: float = 1.0  # ours: in the projection, of a sample whose velocity is prescribed
                                # over that of one whose is free (see `rom.prescribed`)
    boundary_cells: str = WHOLE     # of Eulerian points, one of `eulerian.BOUNDARY_CELLS`; "cut" is
                                    # ours
    deformation_gradient: str = MAP     # of material points: of the "map", or "evolved" on
                                    # the grid (see `rom.evolution`), which is ours

    @property
    def name(self):
        """The name of the scheme, as the targets have it."""
        return f"{self.quadrature}_{self.projection}"


def ldm_run(full, g, options, rest, seed=0):
    """Return LDM's `ReducedRun` of a `FullModel` on a map g. rest: latent coordinates near the body
    at rest. Raises ValueError as `ldm_model` does; its states, as `samples.ldm_sampler` does.
    """
    clock = full.problem.clock
    full, g = with_numbers(full, g, options)
    return ReducedRun(ldm_model(full, g, options), lambda: ldm_start(full, g, rest),
                      lambda xhat: ldm_sampler(full, g, options, xhat, seed), clock.dt, clock.steps,
                      options.deformation_gradient == EVOLVED)


def with_numbers(full, g, options):
    """Return a `FullModel` and a map by the numbers of points, where a run evaluates modes at the
    points of their data alone: the same values, without a search for each point. Raises ValueError
    for a map of several bodies that is not of modes of their points.
    """
    if len(full.bodies) > 1:
        g = g if is_numbered(g) else numbered(g)
        if not np.array_equal((g.modes if isinstance(g, Curved) else g).X, full.X):
            raise ValueError("modes of other points than those of the bodies: expected a map of "
                             "the same scene's training runs")
        return full, g
    modes = g.modes if isinstance(g, Curved) else g
    at_points = options.quadrature == QUADRATURES[0] and options.precision == "double"
    if at_points and isinstance(modes, PodModes) and np.array_equal(modes.X, full.X):
        return full._replace(by_number=True), numbered(g)
    return full, g


def ldm_model(full, g, options):
    """Return LDM's `ReducedStepper` of a `FullModel` on a map g. Raises ValueError for a quadrature
    that does not exist, and as `require_own_points`, `require_boundary_cells`,
    `require_prescribed_region`, `require_material_points` and `with_precision` do.
    """
    require_own_points(full, options)
    require_boundary_cells(full, options)
    require_prescribed_region(full, options)
    require_material_points(options)
    problem = full.problem
    make = {"lagrangian": material_quadrature, "eulerian": cell_quadrature,
            "resampled": resampled_quadrature}
    if options.quadrature not in make:
        raise ValueError(f"quadrature = {options.quadrature!r}: expected one of {', '.join(make)}")
    transfer = problem.scheme.transfer
    return ldm_stepper(with_precision(g, options, transfer),
                       make[options.quadrature](full, options), full.law, problem.gravity,
                       options.projection, conditions=problem.conditions,
                       velocity=options.velocity, transfer=transfer,
                       v0=full.v if len(full.bodies) > 1 else None,
                       deformation_gradient=options.deformation_gradient)


def require_own_points(full, options):
    """Raise ValueError for a quadrature of several bodies other than by their material points."""
    if len(full.bodies) > 1 and options.quadrature != QUADRATURES[0]:
        raise ValueError(f"quadrature = {options.quadrature!r} with {len(full.bodies)} bodies: "
                         f"expected {QUADRATURES[0]!r}, since its other points have one shape, one "
                         "density and one law")


def require_material_points(options):
    """Raise ValueError where F is evolved at quadrature points that do not move with the body."""
    if options.deformation_gradient == EVOLVED and options.quadrature != QUADRATURES[0]:
        raise ValueError(f"deformation_gradient = 'evolved' with quadrature = "
                         f"{options.quadrature!r}: expected {QUADRATURES[0]!r}, whose points are "
                         "material points that can keep F; or deformation_gradient = 'map'")


def require_boundary_cells(full, options):
    """Raise ValueError for `boundary_cells` that do not exist, and for "cut" ones of a quadrature
    without cells, or of a shape that is a union, whose distance at the seams is 0 inside the body.
    """
    chosen, (_, eulerian) = options.boundary_cells, QUADRATURES
    if chosen not in BOUNDARY_CELLS:
        raise ValueError(f"boundary_cells = {chosen!r}: expected one of "
                         + ", ".join(BOUNDARY_CELLS))
    if chosen != WHOLE and options.quadrature != eulerian:
        raise ValueError(f"boundary_cells = {chosen!r} with quadrature = {options.quadrature!r}: "
                         f"expected {WHOLE!r}, since the points of {eulerian!r} alone are cells'")
    if chosen != WHOLE and has_seams(full.shape):
        raise ValueError(f"boundary_cells = {chosen!r} of a body made by a union: expected "
                         f"{WHOLE!r}, since cells at the seams of its parts would be cut too")


def with_precision(g, options, transfer):
    """Return a map in the precision of `RunOptions`. Raises ValueError for one that does not exist,
    a map that has only doubles, an affine transfer, whose rate of F is a difference, and preimages
    closer than single precision can tell.
    """
    if options.precision == "double":
        return g
    if options.precision not in PRECISIONS:
        raise ValueError(f"precision = {options.precision!r}: expected {' or '.join(PRECISIONS)}")
    if not hasattr(g, "single"):
        raise ValueError("precision = 'single': learned maps alone have it, this is one of "
                         f"{type(g).__name__}")
    if transfer != "pic":
        raise ValueError(f"precision = 'single' with the transfer {transfer!r}: expected double")
    if options.quadrature == "eulerian" and options.preimage_tolerance < SINGLE:
        raise ValueError(f"preimage_tolerance = {options.preimage_tolerance:g} dx in single "
                         f"precision: expected at least {SINGLE:g}")
    return g.single()


def material_quadrature(full, options):
    """Return the quadrature with the material points of a `FullModel`."""
    dx, degree = full.problem.dx, full.problem.scheme.degree
    if full.map_points is full.X:
        return lagrangian(full.X, full.m, full.V0, dx, degree)
    sizes = [len(body.id) for body in full.bodies]
    return Lagrangian(full.map_points, full.m, full.V0, body_blocks(full.X, sizes, CELLS * dx), dx,
                      degree)


def cell_quadrature(full, options):
    """Return the quadrature with points of the grid's cells."""
    size = np.ptp(full.X, axis=0).max() / COARSE
    seeds = np.unique(np.floor(full.X / size), axis=0, return_index=True)[1]
    return Eulerian(full.X, full.rho, lambda X: signed_distance(X, full.shape), full.X[seeds],
                    full.problem.dx, full.problem.scheme.degree, options.per_cell,
                    options.preimage_tolerance, options.boundary_cells)


def resampled_quadrature(full, options):
    """Return the quadrature with another sampling of the body at rest."""
    dx, degree = full.problem.dx, full.problem.scheme.degree
    X, V0 = sample(Regular(per_cell=options.per_cell), solid(full.shape), dx, 0)
    return Resampled(full.X, lagrangian(X, full.rho * V0, V0, dx, degree))


def ldm_start(full, g, rest):
    """Return the `Latent` of the start, searched from latent coordinates near the body at rest; of
    a body that moves, with the rates that fit its velocities (LDM-eq19).
    """
    some = slice(None, None, -(-len(full.X) // ENOUGH))
    v = full.v[some] if np.any(full.v) else None
    return initial(g, full.map_points[some], full.X[some], v, rest)


# NSF.

class FieldRunOptions(NamedTuple):
    """Options of a reduced run of NSF."""

    samples: tuple          # of `SampleSet`, in order of time (NSF-sec5.4)
    dt_factor: float = 1.0  # length of a step over that of the scene
    inversion: str = "nonlinear"
    inversion_tolerance: float | None = None    # see `projection.PositionInversion`


def nsf_run(full, fields, options, rest):
    """Return NSF's `ReducedRun` of a `FullModel` on fields with `FieldRunOptions`, until the scene
    ends. rest: latent coordinates near the start. Raises ValueError as `require_valid_sets` and
    `nsf_model` do.
    """
    require_valid_sets(options.samples, len(full.X))
    clock = full.problem.clock
    return ReducedRun(nsf_model(full, fields, options.inversion, options.inversion_tolerance),
                      lambda: nsf_start(full, fields, rest),
                      lambda xhat: nsf_sampler(options.samples), options.dt_factor * clock.dt,
                      step_count(clock, options.dt_factor))


def step_count(clock, dt_factor):
    """Return the number of steps, `dt_factor` times as long, within the scene's `Clock`."""
    return int(clock.steps / dt_factor * (1.0 + ROUNDING))


def nsf_model(full, fields, inversion="nonlinear", tolerance=None):
    """Return NSF's `ReducedStepper` of a `FullModel`. Raises ValueError as
    `projection.PositionInversion` does.
    """
    problem = full.problem
    return nsf_stepper(fields, full.material, problem.dx, problem.scheme.degree, problem.gravity,
                       PositionInversion(inversion, tolerance), conditions=problem.conditions)


def nsf_start(full, fields, rest):
    """Return the `Latent` at the start, searched from latent coordinates near it."""
    points = np.arange(0, len(full.X), -(-len(full.X) // ENOUGH))
    return Latent(nearest(fields, points, full.X[points], rest))
