"""NSF's reduced step on sums of modes for position, stress and affine field.

    x = X + sum_k a_k(xhat) U_k,    a_k = xhat_k for k < r                   NSF-eq8
    tau = sum_k s_k(xhat) T_k,      C = sum_k c_k(xhat) B_k                  NSF-eq9, NSF-sec4.4
    v = (g(X; xhat_n) - g(X; xhat_{n-1})) / dt                               NSF-sec5.1
    one step by APIC, then xhat = argmin_y sum_S |g(X; y) - x_trial|^2       NSF-alg-mpm, NSF-eq10

with modes by singular values, and SciPy's cubic radial functions as coefficients.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, RBFInterpolator
from scipy.optimize import least_squares

SPLINE = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)      # quadratic
EPS = 1e-15             # relative tolerance of the inversion


class ThreeFields(NamedTuple):
    """Fields of n points: functions of xhat (r,)."""

    place: object           # -> x (n, 3)           [m]
    stress: object          # -> tau (n, 3, 3)      [Pa]
    affine: object          # -> C (n, 3, 3)        [1/s]
    start: np.ndarray       # (r,)  coordinates of the first snapshot [m]


def modes(A, count):
    """Return orthonormal modes (count, N) of rows A (s, N), and the rows' coefficients."""
    V = np.linalg.svd(A, full_matrices=False)[2][:count]
    return V, A @ V.T


def fit_fields(X, snapshots, r, counts, smoothing):
    """Return the `ThreeFields` of snapshots x, tau and C (s, n, ..) of points X (n, 3).

    r: number of coordinates; counts: of modes of x, tau and C; smoothing: added to the matrix of
    the radial functions, in which the first coordinate has a root mean square of 1.
    """
    (x, tau, C), n, upper = snapshots, len(X), np.triu_indices(3)
    U, a = modes((x - X).reshape(len(x), -1), counts[0])
    T, s = modes(tau[(..., *upper)].reshape(len(x), -1), counts[1])
    B, c = modes(C.reshape(len(x), -1), counts[2])
    unit = np.sqrt(np.mean(a[:, 0] ** 2))

    def through(values):
        f = RBFInterpolator(a[:, :r] / unit, values, kernel="cubic", degree=1, smoothing=smoothing)
        return lambda xhat: f(xhat[None] / unit)[0]

    bend, stress, affine = through(a[:, r:]), through(s), through(c)

    def kirchhoff(xhat):
        tau = np.zeros((n, 3, 3))
        tau[(..., *upper)] = (stress(xhat) @ T).reshape(n, 6)
        return tau + np.triu(tau, 1).mT

    return ThreeFields(lambda y: X + (np.concatenate([y, bend(y)]) @ U).reshape(n, 3),
                       kirchhoff, lambda y: (affine(y) @ B).reshape(n, 3, 3), a[0, :r])


def weights(x, dx):
    """Return nodes (k, 3) [m], W (n, k) and its gradient dW (n, k, 3) [1/m] at x (n, 3) [m]."""
    low, high = np.floor(x.min(axis=0) / dx) - 1, np.ceil(x.max(axis=0) / dx) + 2
    nodes = np.indices((high - low).astype(int)).reshape(3, -1).T + low
    N, dN = (np.nan_to_num(s(x[:, None] / dx - nodes)) for s in (SPLINE, SPLINE.derivative()))
    others = np.stack([np.delete(N, a, axis=2).prod(axis=2) for a in range(3)], axis=2)
    return dx * nodes, N.prod(axis=2), dN * others / dx


def trial_positions(state, material, samples, dt, dx):
    """Return positions (m, 3) [m] of samples after a step by APIC on the points around them, from
    state = x, v, tau and C of all points; material: m, V0 and gravity (3,).
    """
    (x, v, tau, C), (m, V0, gravity) = state, material
    nodes, W, dW = weights(x, dx)
    active = W[samples].any(axis=0)
    nodes, W, dW = nodes[active], W[:, active], dW[:, active]
    velocity = v[:, None] + np.einsum("pab,pib->pia", C, nodes - x[:, None])
    momentum = np.einsum("p,pi,pia->ia", m, W, velocity)
    force = -np.einsum("p,pab,pib->ia", V0, tau, dW)
    v = (momentum + dt * force) / (m @ W)[:, None] + dt * gravity
    return x[samples] + dt * W[samples] @ v


def run(fields, material, v, samples, step):
    """Return xhat (steps + 1, r) of a run that starts with velocities v (n, 3) [m/s]; samples (m,):
    numbers of points; step: dt [s], dx [m] and the number of steps.
    """
    dt, dx, steps = step
    xhat, x = [fields.start], fields.place(fields.start)
    for _ in range(steps):
        state = x, v, fields.stress(xhat[-1]), fields.affine(xhat[-1])
        trial = trial_positions(state, material, samples, dt, dx)
        xhat.append(least_squares(lambda y, trial=trial: (fields.place(y)[samples] - trial).ravel(),
                                  xhat[-1], "3-point", ftol=EPS, xtol=EPS, gtol=EPS).x)
        before, x = x, fields.place(xhat[-1])
        v = (x - before) / dt
    return np.array(xhat)
