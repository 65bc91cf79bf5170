"""The sums between particles and nodes, and the motion of the nodes: one equation a function.

Indices are p of a particle, i of a node and ip of a pair, with the weights w_ip, their gradients
dw_ip and r_ip = x_i - x_p of `spline.Pairs`. Particle arrays are (N, ..); nodal arrays lie over a
`NodeBox` of nodes, with the shape of the box first.
"""

from typing import NamedTuple

import numpy as np


class NodeBox(NamedTuple):
    """A box of grid nodes, over which nodal arrays lie."""

    first: np.ndarray     # (d,) integer coordinates of its first node
    shape: tuple          # number of nodes along each axis


def box_of(*stencils):
    """Return the smallest `NodeBox` that contains the nodes of all the given `Pairs`."""
    low = np.min([ip.node.min(axis=(0, 1)) for ip in stencils], axis=0)
    high = np.max([ip.node.max(axis=(0, 1)) for ip in stencils], axis=0)
    return NodeBox(low, tuple(high - low + 1))


def node_index(ip, box):
    """Return the index of the nodes of all pairs into an array over a box: d arrays (N, S)."""
    return tuple(np.moveaxis(ip.node - box.first, -1, 0))


def sum_to_nodes(q, ip, box):
    """q_i = sum_p q_ip of q (N, S, ..): particles are the quadrature points (LDM-eq8)."""
    total = np.zeros(box.shape + q.shape[2:], q.dtype)
    np.add.at(total, node_index(ip, box), q)
    return total


def moment(dx, degree):
    """D = sum_i w_ip r_ip r_ip^T = dx^2 (degree + 1)/12 I, for degrees 2 and 3 (NSF-alg-mpm).

    Returns the number [m^2] in front of I.
    """
    return dx * dx * (degree + 1) / 12


# particles to grid (P2G)

def mass(m, ip, box):
    """m_i = sum_p w_ip m_p [kg], the lumped mass (LDM-eq10)."""
    return sum_to_nodes(ip.w * m[:, None], ip, box)


def momentum(m, v, C, ip, box):
    """m_i v_i = sum_p w_ip m_p (v_p + C_p r_ip) [kg m/s] (NSF-alg-mpm step 1).

    C (N, d, d) [1/s] is the affine velocity field of APIC; None for PIC and FLIP, which have none.
    """
    v_ip = v[:, None] + (0 if C is None else np.einsum("pab,psb->psa", C, ip.r))
    return sum_to_nodes((ip.w * m[:, None])[..., None] * v_ip, ip, box)


def internal_force(V0, tau, ip, box):
    """f_i = -sum_p V0_p tau_p dw_ip [N] (NSF-eq6, NCLAW-eq10).

    V0 (N,) [m^d] is the volume at rest, tau (N, d, d) [Pa] the Kirchhoff stress.
    """
    return sum_to_nodes(-np.einsum("p,pab,psb->psa", V0, tau, ip.dw), ip, box)


def internal_force_mls(V0, tau, D, ip, box):
    """f_i = -sum_p V0_p D^-1 w_ip tau_p r_ip [N], the force of MLS-MPM (NCLAW-mls)."""
    return sum_to_nodes(-np.einsum("p,ps,pab,psb->psa", V0 / D, ip.w, tau, ip.r), ip, box)


def body_force(m, b, ip, box):
    """f_i = sum_p w_ip m_p b_p [N], where b (N, d) [m/s^2] differs between particles."""
    return sum_to_nodes((ip.w * m[:, None])[..., None] * b[:, None], ip, box)


# motion of the grid

def grid_velocity(m, mv, f, gravity, dt, eps=0):
    """v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g where m_i > 0, else 0 (NSF-alg-mpm step 2).

    Explicit Euler (NCLAW-eq11). gravity g is an array (d,) [m/s^2]; eps [kg] is the regularisation
    in the release of NCLAW.
    """
    full = m > 0
    v = (mv + dt * f) / np.where(full, m + eps, 1)[..., None]
    return np.where(full[..., None], v + dt * gravity, 0)


# grid to particles (G2P)

def velocity(v_i, ip, box):
    """v_p = sum_i w_ip v_i [m/s] (NSF-alg-mpm step 3)."""
    return np.einsum("ps,psa->pa", ip.w, v_i[node_index(ip, box)])


def velocity_gradient(v_i, ip, box):
    """L_p = sum_i v_i dw_ip^T [1/s] (NSF-alg-mpm step 3)."""
    return np.einsum("psa,psb->pab", v_i[node_index(ip, box)], ip.dw)


def affine(v_i, D, ip, box):
    """C_p = sum_i w_ip v_i r_ip^T D^-1 [1/s] (NSF-alg-mpm step 3)."""
    return np.einsum("ps,psa,psb->pab", ip.w, v_i[node_index(ip, box)], ip.r) / D


def flip(v, v_new, v_old, share):
    """v_p = sum_i w_ip v_i + share (v_p - sum_i w_ip v_old_i): PIC for share 0, FLIP for 1.

    v is the particle's own velocity before the step; v_new and v_old (N, d) are the two sums, of
    the nodal velocities after the step and before the forces.
    """
    return v_new + share * (v - v_old)


def shift_spin(shift, change):
    """(q s^T - s q^T)/2 (N, d, d) of the shifts s (N, d) [m] and changes of velocity q (N, d).

    A particle of mass m whose velocity is not that of its shift, but differs by q, gains the
    angular momentum m s x q; m times this moment has as much spin.
    """
    A = np.einsum("pa,pb->pab", change, shift)
    return (A - np.swapaxes(A, 1, 2)) / 2


def relaxed_affine(C, pair, D, share, spin):
    """C_p = new + share (C - old) - spin/D [1/s], with pair (new, old) of `affine` fields.

    C is the particle's own field before the step; new and old are those of the nodal velocities
    after the step and before the forces; spin is a `shift_spin`.
    """
    new, old = pair
    return new + share * (C - old) - spin / D


def rpic(C, damping):
    """C' = (1 - damping) sym C + skew C, which damps strain and keeps rotation (NSF-rpic)."""
    T = np.swapaxes(C, 1, 2)
    return (1 - damping) * (C + T) / 2 + (C - T) / 2
