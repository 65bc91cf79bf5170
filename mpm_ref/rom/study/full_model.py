"""The full-order model of a run, as its reduced model needs it: points, masses, law, conditions."""

from typing import NamedTuple

import numpy as np

from ...core.levelset import distances
from ...core.surface import SurfaceConditions
from ...materials import NoFlow
from ...scene import build
from ...shapes import Difference, Intersection, Union, level_set
from ..fields.elastic import body_laws
from ..step import MaterialPoints

DAMPING = ("rpic", "relaxation", "mass_eps")    # keys of a scheme that reduced runs do not have


class FullModel(NamedTuple):
    """The full-order model of one run; n points of all bodies, in the order of their sampling."""

    problem: object         # `Problem`, which gives law, grid, clock and conditions
    X: np.ndarray           # (n, d) points at the start [m]
    m: np.ndarray           # (n,) mass [kg]
    V0: np.ndarray          # (n,) volume at rest [m^d]
    v: np.ndarray           # (n, d) velocity at the start [m/s]
    shape: object = None    # of LDM's single body at rest, as the scene has it
    boundary_points: tuple = ()     # of LDM: index arrays of the points within a cell, at the
                                    # start, of each prescribed region
    by_number: bool = False         # of LDM: whether its map takes numbers of points, also of a
                                    # single body

    @property
    def rho(self):
        """The density at rest [kg/m^3]."""
        return float(self.m.sum() / self.V0.sum())

    @property
    def bodies(self):
        """The bodies at the start."""
        return self.problem.bodies

    @property
    def map_points(self):
        """Names of all points as a map of LDM takes them: places at rest (n, d) [m] of a single
        body, numbers (n,) of several, or where the map takes numbers.
        """
        by_place = len(self.bodies) == 1 and not self.by_number
        return self.X if by_place else np.arange(len(self.X))

    @property
    def body_points(self):
        """The numbers of each body's points, of several bodies; none of a single one."""
        ends = np.cumsum([len(body.id) for body in self.bodies])
        points = np.split(np.arange(len(self.X)), ends[:-1])
        return tuple(points) if len(points) > 1 else ()

    @property
    def law(self):
        """The elastic law of a single body, or the `BodyLaws` of several."""
        return self.bodies[0].law if len(self.bodies) == 1 else body_laws(self.bodies)

    @property
    def material(self):
        """The `MaterialPoints` of all points."""
        return MaterialPoints(self.m, self.V0, self.v)

    def constrained_points(self, t):
        """Return those of `boundary_points` whose region acts in the step from time t [s] on;
        samples must not miss them (LDM-sec3.3-hyper).
        """
        middle = t + 0.5 * self.problem.clock.dt
        regions = zip(self.boundary_points, prescribed_regions(self.problem), strict=True)
        return tuple(group for group, region in regions if region.since < middle < region.until)


def ldm_full_model(scene):
    """Return the `FullModel` of a scene that LDM reduces. Raises ValueError for features that its
    reduced runs do not have: contact of bodies, plastic flow, implicit steps, FLIP, relaxation and
    damping of affine velocities, added mass, averaged volumes or splines, sources or sinks,
    conditions at surfaces, forces of single particles, a box.
    """
    problem = build(scene)
    bodies = problem.bodies
    unsupported = {"contact of bodies": bool(problem.contacts),
                   "plastic flow": not all(isinstance(body.flow, NoFlow) for body in bodies),
                   f"the {problem.integrator} integrator": problem.integrator != "explicit",
                   "the transfer flip": problem.scheme.transfer == "flip",
                   **{f"scheme.{key}": getattr(problem.scheme, key) > 0.0 for key in DAMPING},
                   "averaged volumes (f_bar)": problem.scheme.f_bar,
                   "single precision": problem.scheme.precision != "double",
                   "averaged splines (gimp)": problem.scheme.gimp > 0.0,
                   "sources or sinks": problem.sources or problem.sinks,
                   'boundary = "surface"': isinstance(problem.conditions, SurfaceConditions),
                   "forces of single particles": any(body.particles.b.ndim > 1
                                                     for body in bodies),
                   "a box that clips": problem.clip is not None}
    for feature in (name for name, present in unsupported.items() if present):
        raise ValueError(f"the scene {problem.title!r} has {feature}: reduced runs know none")
    X, m, V0, v = points_of(problem.bodies)
    regions = prescribed_regions(problem)
    boundary = tuple(np.flatnonzero(distances(X, one.shape) <= problem.dx) for one in regions)
    shape = scene.body[0].shape if len(bodies) == 1 else None
    return FullModel(problem, X, m, V0, v, shape, boundary)


