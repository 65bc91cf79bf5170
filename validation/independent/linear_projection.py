"""LDM's reduced step on a linear map of modes: neighbours by PIC, linear projection.

    x = X + sum_k xhat_k U_k,    F = I + sum_k xhat_k D_k,    v = sum_k vhat_k U_k    LDM-eq14..16
    neighbours and their step by PIC                                    LDM-alg3, LDM-alg5
    vhat = argmin_w sum_M |U w - v_trial|^2,    xhat += dt vhat         LDM-alg7

A step has dense matrices of particles by nodes; active nodes and neighbours are their non-zeros.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

SPLINE = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)      # quadratic


class ModalBody(NamedTuple):
    """A fixed corotated body of n particles in 3D on a grid, and the modes of its map."""

    X: np.ndarray           # (n, 3)        positions at rest [m]
    m: np.ndarray           # (n,)          masses [kg]
    V0: np.ndarray          # (n,)          volumes at rest [m^3]
    U: np.ndarray           # (n, 3, r)     modes [m]
    D: np.ndarray           # (n, 3, 3, r)  their gradients dU/dX
    mu: float               # [Pa]
    lam: float              # [Pa]
    dx: float               # [m]           spacing of the grid
    gravity: np.ndarray     # (3,)          [m/s^2]
    is_fixed: object        # nodes (k, 3) [m] -> (k,), which of them stand still


def pod(X, x, F, r):
    """Return the r modes U (n, 3, r) and gradients D (n, 3, 3, r) that fit snapshots best.

    x (s, n, 3) [m], F (s, n, 3, 3). Coordinates of the snapshots have a root mean square of 1.
    """
    left, _, _ = np.linalg.svd((x - X).reshape(len(x), -1), full_matrices=False)
    share = left[:, :r] / np.sqrt(len(x))
    return np.tensordot(x - X, share, (0, 0)), np.tensordot(F - np.eye(3), share, (0, 0))


def weights(x, dx):
    """Return nodes (k, 3) [m], W (n, k) and its gradient dW (n, k, 3) [1/m] at x (n, 3) [m]."""
    axes = [np.arange(np.floor(a.min() / dx) - 2, np.ceil(a.max() / dx) + 3) for a in x.T]
    z = [a[:, None] / dx - nodes for a, nodes in zip(x.T, axes, strict=True)]
    N = [np.nan_to_num(SPLINE(a)) for a in z]
    dN = [np.nan_to_num(SPLINE.derivative()(a)) / dx for a in z]
    factors = [N] + [[dN[b] if a == b else N[b] for b in range(3)] for a in range(3)]
    W, *dW = (np.einsum("pi,pj,pk->pijk", *f).reshape(len(x), -1) for f in factors)
    nodes = dx * np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return nodes, W, np.stack(dW, axis=-1)


def kirchhoff(F, mu, lam):
    """Return tau = 2 mu (F - R) F^T + lam J (J - 1) I (n, 3, 3) [Pa] (LDM-sec5-material)."""
    left, _, right = np.linalg.svd(F)
    J = np.linalg.det(F)[:, None, None]
    return 2.0 * mu * (F - left @ right) @ F.transpose(0, 2, 1) + lam * J * (J - 1.0) * np.eye(3)


def trial_velocities(body, xhat, vhat, samples, dt):
    """Return the velocities (m, 3) [m/s] of samples after a step on the grid (LDM-alg5)."""
    nodes, W, dW = weights(body.X + body.U @ xhat, body.dx)
    active = W[samples].any(axis=0)
    chosen = W[:, active].any(axis=1)                           # samples and neighbours
    nodes, W, dW = nodes[active], W[:, active], dW[np.ix_(chosen, active)]
    P, V0 = W[chosen], body.V0[chosen]
    F = np.eye(3) + body.D[chosen] @ xhat
    m = body.m[chosen]
    mass = m @ P
    momentum = P.T @ (m[:, None] * (body.U[chosen] @ vhat))
    force = -np.einsum("p,pab,pib->ia", V0, kirchhoff(F, body.mu, body.lam), dW)
    v = (momentum + dt * force) / mass[:, None] + dt * body.gravity
    v[body.is_fixed(nodes)] = 0.0
    return W[samples] @ v


def fitted(U, v):
    """Return the rates (r,) of modes U (m, 3, r) nearest to velocities v (m, 3) (LDM-eq23)."""
    return np.linalg.lstsq(U.reshape(-1, U.shape[-1]), v.ravel(), rcond=None)[0]


def run(body, v, samples, dt):
    """Return the latent coordinates (steps + 1, r) of a run from rest with velocities v (n, 3).

    samples: the numbers (m,) of the samples of each step; dt [s].
    """
    xhat, vhat = np.zeros(body.U.shape[-1]), fitted(body.U, v)      # LDM-eq19
    states = [xhat]
    for chosen in samples:
        vhat = fitted(body.U[chosen], trial_velocities(body, xhat, vhat, chosen, dt))
        xhat = xhat + dt * vhat
        states.append(xhat)
    return np.array(states)
