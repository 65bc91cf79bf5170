"""The transposed sums of the transfers in `plain.transfer`, one equation a function.

The bar of a field is the gradient of the loss by it. In the equations below the fields on the left
are bars; i is a node, p a particle, ip a pair, with the weights of `plain.spline.Pairs`.
"""

from math import prod
from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.spline import bspline, slope

PERMUTATION = {2: np.array([[0, 1], [-1, 0]]), 3: np.zeros((3, 3, 3), int)}    # Levi-Civita
for _k in range(3):
    PERMUTATION[3][_k, (_k + 1) % 3, (_k + 2) % 3] = 1
    PERMUTATION[3][_k, (_k + 2) % 3, (_k + 1) % 3] = -1


class GatherBars(NamedTuple):
    """Bars of the sums that G2P gathers for one body; None for a sum that it does not make."""

    u: np.ndarray               # (N, d)     of sum_i w_ip v_i
    B: np.ndarray | None        # (N, d, d)  of sum_i w_ip v_i r_ip^T
    L: np.ndarray | None        # (N, d, d)  of sum_i v_i dw_ip^T
    u_old: np.ndarray | None    # (N, d)     of -sum_i w_ip v_old_i (FLIP)


class ScatteredFields(NamedTuple):
    """Fields of one body that P2G scatters; None for a field that it does not carry."""

    m: np.ndarray           # (N,)
    V0: np.ndarray          # (N,)
    v: np.ndarray           # (N, d)
    C: np.ndarray | None    # (N, d, d)
    tau: np.ndarray         # (N, d, d)
    b: np.ndarray | None    # (N, d)


class NodeBars(NamedTuple):
    """Bars of the mass (..), momentum and force (.., d) of the nodes."""

    m: np.ndarray
    mv: np.ndarray
    f: np.ndarray


class ParticleBars(NamedTuple):
    """Bars of one body that the adjoint of P2G gathers; None for a field that is not carried."""

    x: np.ndarray
    v: np.ndarray
    C: np.ndarray
    tau: np.ndarray
    m: np.ndarray
    V0: np.ndarray
    b: np.ndarray


class CurvedPairs(NamedTuple):
    """The pairs of a body (see `plain.spline.Pairs`), with second derivatives of the weights."""

    node: np.ndarray    # (N, S, d)
    w: np.ndarray       # (N, S)
    dw: np.ndarray      # (N, S, d)     [1/m]
    r: np.ndarray       # (N, S, d)     [m]
    ddw: np.ndarray     # (N, S, d, d)  [1/m^2]


def curved_pairs(ip, method):
    """Return the `CurvedPairs` of `Pairs` ip, with ddw = d2 w_ip/dx_p^2."""
    u = -ip.r / method.dx + (method.degree + 1) / method.dx.dtype.type(2)
    n, dn, ddn = (f(u, method.degree) for f in (bspline, slope, second_slope))
    axes = range(u.shape[2])

    def factor(c, a, b):
        if c not in (a, b):
            return n
        return ddn if a == b else dn

    ddw = [[prod(factor(c, a, b)[..., c] for c in axes) for b in axes] for a in axes]
    return CurvedPairs(*ip, np.moveaxis(np.array(ddw), (0, 1), (2, 3)) / method.dx**2)


def second_slope(u, degree):
    """Return d2N/du2 of the B-spline (see `plain.spline.slope`); 0 for degree 1."""
    return slope(u, degree - 1) - slope(u - 1, degree - 1) if degree > 1 else 0 * u


def gathered_bar(bar, ip):
    """U_ip = u_p + B_p r_ip (N, S, d), or (N, 1, d) where B is not carried."""
    U = bar.u[:, None]
    return U if bar.B is None else U + np.einsum("pab,psb->psa", bar.B, ip.r)


def velocities(bar, ip, box):
    """v_i = sum_p w_ip U_ip + L_p dw_ip."""
    q = ip.w[..., None] * gathered_bar(bar, ip)
    if bar.L is not None:
        q = q + np.einsum("pab,psb->psa", bar.L, ip.dw)
    return transfer.sum_to_nodes(q, ip, box)


def old_velocities(bar, ip, box):
    """v_old_i = -sum_p w_ip u_old_p (FLIP)."""
    return transfer.sum_to_nodes(-(ip.w[..., None] * bar.u_old[:, None]), ip, box)


