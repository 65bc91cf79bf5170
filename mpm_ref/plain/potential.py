"""The incremental potential of HOT and its gradient, from the functions of `transfer` and `laws`.

Nodes are arrays over a box; dv (.., d) [m/s] is the change of their velocities v in a step of dt.
"""

import numpy as np

from . import transfer
from .laws import energy, kirchhoff
from .tensors import det


def cofactor(A):
    """cof A = det(A) A^-T (N, d, d)."""
    if A.shape[1] == 2:
        a, b, c, d = (A[:, i, j] for i in (0, 1) for j in (0, 1))
        return np.stack((d, -c, -b, a), axis=1).reshape(A.shape)
    rows = [np.cross(A[:, i - 2], A[:, i - 1]) for i in range(3)]
    return np.stack(rows, axis=1)


def growth(u, dt, ip, box):
    """A_p = I + dt sum_i u_i dw_ip^T (N, d, d), with F_p = A_p F_p^n (HOT-eq1)."""
    L = transfer.velocity_gradient(u, ip, box)
    return np.eye(L.shape[1], dtype=L.dtype) + dt * L


def moved(A, F):
    """A F; det(A) J of a fluid, which carries J alone."""
    return det(A) * F if F.ndim == 1 else np.einsum("pab,pbc->pac", A, F)


def elastic(q, A):
    """sum_p V0_p psi(F_p) [J] of the particles q."""
    return (q.V0 * energy(moved(A, q.F), q.law)).sum()


def internal_force(q, A, ip, box):
    """f_i = -sum_p V0_p P_p (F_p^n)^T dw_ip [N], where P F_n^T = tau A^-T (HOT-eq2)."""
    tau, inverse = kirchhoff(moved(A, q.F), q.law), cofactor(A) / det(A)[:, None, None]
    tau = tau[:, None, None] * np.eye(A.shape[1]) if tau.ndim == 1 else tau
    S = np.einsum("pab,pbc->pac", tau, inverse)
    return transfer.internal_force(q.V0, S, ip, box)


def evaluate(bodies, m, v, dv, dt, gravity):
    """E(dv) [J] (HOT-eq1), and g = dE/d dv = m dv - dt f - dt m b (.., d) [kg m/s].

    bodies are triples of particles, `Pairs` and the box; m, v are masses and velocities over it.
    """
    m = m[..., None]
    E = (m * dv * dv).sum() / 2 - dt * (m * gravity * (v + dv)).sum()
    g = m * (dv - dt * gravity)
    for q, ip, box in bodies:
        A = growth(v + dv, dt, ip, box)
        E, g = E + elastic(q, A), g - dt * internal_force(q, A, ip, box)
    return E, g
