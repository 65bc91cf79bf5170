"""MLS-MPM in 2D: quadratic B-splines, fixed corotated elasticity, gravity, a sticky floor.

One step (NCLAW-mls, NSF-alg-mpm), with r_ip = x_i - x_p and D = dx^2/4:

    m_i = sum_p w_ip m_p
    m_i v_i = sum_p w_ip (m_p (v_p + C_p r_ip) - dt V0_p/D tau_p r_ip)
    v_i <- v_i + dt g,  and v_i = 0 at nodes on the floor or below it
    v_p = sum_i w_ip v_i,  x_p <- x_p + dt v_p
    C_p = sum_i w_ip v_i r_ip^T/D,  F_p <- (I + dt C_p) F_p
    tau = 2 mu (F - R) F^T + lam (J - 1) J I        (NSF-eq12, NCLAW-eq12)

Sums over particles and nodes are products with the dense matrix W (N, n) of the weights.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

SPLINE = BSpline.basis_element(np.arange(4) - 1.5, extrapolate=False)


class ElasticProblem(NamedTuple):
    """The constants of all steps; node (j, k) lies at (j, k) dx."""

    m: np.ndarray       # (N,)  masses [kg]
    V0: np.ndarray      # (N,)  volumes at rest [m^2]
    E: float            # Young's modulus [Pa]
    nu: float           # Poisson's ratio
    g: np.ndarray       # (2,)  gravity [m/s^2]
    floor: int          # row of nodes on the floor, which goes on below; -1 for none
    dx: float           # [m]
    dt: float           # [s]
    shape: tuple        # numbers of nodes along both axes


def lame(E, nu):
    """Return mu and lam [Pa] (NSF-F0)."""
    return E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))


def weights(x, dx, shape):
    """Return W (N, n) at x (N, 2); node (j, k) of a grid of that shape is row j shape[1] + k."""
    along_x, along_y = (np.nan_to_num(SPLINE(x[:, a, None] / dx - np.arange(shape[a])))
                        for a in range(2))
    return np.einsum("pj,pk->pjk", along_x, along_y).reshape(len(x), -1)


def kirchhoff(F, E, nu):
    """Return tau (N, 2, 2) [Pa] of F (N, 2, 2) with det F > 0."""
    mu, lam = lame(E, nu)
    U, _, Vt = np.linalg.svd(F)
    J = np.linalg.det(F)[:, None, None]
    return 2 * mu * (F - U @ Vt) @ F.swapaxes(1, 2) + lam * (J - 1) * J * np.eye(2)


def step(x, v, C, F, problem):
    """Return x (N, 2) [m], v (N, 2) [m/s], C (N, 2, 2) [1/s] and F (N, 2, 2) after a step."""
    m, V0, E, nu, g, floor, dx, dt, shape = problem
    D = dx**2 / 4
    W = weights(x, dx, shape)
    nodes = np.indices(shape).reshape(2, -1).T
    r = nodes * dx - x[:, None]                                         # (N, n, 2)
    slope = m[:, None, None] * C - dt / D * V0[:, None, None] * kirchhoff(F, E, nu)
    momentum = W.T @ (m[:, None] * v) + np.einsum("pi,pab,pib->ia", W, slope, r)
    m_i = (W.T @ m)[:, None]
    v_i = np.divide(momentum, m_i, out=np.zeros_like(momentum), where=m_i > 0) + dt * g
    v_i[nodes[:, 1] <= floor] = 0
    v = W @ v_i
    C = np.einsum("pi,ia,pib->pab", W, v_i, r) / D
    return x + dt * v, v, C, (np.eye(2) + dt * C) @ F