def positions(bar, ip, v, v_old):
    """x_p = sum_i (v_i . U_ip - v_old_i . u_old_p) dw_ip - w_ip B_p^T v_i + ddw_ip L_p^T v_i.

    v and v_old (N, S, d), or None, are the velocities of the nodes of the pairs.
    """
    U = gathered_bar(bar, ip) + 0 * ip.r
    along = np.einsum("psa,psa->ps", v, U)
    if v_old is not None:
        along = along - np.einsum("psa,pa->ps", v_old, bar.u_old)
    x = np.einsum("ps,psb->pb", along, ip.dw)
    if bar.B is not None:
        x = x - np.einsum("ps,pab,psa->pb", ip.w, bar.B, v)
    if bar.L is not None:
        x = x + np.einsum("psbc,pac,psa->pb", ip.ddw, bar.L, v)
    return x


def update_adjoint(v_bar, over, v, dt):
    """Return the `NodeBars` of v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g.

    v_bar (.., d) is the bar of v_i, over (..) is 1/(m_i + eps), v the new velocity without dt g.
    """
    mv = v_bar * over[..., None]
    return NodeBars(-np.einsum("...a,...a->...", mv, v), mv, dt * mv)


def add_old_velocity(bars, v_old_bar, over, v_old):
    """Return the `NodeBars` plus those of v_old_i = m_i v_i/m_i (FLIP)."""
    mv = v_old_bar * over[..., None]
    return NodeBars(bars.m - np.einsum("...a,...a->...", mv, v_old), bars.mv + mv, bars.f)


def force_weight(ip, D):
    """Return a_ip (N, S, d) of f_i = -sum_p V0_p tau_p a_ip: dw_ip, or in MLS-MPM w_ip r_ip/D.

    D [m^2] is None for the other transfers.
    """
    return ip.dw if D is None else ip.w[..., None] * ip.r * (1 / D)


def force_weight_adjoint(ip, D, q):
    """sum_i (da_ip/dx_p)^T q_ip (N, d) of q (N, S, d), with a_ip of `force_weight`."""
    if D is None:
        return np.einsum("psbc,psc->pb", ip.ddw, q)
    along = np.einsum("psc,psc,psb->pb", ip.r, q, ip.dw)
    return (along - np.einsum("ps,psb->pb", ip.w, q)) * (1 / D)


def scatter_adjoint(q, ip, bars, D):
    """Return the `ParticleBars` of `ScatteredFields` q, from the bars of the nodes (N, S, ..)."""
    carried = q.v[:, None] + 0 * ip.r
    if q.C is not None:
        carried = carried + np.einsum("pab,psb->psa", q.C, ip.r)
    phi = bars.m + np.einsum("psa,psa->ps", bars.mv, carried)
    if q.b is not None:
        phi = phi + np.einsum("psa,pa->ps", bars.f, q.b)
    mv, f = (np.einsum("ps,psa->pa", ip.w, a) for a in (bars.mv, bars.f))
    T = np.einsum("psa,psb->pab", bars.f, force_weight(ip, D))
    x = q.m[:, None] * np.einsum("ps,psb->pb", phi, ip.dw)
    if q.C is not None:
        x = x - np.einsum("p,pab,pa->pb", q.m, q.C, mv)
    x = x - q.V0[:, None] * force_weight_adjoint(ip, D, np.einsum("pac,psa->psc", q.tau, bars.f))
    C = None if q.C is None else np.einsum("p,ps,psa,psb->pab", q.m, ip.w, bars.mv, ip.r)
    return ParticleBars(x, q.m[:, None] * mv, C, -(q.V0[:, None, None] * T),
                       np.einsum("ps,ps->p", ip.w, phi), -np.einsum("pab,pab->p", q.tau, T),
                       None if q.b is None else q.m[:, None] * f)


def trial_adjoint(G, F, bar, dt):
    """Return the bars of F and L (N, d, d) of F' = G F with G = I + dt L."""
    return np.einsum("pba,pbc->pac", G, bar), dt * np.einsum("pab,pcb->pac", bar, F)


def volume_adjoint(G, J, bar, dt):
    """Return the bars of J (N,) and L (N, d, d) of J' = det(G) J with G = I + dt L."""
    cof = cofactor(G)
    det = np.einsum("pa,pa->p", G[:, 0], cof[:, 0])
    return bar * det, dt * (bar * J)[:, None, None] * cof


def cofactor(G):
    """cof G = det(G) G^-T (N, d, d), with the permutation symbol."""
    e = PERMUTATION[G.shape[1]]
    if e.ndim == 2:
        return np.einsum("ab,cd,pbd->pac", e, e, G)
    return 0.5 * np.einsum("abc,def,pbe,pcf->pad", e, e, G, G)


def mls_moment(method):
    """Return D [m^2] of the force of MLS-MPM, None for transfers whose force uses dw_ip."""
    return transfer.moment(method.dx, method.degree) if method.transfer == "mls" else None
