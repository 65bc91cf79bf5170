"""A weakly compressible fluid in 2D: quadratic B-splines, a blend of PIC and FLIP, a slip box.

One step, with the share f of FLIP:

    m_i = sum_p w_ip m_p,  m_i u_i = sum_p w_ip m_p v_p
    v_i = u_i + dt (g - sum_p V0_p tau_p dw_ip/m_i)         (NSF-eq6)
    v_i . n = 0 at nodes in a wall with the normal n
    x_p <- x_p + dt sum_i w_ip v_i
    v_p <- f (v_p + sum_i w_ip (v_i - u_i)) + (1 - f) sum_i w_ip v_i
    J_p <- J_p det(I + dt sum_i v_i dw_ip^T)
    tau = lam J (J - 1)                                     (NCLAW-eq20)

A particle remembers J alone. The splines are sums of truncated powers.
"""

from math import comb
from typing import NamedTuple

import numpy as np


class FluidProblem(NamedTuple):
    """The constants of all steps; node (j, k) of count x count lies at (j, k) dx."""

    m: np.ndarray       # (N,)  masses [kg]
    V0: np.ndarray      # (N,)  volumes at rest [m^2]
    lam: float          # stiffness [Pa]
    g: np.ndarray       # (2,)  gravity [m/s^2]
    low: tuple          # first free node on each axis
    high: tuple         # last free node on each axis
    flip: float         # share of FLIP, from 0 to 1
    dx: float           # [m]
    dt: float           # [s]
    count: int


def spline(s, power):
    """Return the quadratic B-spline at s for power 2, and its slope for power 1.

    The spline is sum_k (-1)^k binom(3, k) max(3/2 - |s| - k, 0)^2/2.
    """
    terms = [(-1)**k * comb(3, k) * np.maximum(1.5 - abs(s) - k, 0)**power for k in range(2)]
    return sum(terms) / 2 if power == 2 else -np.sign(s) * sum(terms)


def weights(x, dx, count):
    """Return W (N, n) at x (N, 2) and its gradients along both axes [1/m].

    Node (j, k) of count x count is column j count + k.
    """
    s = x[:, None] / dx - np.arange(count)[:, None]                     # (N, count, 2)
    w, dw = spline(s, 2), spline(s, 1) / dx
    return [np.einsum("pj,pk->pjk", a[..., 0], b[..., 1]).reshape(len(x), -1)
            for a, b in ((w, w), (dw, w), (w, dw))]


def step(x, v, J, problem):
    """Return x (N, 2) [m], v (N, 2) [m/s] and the ratios J (N,) of volumes after a step."""
    m, V0, lam, g, low, high, flip, dx, dt, count = problem
    W, *dW = weights(x, dx, count)
    m_i = W.T @ m
    per_mass = np.divide(1.0, m_i, out=np.zeros_like(m_i), where=m_i > 0)[:, None]
    before = per_mass * (W.T @ (m[:, None] * v))
    force = -np.stack([d.T @ (V0 * lam * J * (J - 1)) for d in dW], axis=1)
    after = before + dt * (g + per_mass * force)
    node = np.indices((count, count)).reshape(2, -1).T
    after[(node < low) | (node > high)] = 0
    dt_L = dt * np.stack([d @ after for d in dW], axis=2)               # (N, 2, 2)
    v = flip * (v + W @ (after - before)) + (1 - flip) * W @ after
    return x + dt * W @ after, v, J * np.linalg.det(np.eye(2) + dt_L)
