"""A run on a coarse grid with a correction that is learned from pairs of runs, coarse and fine.

    x(X) = x_c(X) + sum_k a_k D_k(X),    a = A^T (K + lam I)^-1 C u,    K = C C^T

u are the displacements of the coarse run's particles in a state, one row of C those of a training
state; x_c(X) is where they carry a fine point X, by a linear fit to the nearest ones. What is
missing to the fine run's positions in the training states is a sum of modes D_k [m] with
coordinates A (states, modes). These are a linear function of u by ridge regression, with lam in
mean squares of u. So the correction knows the state of the coarse run alone, neither time nor
parameters: loads may be ones that only the run shows.

It is a rival of reduced models, of the kind of multi-fidelity methods: M. C. Kennedy and A.
O'Hagan, "Predicting the output from a complex computer code when fast approximations are
available", Biometrika 87 (2000) 1-13.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from ..core.blas import one_thread
from .fields.pod import directions

NEAREST = 16            # coarse particles of a linear fit
SMOOTHING = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)      # that `choose_smoothing` tries


class Carrier(NamedTuple):
    """Fine points that go with coarse particles."""

    X: np.ndarray           # (n, d) fine points at rest [m]
    X_coarse: np.ndarray    # (m, d) coarse particles at rest [m]
    near: np.ndarray        # (n, k) numbers of the coarse particles nearest to each
    w: np.ndarray           # (n, k) their weights, which are exact for linear displacements

    def place(self, x_coarse):
        """Return x (n, d) of the fine points [m] for x_coarse (m, d) of the particles."""
        u = x_coarse - self.X_coarse
        return self.X + np.einsum("nk,nka->na", self.w, u[self.near])


class CoarseCorrection(NamedTuple):
    """A `Carrier` with a learned correction of R modes, from S training states."""

    carrier: Carrier
    modes: np.ndarray       # (n, d, R) D of the correction [m]
    states: np.ndarray      # (S, m d) C, displacements of the coarse particles [m]
    weights: np.ndarray     # (S, R) (K + lam I)^-1 A
    smoothing: float        # lam over the mean square of the displacements

    def place(self, x_coarse):
        """Return the corrected x (n, d) [m] for x_coarse (m, d) of the coarse particles [m]."""
        with one_thread():
            a = (self.states @ (x_coarse - self.carrier.X_coarse).ravel()) @ self.weights
            return self.carrier.place(x_coarse) + self.modes @ a


def carrier(X, X_coarse):
    """Return the `Carrier` of fine points X (n, d) by coarse particles X_coarse (m, d) [m]. Raises
    ValueError for fewer particles than a linear fit needs, and where those nearest to a point lie
    in a plane.
    """
    m, d = X_coarse.shape
    if m <= d:
        raise ValueError(f"{m} coarse particles: expected at least {d + 1}, which a linear fit "
                         "needs; take a finer coarse grid")
    _, near = KDTree(X_coarse).query(X, min(NEAREST, m))
    arms = X_coarse[near] - X[:, None]
    basis = np.concatenate([np.ones((*arms.shape[:2], 1)), arms], axis=2)
    if (flat := np.linalg.matrix_rank(basis) <= d).any():
        raise ValueError(f"the {near.shape[1]} coarse particles nearest to {flat.sum()} of "
                         f"{len(X)} fine points lie in a plane or a line: expected some off it; "
                         "take a finer coarse grid")
    return Carrier(X, X_coarse, near, np.linalg.pinv(basis)[:, 0])


def fit_correction(one, x, x_coarse, R, runs, smoothing=None):
    """Return the `CoarseCorrection` of R modes from training states: x (S, n, d) of the fine points
    of a `Carrier` and x_coarse (S, m, d) of its particles [m], of runs of these numbers (S,).
    smoothing: lam over the mean square of the displacements; None: by `choose_smoothing`.

    Raises ValueError for states that are no pairs or not finite, a smoothing that is not positive,
    more modes than the states hold, and as `choose_smoothing` does.
    """
    require_pairs(one, x, x_coarse, smoothing)
    states = (x_coarse - one.X_coarse).reshape(len(x_coarse), -1)
    missing = np.array([fine - one.place(coarse) for fine, coarse in
                        zip(x, x_coarse, strict=True)])
    modes, A = directions(np.zeros_like(one.X), missing, R)
    if smoothing is None:
        smoothing = choose_smoothing(states, A, runs)
    return CoarseCorrection(one, modes, states, ridge_weights(states, A, smoothing), smoothing)


def ridge_weights(states, A, smoothing):
    """Return (K + lam I)^-1 A (S, R) of states (S, q) and coordinates A (S, R)."""
    with one_thread():
        K = states @ states.T
    lam = smoothing * np.trace(K) / len(K)
    return cho_solve(cho_factor(K + lam * np.eye(len(K))), A)


def choose_smoothing(states, A, runs):
    """Return the one of SMOOTHING whose regression of coordinates A (S, R) on states (S, q) is
    nearest for each run when it is left out; runs (S,): the number of each state's run. Raises
    ValueError for a single run, and states without displacement.
    """
    if len(np.unique(runs)) < 2:
        raise ValueError("one training run: expected at least two, of which each is left out once")
    if not states.any():
        raise ValueError("no training state has a displacement: expected runs that move")

    def left_out(smoothing):
        total = 0.0
        for run in np.unique(runs):
            own = runs == run
            w = ridge_weights(states[~own], A[~own], smoothing)
            total += np.sum((states[own] @ states[~own].T @ w - A[own]) ** 2)
        return total

    return min(SMOOTHING, key=left_out)


def require_pairs(one, x, x_coarse, smoothing):
    """Raise ValueError unless fine and coarse states are pairs of finite positions of the points of
    a `Carrier`, and a smoothing that is given is positive.
    """
    expected = (len(x_coarse), *one.X.shape), (len(x), *one.X_coarse.shape)
    if (x.shape, x_coarse.shape) != expected:
        raise ValueError(f"x {x.shape} and x_coarse {x_coarse.shape}: expected as many states of "
                         f"each, of {one.X.shape} and {one.X_coarse.shape}")
    if not (np.isfinite(x).all() and np.isfinite(x_coarse).all()):
        raise ValueError("positions of training states that are not finite: leave out runs that "
                         "broke down")
    if smoothing is not None and not 0.0 < smoothing < np.inf:
        raise ValueError(f"smoothing = {smoothing}: expected a positive number, such as 1e-5")
