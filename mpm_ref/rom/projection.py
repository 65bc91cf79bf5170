"""From trial states of the samples back to latent coordinates (LDM-alg6, LDM-alg7).

The linear one is the nonlinear one to first order in the step (LDM-eqA1).

Both are least squares over the samples, solved by QR: normal equations would square the condition
number.
"""

from typing import NamedTuple

import numpy as np

from ..core.blas import one_thread

ITERATIONS = 30             # of Gauss-Newton, at most
HALVINGS = 30               # of a step, at most
SUFFICIENT = 1e-4           # share of the predicted decrease that a step must reach
SMALL = 1e-12               # step, over the latent coordinates' size, at which it ends
ROUNDING = 1e-14            # share of the error below which a decrease is only round-off
RANK = 1e-10                # singular values below this share of the largest count as none


class Fit(NamedTuple):
    """A least-squares solution."""

    y: np.ndarray           # (r,)
    residual: float         # root mean square over the samples, in the units of what was fitted
    rank: int               # of the matrix; below r, y is the one of least length
    iterations: int = 1
    converged: bool = True  # its steps ended before they ran out


def project_velocity(G, v):
    """vhat of `Fit`: argmin_w sum_p || G_p w - v_p ||^2 (LDM-eq21, LDM-eq23).

    G (n, d, r) is dg/dxhat at the samples, v (n, d) their trial velocities [m/s].
    """
    A, b = G.reshape(-1, G.shape[2]), v.reshape(-1)
    w, rank = least_squares(A, b)
    return Fit(w, rms(A @ w - b, len(G)), rank)


def project_position(map, X, x, y):
    """xhat of `Fit`: argmin_y sum_p || g(X_p; y) - x_p ||^2 (LDM-eq22), by Gauss-Newton with
    backtracking from y (LDM-sec3.2.3-gn); X (n, d) at rest, x (n, d) trial positions [m].
    """
    at, _, G = map.derivatives(X, y)
    error, rank, rounds, ended = np.sum((at - x) ** 2), map.r, 0, False
    for _ in range(ITERATIONS):
        rounds += 1
        A, b = G.reshape(-1, map.r), (x - at).reshape(-1)
        step, rank = least_squares(A, b)
        fall = np.sum(b**2) - np.sum((A @ step - b) ** 2)
        ended = fall <= ROUNDING * error
        if ended:
            break
        y_new, error_new = backtracked(map, X, x, (y, step), error, fall)
        ended = y_new is None
        if ended:
            break
        ended = np.abs(y_new - y).max() <= SMALL * max(1.0, np.abs(y).max())
        y, error = y_new, error_new
        if ended:
            break
        at, _, G = map.derivatives(X, y)
    return Fit(y, float(np.sqrt(error / len(X))), rank, rounds, bool(ended))


def backtracked(map, X, x, line, error, fall):
    """The first point of a line (y, step) whose error is small enough, and its error; None where
    none is: y is then as good as it gets.
    """
    y, step = line
    t = 1.0
    for _ in range(HALVINGS):
        at = map.place(X, y + t * step)
        new = np.sum((at - x) ** 2)
        if new <= error - SUFFICIENT * t * fall:
            return y + t * step, new
        t *= 0.5
    return None, error


def least_squares(A, b):
    """The solution of least length of min || A w - b ||, by a QR factorisation of A with a
    singular value decomposition of its triangle; and the rank of A.
    """
    with one_thread():
        Q, R = np.linalg.qr(A)
        U, s, Vt = np.linalg.svd(R, full_matrices=False)
    kept = s > RANK * s[0]
    return Vt[kept].T @ ((U[:, kept].T @ (Q.T @ b)) / s[kept]), int(kept.sum())


def rms(a, n):
    """Root of the mean over n samples of their squared lengths."""
    return float(np.sqrt(np.sum(a**2) / n))
