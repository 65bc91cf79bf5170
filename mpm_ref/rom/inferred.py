"""One step of a reduced model whose stress and affine field are inferred (NSF-sec5.2).

    inference at points N -> p2g -> grid update -> boundaries -> g2p at samples S -> inversion

There is no deformation gradient, no return map and no singular value decomposition: what the
material remembers is in the fields. The middle is the full model's step (`explicit`) with APIC.
Fields are any object with

    dim, r                          numbers of axes and of latent coordinates
    place(points, xhat)             x (m, d) [m] of the material points of these numbers
    derivatives(points, xhat)       x, None, and dg/dxhat (m, d, r)
    stress(points, xhat)            Kirchhoff stress (m, d, d) [Pa]
    affine(points, xhat)            C (m, d, d) [1/s]
    near(xhat, x, distance)         numbers of all points that may be so near to positions x

of which `spanned` and `learned` are two.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..body import Body, particles_at
from ..core.grid import Storage, update
from ..explicit import Scheme, gather, scatter
from ..materials import NoFlow
from .kinematics import NoBody
from .projection import project_position, project_velocity
from .quadrature.stencil_overlap import reach

INVERSIONS = ("nonlinear", "linear")


class Matter(NamedTuple):
    """What a reduced run knows of all material points P, of one body or several."""

    m: np.ndarray       # (n,) mass [kg]
    V0: np.ndarray      # (n,) volume at rest [m^d]
    v: np.ndarray       # (n, d) velocity at the start [m/s]


class Position(NamedTuple):
    """Reduced state: latent coordinates, and those a step ago; at the start, None."""

    xhat: np.ndarray                    # (r,)
    before: np.ndarray | None = None    # (r,)


class Report(NamedTuple):
    """What a step did."""

    samples: int
    points: int             # integration points N
    rank: int               # of dg/dxhat at the samples
    residual: float         # rms distance of the trial positions from the manifold [m]
    iterations: int         # of Gauss-Newton
    converged: bool         # ... whether they ended before they ran out


@dataclass
class Inferred:
    """Advances latent coordinates; `step` keeps no state but the grid's storage.

    inversion is "nonlinear" (NSF-eq10) or "linear": its first Gauss-Newton step alone
    (NSF-eq10). dt may differ from that of the data; velocities are differences over the dt of the
    run (NSF-sec5.1). Raises ValueError for another inversion.
    """

    fields: object
    body: Matter
    dx: float
    degree: int
    gravity: np.ndarray         # (d,) [m/s^2]
    conditions: object = None   # with apply(grid, t, dt); see core.boundary
    inversion: str = "nonlinear"

    def __post_init__(self):
        if self.inversion not in INVERSIONS:
            raise ValueError(f"inversion = {self.inversion!r}: expected "
                             + " or ".join(INVERSIONS))
        self.scheme = Scheme(self.degree, "apic")
        self.storage = Storage(self.dx, self.scheme.stencil, self.fields.dim)

    def step(self, at, samples, t, dt, w=None):
        """`Position` and `Report` after a step from time t [s] by dt [s], with the samples of these
        numbers, sorted, that count by weights w (m,), or all the same. Raises `NoBody` where latent
        coordinates or the samples' positions after the step are not finite, and
        `core.grid.OutOfRange` where positions before it are not, or are far apart.
        """
        if not np.isfinite(at.xhat).all():
            raise NoBody(f"t = {t:.6g} s: latent coordinates {at.xhat} are not finite")
        points, x = self.integration(at.xhat, samples)
        cloud = self.inferred(at, points, x, dt)
        trial = self.moved(cloud, len(samples), t, dt)
        lost = samples[~np.isfinite(trial).all(axis=1)]
        if len(lost):
            raise NoBody(f"t = {t:.6g} s: {len(lost)} of {len(samples)} samples have no finite "
                         f"place after the step, the first is point {lost[0]}; are the fields "
                         "damaged?")
        xhat, fit = self.inverted(samples, w, trial, at.xhat, dt)
        return Position(xhat, at.xhat), Report(len(samples), len(points), fit.rank, fit.residual,
                                               fit.iterations, fit.converged)

    def integration(self, xhat, samples):
        """Numbers (m,) of the points N that share a node with a sample (NSF-sec5.4), the samples
        first, and their positions (m, d) [m].
        """
        x = self.fields.place(samples, xhat)
        if len(samples) == len(self.body.m):
            return samples, x
        some = self.fields.near(xhat, x, (self.degree + 1) * self.dx)
        some = some[~among(some, samples)]
        here = self.fields.place(some, xhat)
        reached = reach(x, self.dx, self.degree).reached(here)
        return np.concatenate([samples, some[reached]]), np.concatenate([x, here[reached]])

    def inferred(self, at, points, x, dt):
        """`Body` of points at x (m, d) with all that a step asks of them (NSF-sec5.1)."""
        if at.before is None:
            v = self.body.v[points]
        else:
            v = (x - self.fields.place(points, at.before)) / dt
        particles = particles_at(x, v, self.body.m[points], self.body.V0[points], transfer="apic")
        particles.tau[:] = self.fields.stress(points, at.xhat)
        particles.C[:] = self.fields.affine(points, at.xhat)
        return Body("inferred", particles, None, NoFlow(), points)

    def grid(self, cloud, t, dt):
        """`Grid` of the cloud's points after a step on it."""
        grid = scatter((cloud,), self.storage, self.scheme, dt)
        update(grid, self.gravity, dt)
        if self.conditions is not None:
            self.conditions.apply(grid, t + dt, dt)
        return grid

    def moved(self, cloud, count, t, dt):
        """Positions (count, d) [m] of the cloud's first points after a step on the grid."""
        grid, own = self.grid(cloud, t, dt), cloud.particles
        trial = particles_at(own.x[:count], own.v[:count], own.m[:count], own.V0[:count],
                             transfer="pic")
        gather(cloud._replace(particles=trial), grid, self.scheme, dt)
        return trial.x

    def inverted(self, points, w, x, xhat, dt):
        """Latent coordinates whose positions of the samples of these numbers, that count by weights
        w (m,) or all the same, are nearest to x (m, d), and the `Fit` (NSF-eq10).
        """
        fields = self.fields if w is None else Weighed(self.fields, np.sqrt(w)[:, None])
        x = x if w is None else fields.root * x
        if self.inversion == "nonlinear":
            fit = project_position(fields, points, x, xhat)
            return fit.y, fit
        here, _, G = fields.derivatives(points, xhat)
        fit = project_velocity(G, (x - here) / dt)
        return xhat + dt * fit.y, fit._replace(residual=dt * fit.residual)


class Weighed(NamedTuple):
    """Places of samples times the roots of their weights, so that squares count by these."""

    fields: object
    root: np.ndarray        # (m, 1)

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.fields.r

    def place(self, points, xhat):
        """sqrt(w) x (m, d) [m]."""
        return self.root * self.fields.place(points, xhat)

    def derivatives(self, points, xhat):
        """sqrt(w) x, None, and sqrt(w) dg/dxhat (m, d, r)."""
        x, _, G = self.fields.derivatives(points, xhat)
        return self.root * x, None, self.root[..., None] * G


def among(points, some):
    """Whether each of the points (m,) is one of some (k,), which are sorted."""
    at = np.minimum(np.searchsorted(some, points), len(some) - 1)
    return some[at] == points


def nearest(fields, points, x, xhat):
    """Latent coordinates whose positions of points of these numbers are nearest to x (m, d) [m],
    searched from xhat: a start.
    """
    return project_position(fields, points, x, xhat).y