def nsf_full_model(scene):
    """Return the `FullModel` of a scene that NSF reduces. Raises ValueError for features that its
    reduced runs do not have: an implicit integrator, a transfer other than apic, its damping,
    relaxation and added mass, averaged volumes, conditions at surfaces, contact of bodies, sources
    or sinks, a fluid, forces of single particles, a box that clips.
    """
    problem = build(scene)
    particles = [body.particles for body in problem.bodies]
    unsupported = (
        (problem.integrator != "explicit", f"the {problem.integrator} integrator",
         'integrator = "explicit", whose step they make'),
        (problem.scheme.transfer != "apic", f"the transfer {problem.scheme.transfer}",
         'scheme.transfer = "apic", whose affine field is one of theirs'),
        *((getattr(problem.scheme, key) > 0.0, f"scheme.{key}", f"scheme.{key} = 0")
          for key in DAMPING),
        (problem.scheme.f_bar, "averaged volumes", "scheme.f_bar = false"),
        (problem.scheme.precision != "double", "single precision", "double"),
        (isinstance(problem.conditions, SurfaceConditions), 'boundary = "surface"',
         'boundary = "nodes"'),
        (bool(problem.contacts), "contact of bodies", "one velocity field"),
        (bool(problem.sources or problem.sinks), "sources or sinks", "the same particles always"),
        (any(p.F.ndim == 1 for p in particles), "a fluid", "solids, which have a shear stress"),
        (any(p.b.ndim > 1 for p in particles), "forces of single particles", "gravity alone"),
        (problem.clip is not None, "a box that clips", "none"))
    for feature, expected in ((name, expected) for present, name, expected in unsupported
                              if present):
        raise ValueError(f"the scene {problem.title!r} has {feature}: reduced runs with inferred "
                         f"stress expect {expected}")
    return FullModel(problem, *points_of(problem.bodies))


def points_of(bodies):
    """Return x (n, d) [m], m (n,) [kg], V0 (n,) [m^d] and v (n, d) [m/s] of all bodies' points, as
    they were sampled.
    """
    return tuple(field_of(bodies, name) for name in ("x", "m", "V0", "v"))


def field_of(bodies, name):
    """Return a field of all bodies' particles, each body's in the order of its sampling."""
    return np.concatenate([getattr(body.particles, name)[np.argsort(body.id)] for body in bodies])


def prescribed_regions(problem):
    """Return the regions of a problem whose velocity is prescribed."""
    return () if problem.conditions is None else problem.conditions.prescribed


def has_seams(shape):
    """Return whether a shape of a scene has parts that are joined: there its `signed_distance` is
    nearer to 0 than the surface is.
    """
    match shape:
        case Union():
            return True
        case Intersection():
            return any(map(has_seams, shape.shapes))
        case Difference():
            return (has_seams(shape.shape) or len(shape.minus) > 1
                    or any(map(has_seams, shape.minus)))
    return False


def signed_distance(X, shape):
    """Return signed distances (n,) of points X (n, d) from a shape of a scene [m], negative inside;
    of shapes made of others, a bound that is not larger outside, and inside not where parts are
    joined.
    """
    match shape:
        case Union():
            return np.min([signed_distance(X, part) for part in shape.shapes], axis=0)
        case Intersection():
            return np.max([signed_distance(X, part) for part in shape.shapes], axis=0)
        case Difference():
            return np.maximum(signed_distance(X, shape.shape),
                              -signed_distance(X, Union(shapes=shape.minus)))
    return distances(X, level_set(shape))
