"""LDM's reduced step whose quadrature points evolve their own deformation gradient.

    F_{n+1} = (I + dt L) F_n,    L = sum_i v_i dw_ip^T                      LDM-sec2.2-Frate

with the velocities of the grid after the step, in place of F = dg/dX (LDM-eq15). A point that was
no quadrature point in the step before starts from F of the map. All else is LDM-alg3, LDM-alg5 by
PIC and LDM-alg7, on a linear map of modes.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import polar


class EvolvingState(NamedTuple):
    """A reduced state with r coordinates, and F of the last step's quadrature points."""

    xhat: np.ndarray        # (r,)
    vhat: np.ndarray        # (r,)          rates [1/s]
    F: np.ndarray           # (n, 3, 3)     NaN of points that have none


def hat(z):
    """Return the quadratic B-spline and its slope at z, distances in cells."""
    a = np.abs(z)
    value = np.where(a < 0.5, 0.75 - a**2, np.where(a < 1.5, 0.5 * (1.5 - a) ** 2, 0.0))
    return value, np.where(a < 0.5, -2.0 * z, np.where(a < 1.5, (a - 1.5) * np.sign(z), 0.0))


def weights(x, dx):
    """Return nodes (k, 3) [m], W (n, k) and dW (n, k, 3) [1/m] of those near x (n, 3) [m]."""
    low, high = np.floor(x.min(axis=0) / dx) - 1, np.ceil(x.max(axis=0) / dx) + 1
    nodes = np.indices((high - low + 1).astype(int)).reshape(3, -1).T + low
    N, dN = hat(x[:, None] / dx - nodes)
    x_, y_, z_ = np.moveaxis(N, 2, 0)
    W = x_ * y_ * z_
    dW = dN * np.stack([y_ * z_, x_ * z_, x_ * y_], axis=2) / dx
    return dx * nodes, W, dW


def kirchhoff(F, mu, lam):
    """Return tau (n, 3, 3) [Pa] of fixed corotated elasticity (LDM-sec5-material)."""
    R = np.array([polar(one)[0] for one in F])
    J = np.linalg.det(F)[:, None, None]
    return 2.0 * mu * (F - R) @ F.mT + lam * J * (J - 1.0) * np.eye(3)


def step(body, modes, state, samples, dt):
    """Return the `EvolvingState` after a step with samples (m,), numbers of points.

    body: X (n, 3), m and V0 (n,), (mu, lam) [Pa], dx [m], gravity (3,); modes: U (n, 3, r) [m] and
    dU/dX (n, 3, 3, r).
    """
    (X, m, V0, moduli, dx, gravity), (U, D) = body, modes
    x, v = X + U @ state.xhat, U @ state.vhat
    F = np.where(np.isnan(state.F), np.eye(3) + D @ state.xhat, state.F)
    _, W, dW = weights(x, dx)
    chosen = (W @ W[samples].any(axis=0)) > 0.0                 # points that share a node with one
    m, P, dP = m[chosen], W[chosen], dW[chosen]
    filled = P.any(axis=0)
    P, dP = P[:, filled], dP[:, filled]
    tau = kirchhoff(F[chosen], *moduli)
    impulse = -dt * np.einsum("p,pab,pib->ia", V0[chosen], tau, dP)
    v_i = (P.T @ (m[:, None] * v[chosen]) + impulse) / (m @ P)[:, None] + dt * gravity
    L = np.einsum("ia,pib->pab", v_i, dP)
    F_new = np.full_like(F, np.nan)
    F_new[chosen] = F[chosen] + dt * L @ F[chosen]
    A = U[samples].reshape(-1, U.shape[2])
    vhat = np.linalg.lstsq(A, (W[np.ix_(samples, filled)] @ v_i).ravel(), rcond=None)[0]
    return EvolvingState(state.xhat + dt * vhat, vhat, F_new)


def run(body, modes, start, samples, dt):
    """Return the `EvolvingState` after each step from xhat, vhat (r,) = start."""
    state = EvolvingState(*start, np.full((len(body[0]), 3, 3), np.nan))
    states = []
    for chosen in samples:
        state = step(body, modes, state, chosen, dt)
        states.append(state)
    return states
