"""The incremental potential of HOT and its gradient (HOT-eq1, HOT-eq2).

The velocities of an implicit step minimise E over the increments dv_i of the nodes [m/s]:

    E(dv) = sum_i m_i |dv_i|^2/2 - dt sum_i m_i g . (v_i + dv_i) + sum_p V0_p psi(F_p)
    F_p = A_p F_p^n,      A_p = I + dt sum_i (v_i + dv_i) dw_ip^T

Nodal arrays lie over a `transfer.NodeBox`; F_p^n is the deformation gradient before the step.
"""

import numpy as np

from . import transfer
from .laws import energy, kirchhoff
from .tensors import det


def cofactor(A):
    """cof A = det(A) A^-T (N, d, d), without a division."""
    if A.shape[1] == 2:
        a, b, c, d = (A[:, i, j] for i in (0, 1) for j in (0, 1))
        return np.stack((d, -c, -b, a), axis=1).reshape(A.shape)
    rows = [np.cross(A[:, i - 2], A[:, i - 1]) for i in range(3)]
    return np.stack(rows, axis=1)


def growth(u, dt, ip, box):
    """A_p = I + dt sum_i u_i dw_ip^T (N, d, d), for nodal velocities u (.., d) (HOT-eq1)."""
    L = transfer.velocity_gradient(u, ip, box)
    return np.eye(L.shape[1], dtype=L.dtype) + dt * L


def deformation_gradient(A, F):
    """F_p = A_p F_p^n (N, d, d); det(A_p) J_p^n (N,) of a fluid, which carries J alone."""
    return det(A) * F if F.ndim == 1 else np.einsum("pab,pbc->pac", A, F)


def elastic_energy(q, A):
    """sum_p V0_p psi(A_p F_p^n) [J] of the material points q (`step.Matter`)."""
    return (q.V0 * energy(deformation_gradient(A, q.F), q.law)).sum()


def internal_force(q, A, ip, box):
    """f_i = -sum_p V0_p P_p (F_p^n)^T dw_ip [N], where P F_n^T = tau A^-T (HOT-eq2).

    P is the first Piola-Kirchhoff stress at F_p, tau the Kirchhoff stress there.
    """
    tau = kirchhoff(deformation_gradient(A, q.F), q.law)
    inverse = cofactor(A) / det(A)[:, None, None]
    tau = tau[:, None, None] * np.eye(A.shape[1]) if tau.ndim == 1 else tau
    S = np.einsum("pab,pbc->pac", tau, inverse)
    return transfer.internal_force(q.V0, S, ip, box)


def evaluate(bodies, m, v, dv, dt, gravity):
    """E(dv) [J] (HOT-eq1), and g_i = dE/d dv_i = m_i dv_i - dt f_i - dt m_i g (.., d) [kg m/s].

    bodies are triples (material points, `Pairs`, box); m (..) [kg] and v (.., d) [m/s] are the
    nodal masses and the velocities before the step, gravity is (d,) [m/s^2].
    """
    m = m[..., None]
    E = (m * dv * dv).sum() / 2 - dt * (m * gravity * (v + dv)).sum()
    g = m * (dv - dt * gravity)
    for q, ip, box in bodies:
        A = growth(v + dv, dt, ip, box)
        E, g = E + elastic_energy(q, A), g - dt * internal_force(q, A, ip, box)
    return E, g
