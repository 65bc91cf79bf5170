"""One step of backward Euler with dense weights, minimised by SciPy (HOT-sec3.1-seq).

Particles to nodes by APIC; the velocities u_i = v_i + dv_i of the nodes that are not fixed minimise

    E   = sum_i m_i (|dv_i|^2/2 - dt g . u_i) + sum_p V0_p psi(F_p),                       HOT-eq1
    F_p = F_p^n + dt sum_i u_i y_ip^T = F_p^n + B u,      y_ip = (F_p^n)^T dw_ip,          HOT-eq2

by a trust-region method first, then by root finding in the gradient, to round-off; nodes to
particles by APIC. Nodes lie at multiples of dx, splines are quadratic, fixed nodes end at rest.
Fixed corotated elasticity with det F > 0; d2psi/dF2 comes from the complex step.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import minimize, root

SPLINE = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)
SLOPE = SPLINE.derivative()
STEP, SWEEPS = 1e-30, 12    # of the complex step, and of the polar decomposition


class ElasticParticles(NamedTuple):
    """N particles in d dimensions, and the moduli of their law."""

    x: np.ndarray           # (N, d)        position [m]
    v: np.ndarray           # (N, d)        velocity [m/s]
    C: np.ndarray           # (N, d, d)     affine velocity field [1/s]
    F: np.ndarray           # (N, d, d)     deformation gradient
    m: np.ndarray           # (N,)          mass [kg]
    V0: np.ndarray          # (N,)          volume at rest [m^d]
    moduli: np.ndarray      # (2, N)        mu, lam [Pa]


def weights(x, dx):
    """Return nodes (n, d) [m] near x (N, d), w_ip (N, n) and dw_ip (N, n, d) [1/m]."""
    axes = [np.arange(a.min() // dx - 1.0, a.max() // dx + 3.0) for a in x.T]
    nodes = dx * np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    r = (x[:, None] - nodes) / dx
    w, slope = np.nan_to_num(SPLINE(r)), np.nan_to_num(SLOPE(r)) / dx
    dw = [np.where(axis, slope, w).prod(axis=-1) for axis in np.eye(len(axes), dtype=bool)]
    near = w.prod(axis=-1).any(axis=0)
    return nodes[near], w.prod(axis=-1)[:, near], np.stack(dw, axis=-1)[:, near]


def response(F, moduli):
    """Return psi (N,) and P (N, d, d) [Pa] of F (N, d, d), real or complex."""
    R, (mu, lam), J = F, moduli, np.linalg.det(F)
    for _ in range(SWEEPS):
        R = 0.5 * (R + np.linalg.inv(R).swapaxes(1, 2))
    psi = mu * ((F - R) ** 2).sum(axis=(1, 2)) + 0.5 * lam * (J - 1.0) ** 2
    pressure = (lam * (J - 1.0) * J)[:, None, None]
    return psi, 2.0 * mu[:, None, None] * (F - R) + pressure * np.linalg.inv(F).swapaxes(1, 2)


def differential(F, moduli):
    """Return d2psi/dF2 (N, d d, d d) [Pa] of F (N, d, d): the change of P by each entry."""
    d = F.shape[1]
    columns = [response(F + 1j * STEP * E, moduli)[1].imag.reshape(len(F), -1) / STEP
               for E in np.eye(d * d).reshape(-1, d, d)]
    return np.stack(columns, axis=-1)


def implicit_step(before, dx, dt, g, is_fixed):
    """Return nodes (n, d) [m], their velocities (n, d) after the step, and `ElasticParticles`.

    is_fixed(nodes) is a mask (n,); g (d,) [m/s^2] is the gravity.
    """
    x, v, C, F, m_p, V0, moduli = before
    d = len(g)
    nodes, w, dw = weights(x, dx)
    arm, free = nodes - x[:, None], np.repeat(~is_fixed(nodes), d)
    momentum = np.einsum("pi,p,pia->ia", w, m_p, v[:, None] + np.einsum("pab,pib->pia", C, arm))
    m = np.repeat(m_p @ w, d)[free]
    v_n, fall = momentum.ravel()[free] / m, dt * np.tile(g, len(nodes))[free]
    y = np.einsum("pcb,pic->pib", F, dw)
    B = dt * np.einsum("ac,pib->pabic", np.eye(d), y).reshape(F.size, -1)[:, free]

    def deformed(u):
        return F + (B @ u).reshape(F.shape)

    def potential(u):
        return m @ (0.5 * (u - v_n) ** 2 - fall * u) + V0 @ response(deformed(u), moduli)[0]

    def gradient(u):
        P = response(deformed(u), moduli)[1]
        return m * (u - v_n - fall) + (V0[:, None, None] * P).ravel() @ B

    def hessian(u):
        A = V0[:, None, None] * differential(deformed(u), moduli)
        return np.diag(m) + B.T @ (A @ B.reshape(len(x), d * d, -1)).reshape(B.shape)

    u = minimize(potential, v_n, jac=gradient, hess=hessian, method="trust-exact").x
    u = root(gradient, u, jac=hessian, options={"xtol": 1e-15}).x
    v_new = np.zeros(nodes.shape)
    v_new.ravel()[free] = u
    C_new = 4.0 / dx**2 * np.einsum("pi,ia,pib->pab", w, v_new, arm)
    after = before._replace(x=x + dt * w @ v_new, v=w @ v_new, C=C_new, F=deformed(u))
    return nodes, v_new, after
