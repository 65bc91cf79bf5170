"""The stop of a minimisation by node-wise characteristic norms (HOT-sec5.2, HOT-eq9).

    xi_p    = ||dP/dF||_F at F = I            [Pa]         the d d x d d matrix in full
    xi_i    = sum_p w_ip m_p xi_p / sum_p w_ip m_p         [Pa]
    kappa_i = xi_i ell dt                     [kg m/s]     ell: surface of the cube of side 2 dx
    stop:     sqrt(sum_i |g_i/kappa_i|^2) <= eps sqrt(n)   n nodes with mass, fixed ones too

The derivative at rest comes from the complex step, the surface from a convex hull. Fixed corotated
elasticity throughout (HOT-material).
"""

from itertools import product

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import ConvexHull

SPLINE = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)
STEP, SWEEPS = 1e-30, 10    # of the complex step, and of the polar decomposition


def pk1(F, mu, lam):
    """Return P = 2 mu (F - R) + lam (J - 1) J F^-T [Pa] at a complex F (d, d) near I.

    R is the limit of Newton's iteration R <- (R + R^-T)/2.
    """
    R, J = F, np.linalg.det(F)
    for _ in range(SWEEPS):
        R = 0.5 * (R + np.linalg.inv(R).T)
    return 2.0 * mu * (F - R) + lam * (J - 1.0) * J * np.linalg.inv(F).T


def rest_stiffness(mu, lam, d):
    """Return xi_p [Pa] of the moduli mu and lam [Pa] in d dimensions."""
    directions = np.eye(d * d).reshape(-1, d, d)
    columns = [pk1(np.eye(d) + 1j * STEP * E, mu, lam).imag / STEP for E in directions]
    return np.linalg.norm(columns)


def weights(x, nodes, dx):
    """Return w_ip (N, n) of particles x (N, d) and nodes (n, d) [m]: quadratic B-splines."""
    return np.nan_to_num(SPLINE((x[:, None] - nodes) / dx)).prod(axis=-1)


def characteristic_norms(w, m, xi, dx, dt, d):
    """Return kappa_i (n,) [kg m/s] of nodes with mass, from w_ip (N, n), m_p, xi_p (N,)."""
    corners = dx * np.array(list(product((-1.0, 1.0), repeat=d)))
    return (m * xi) @ w / (m @ w) * ConvexHull(corners).area * dt


def residual(g, kappa):
    """Return ||g^||_2/sqrt(n) of g (n, d) and kappa (n,): the stop is residual <= eps."""
    return np.linalg.norm(g / kappa[:, None]) / np.sqrt(len(g))
