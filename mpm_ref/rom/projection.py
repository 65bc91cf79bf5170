"""Projection: from trial states of the samples back to latent coordinates.

LDM fits rates to the samples' velocities; latent coordinates follow the rates (linear, LDM-alg7) or
are fitted to the samples' positions (nonlinear, LDM-alg6). NSF fits latent coordinates to positions
alone (NSF-eq10). A linear projection is the nonlinear one to first order in the step (LDM-eqA1).

All are least squares over the samples, solved by QR: normal equations would square the condition
number.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..core.blas import one_thread

ITERATIONS = 30             # of Gauss-Newton, at most
HALVINGS = 30               # of a step, at most
SUFFICIENT = 1e-4           # share of the predicted decrease that a step must reach
SMALL = 1e-12               # step, over the latent coordinates' size, at which it ends
ROUNDING = 1e-14            # share of the error below which a decrease is only round-off
RANK = 1e-10                # singular values below this share of the largest count as none
PROJECTIONS = ("linear", "nonlinear")
INVERSIONS = ("nonlinear", "linear")


class Fit(NamedTuple):
    """A least-squares solution."""

    y: np.ndarray           # (r,)
    residual: float         # root mean square over the samples, in the units of what was fitted
    rank: int               # of the matrix; below r, y is the one of least length
    iterations: int = 1
    converged: bool = True  # its steps ended before they ran out


class Projected(NamedTuple):
    """Latent coordinates after a step."""

    xhat: np.ndarray            # (r,)
    vhat: np.ndarray | None     # (r,) their rates [1/s], if any are fitted
    fit: Fit                    # rank and residual of the projection


@dataclass(frozen=True)
class RateProjection:
    """LDM's projection: rates from trial velocities, coordinates from rates or trial positions.

    kind is "linear" (LDM-alg7) or "nonlinear" (LDM-alg6). Raises ValueError for another one.
    """

    kind: str = "linear"

    def __post_init__(self):
        if self.kind not in PROJECTIONS:
            raise ValueError(f"projection = {self.kind!r}: expected one of "
                             + ", ".join(PROJECTIONS))

    def __call__(self, field, latent, samples, trial, dt, weights=None):
        """Return `Projected` from the `Kinematics` of samples and their trial particles; samples
        count by weights (m,), or all the same.
        """
        G, v, x = samples.G, trial.v, trial.x
        if weights is not None:
            field = WeightedField(field, np.sqrt(weights)[:, None])
            G, v, x = field.root[..., None] * G, field.root * v, field.root * x
        fit = project_velocity(G, v)
        if weights is not None:
            fit = fit._replace(residual=rms((samples.G @ fit.y - trial.v).ravel(), len(G)))
        if self.kind == "linear":
            return Projected(latent.xhat + dt * fit.y, fit.y, fit._replace(iterations=0))
        guess = 2.0 * latent.xhat - latent.fitted_at
        place = project_position(field, samples.points, x, guess)
        return Projected(place.y, fit.y, fit._replace(iterations=place.iterations,
                                                      converged=place.converged))


@dataclass(frozen=True)
class PositionInversion:
    """NSF's projection: latent coordinates whose positions of the samples are nearest (NSF-eq10).

    kind is "nonlinear", Gauss-Newton from the latent coordinates before the step, or "linear": its
    first step alone. Gauss-Newton ends where it moves no coordinate by more than the tolerance
    times the largest one before the step; None: as `project_position` ends. Raises ValueError for
    another kind, and for a tolerance that is not positive or belongs to "linear".
    """

    kind: str = "nonlinear"
    tolerance: float | None = None

    def __post_init__(self):
        if self.kind not in INVERSIONS:
            raise ValueError(f"inversion = {self.kind!r}: expected " + " or ".join(INVERSIONS))
        if self.tolerance is not None:
            require_tolerance(self.tolerance, self.kind)

    def __call__(self, field, latent, samples, trial, dt, weights=None):
        """Return `Projected` from the `Kinematics` of samples and their trial particles; samples
        count by weights (m,), or all the same.
        """
        x, points = trial.x, samples.points
        if weights is not None:
            field = WeightedField(field, np.sqrt(weights)[:, None])
            x = field.root * x
        if self.kind == "nonlinear":
            least = None if self.tolerance is None else self.tolerance * np.abs(latent.xhat).max()
            fit = project_position(field, points, x, latent.xhat, least)
            return Projected(fit.y, None, fit)
        x_start, _, G = field.derivatives(points, latent.xhat)
        fit = project_velocity(G, (x - x_start) / dt)
        return Projected(latent.xhat + dt * fit.y, None, fit._replace(residual=dt * fit.residual))


def require_tolerance(tolerance, inversion):
    """Raise ValueError for a tolerance of an inversion that cannot be, or has no effect."""
    if not 0.0 < tolerance < np.inf:
        raise ValueError(f"inversion_tolerance = {tolerance:g}: expected a positive number")
    if inversion == "linear":
        raise ValueError(f"inversion_tolerance = {tolerance:g}: expected none with inversion = "
                         "'linear', which takes one step and no more")


class WeightedField(NamedTuple):
    """Positions of samples times the roots of their weights, so that squares count by these."""

    field: object
    root: np.ndarray        # (m, 1)

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.field.r

    def place(self, points, xhat):
        """Return sqrt(w) x (m, d) [m]."""
        return self.root * self.field.place(points, xhat)

    def derivatives(self, points, xhat):
        """Return sqrt(w) x, None, and sqrt(w) dg/dxhat (m, d, r)."""
        x, _, G = self.field.derivatives(points, xhat)
        return self.root * x, None, self.root[..., None] * G


def project_velocity(G, v):
    """Return the `Fit` of rates: argmin_w sum_p || G_p w - v_p ||^2 (LDM-eq21, LDM-eq23).

    G (n, d, r) is dg/dxhat at the samples, v (n, d) their trial velocities [m/s].
    """
    A, b = G.reshape(-1, G.shape[2]), v.reshape(-1)
    w, rank = least_squares(A, b)
    return Fit(w, rms(A @ w - b, len(G)), rank)


def project_position(field, points, x, y, least=None):
    """Return the `Fit` of coordinates: argmin_y sum_p || g(X_p; y) - x_p ||^2 (LDM-eq22), by
    Gauss-Newton with backtracking from y (LDM-sec3.2.3-gn); x (n, d) are trial positions [m]. It
    ends where the step of every coordinate is at most `least` (None: SMALL of their size), or only
    round-off is left to gain.
    """
    at, _, G = field.derivatives(points, y)
    error, rank, rounds, ended = np.sum((at - x) ** 2), field.r, 0, False
    for _ in range(ITERATIONS):
        rounds += 1
        A, b = G.reshape(-1, field.r), (x - at).reshape(-1)
        step, rank = least_squares(A, b)
        fall = np.sum(b**2) - np.sum((A @ step - b) ** 2)
        ended = fall <= ROUNDING * error
        if ended:
            break
        y_new, error_new = line_search(field, points, x, (y, step), error, fall)
        ended = y_new is None
        if ended:
            break
        enough = SMALL * max(1.0, np.abs(y).max()) if least is None else least
        ended = np.abs(y_new - y).max() <= enough
        y, error = y_new, error_new
        if ended:
            break
        at, _, G = field.derivatives(points, y)
    return Fit(y, float(np.sqrt(error / len(points))), rank, rounds, bool(ended))


def line_search(field, points, x, line, error, fall):
    """Return the first point of a line (y, step) whose error is small enough, and its error; None
    where none is: y is then as good as it gets.
    """
    y, step = line
    t = 1.0
    for _ in range(HALVINGS):
        at = field.place(points, y + t * step)
        new = np.sum((at - x) ** 2)
        if new <= error - SUFFICIENT * t * fall:
            return y + t * step, new
        t *= 0.5
    return None, error


def least_squares(A, b):
    """Return the solution of least length of min || A w - b ||, by a QR factorisation of A with a
    singular value decomposition of its triangle; and the rank of A.
    """
    with one_thread():
        Q, R = np.linalg.qr(A)
        U, s, Vt = np.linalg.svd(R, full_matrices=False)
    sound = s > RANK * s[0]
    return Vt[sound].T @ ((U[:, sound].T @ (Q.T @ b)) / s[sound]), int(sound.sum())


def rms(a, n):
    """Return the root of the mean over n samples of their squared lengths."""
    return float(np.sqrt(np.sum(a**2) / n))
