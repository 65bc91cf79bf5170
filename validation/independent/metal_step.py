"""Metal in 3D: APIC with quadratic B-splines, von Mises flow that hardens, on Hencky strains.

A block stands on a sticky floor; a sticky press goes down on it. One step (NSF-alg-mpm), with
r_ip = x_i - x_p and D = dx^2/4:

    m_i = sum_p w_ip m_p,  m_i v_i = sum_p w_ip m_p (v_p + C_p r_ip)
    v_i <- v_i - dt/m_i sum_p V0_p tau_p dw_ip
    v_i = 0 in the floor, v_i = that of the press in the press where it is at the end of the step
    v_p = sum_i w_ip v_i,  x_p <- x_p + dt v_p,  C_p = sum_i w_ip v_i r_ip^T/D
    F_p <- Z((I + dt sum_i v_i dw_ip^T) F_p),  tau_p of F_p           (NSF-F2)

The return map Z and the hardening of the yield stress y are those of NSF-F4.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

SPLINE = BSpline.basis_element(np.arange(4) - 1.5, extrapolate=False)


class MetalProblem(NamedTuple):
    """The constants of a step; node (j, k, l) lies at (j, k, l) dx."""

    m: np.ndarray       # (N,)  masses [kg]
    V0: np.ndarray      # (N,)  volumes at rest [m^3]
    mu: float           # Lame's parameters [Pa]
    lam: float
    xi: float           # hardening
    floor: float        # height of the floor [m]
    press: float        # height of the press at the end of the step [m]
    v_press: np.ndarray     # (3,)  velocity of the press [m/s]
    dx: float           # [m]
    dt: float           # [s]
    shape: tuple        # numbers of nodes along the axes


def flow(trial, y, mu, xi):
    """Return elastic F (N, 3, 3) and y (N,) [Pa] after the flow of trial gradients (N, 3, 3)."""
    U, s, Vt = np.linalg.svd(trial)
    eps = np.log(s)
    hat = eps - eps.mean(1, keepdims=True)
    norm = np.linalg.norm(hat, axis=1)
    dgamma = np.maximum(norm - y / (2 * mu), 0)
    Z = np.exp(eps - (dgamma / np.where(norm > 0, norm, 1))[:, None] * hat)
    return (U * Z[:, None]) @ Vt, y + 2 * mu * xi * dgamma


def kirchhoff(F, mu, lam):
    """Return tau (N, 3, 3) [Pa] of elastic F (N, 3, 3)."""
    U, s, _ = np.linalg.svd(F)
    eps = np.log(s)
    return (U * (2 * mu * eps + lam * eps.sum(1, keepdims=True))[:, None]) @ U.swapaxes(1, 2)


def splines(x, dx, shape):
    """Return the weights (N, n) at x (N, 3), and their gradients (N, n, 3) [1/m]."""
    s = [x[:, a, None] / dx - np.arange(shape[a]) for a in range(3)]
    w, dw = ([np.nan_to_num(f(q)) for q in s] for f in (SPLINE, SPLINE.derivative()))
    product = [np.einsum("pi,pj,pk->pijk", *(dw[b] if a == b else w[b] for b in range(3)))
               .reshape(len(x), -1) for a in range(4)]
    return product[3], np.stack(product[:3], -1) / dx


def step(x, v, C, F, y, problem):
    """Return x (N, 3) [m], v (N, 3) [m/s], C (N, 3, 3) [1/s], elastic F and y [Pa] after a step."""
    m, V0, mu, lam, xi, floor, press, v_press, dx, dt, shape = problem
    W, dW = splines(x, dx, shape)
    place = np.indices(shape).reshape(3, -1).T * dx
    affine = np.tensordot(W.T, m[:, None, None] * C, 1) @ place[..., None]              # at x_i
    momentum = (W.T @ (m[:, None] * (v - (C @ x[..., None])[..., 0])) + affine[..., 0]
                - dt * (dW @ (V0[:, None, None] * kirchhoff(F, mu, lam))).sum(0))
    m_i = (W.T @ m)[:, None]
    v_i = np.divide(momentum, m_i, out=np.zeros_like(momentum), where=m_i > 0)
    v_i[place[:, 2] <= floor + 1e-9 * dx] = 0
    v_i[place[:, 2] >= press - 1e-9 * dx] = v_press
    v = W @ v_i
    moment = np.tensordot(W, v_i[..., None] * place[:, None], 1)                # (N, 3, 3)
    C = (moment - v[..., None] * x[:, None]) * 4 / dx**2
    return x + dt * v, v, C, *flow(F + dt * v_i.T @ dW @ F, y, mu, xi)
