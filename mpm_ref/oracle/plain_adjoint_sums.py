"""The sums of the adjoint of a step, as those of the step in `plain.transfer`.

A bar is the gradient of a loss by the field of the same name; i is a node, p a particle, ip a pair.
"""

from math import prod
from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.spline import bspline, slope

PERMUTED = {2: np.array([[0, 1], [-1, 0]]), 3: np.zeros((3, 3, 3), int)}    # Levi-Civita
for _k in range(3):
    PERMUTED[3][_k, (_k + 1) % 3, (_k + 2) % 3] = 1
    PERMUTED[3][_k, (_k + 2) % 3, (_k + 1) % 3] = -1


class GatherBars(NamedTuple):
    """Bars of what g2p gathers for one body; None for what it does not."""

    u: np.ndarray       # (N, d)     of sum_i w_ip v_i
    B: np.ndarray       # (N, d, d)  of sum_i w_ip v_i r_ip^T
    L: np.ndarray       # (N, d, d)  of sum_i v_i dw_ip^T
    lag: np.ndarray       # (N, d)     of -sum_i w_ip v_old_i (FLIP)


class ScatteredFields(NamedTuple):
    """What p2g scatters of one body; None for what it does not carry."""

    m: np.ndarray       # (N,)
    V0: np.ndarray       # (N,)
    v: np.ndarray       # (N, d)
    C: np.ndarray       # (N, d, d)
    tau: np.ndarray       # (N, d, d)
    b: np.ndarray       # (N, d)


class NodeBars(NamedTuple):
    """Bars of nodes: of mass, momentum and force."""

    m: np.ndarray
    mv: np.ndarray
    f: np.ndarray


class ParticleBars(NamedTuple):
    """Bars of one body that p2g's adjoint gathers; None for what is not carried."""

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
    """Return the `CurvedPairs` of the pairs `ip`: ddw = d2 w_ip/dx_p^2."""
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


def spread(bar, ip):
    """U_ip = u_p + B_p r_ip (N, S, d), or (N, 1, d) where B is not carried."""
    U = bar.u[:, None]
    return U if bar.B is None else U + np.einsum("pab,psb->psa", bar.B, ip.r)


def velocities(bar, ip, box):
    """v_i = sum_p w_ip U_ip + L_p dw_ip."""
    q = ip.w[..., None] * spread(bar, ip)
    if bar.L is not None:
        q = q + np.einsum("pab,psb->psa", bar.L, ip.dw)
    return transfer.sum_to_nodes(q, ip, box)


def old_velocities(bar, ip, box):
    """v_old_i = -sum_p w_ip lag_p (FLIP)."""
    return transfer.sum_to_nodes(-(ip.w[..., None] * bar.lag[:, None]), ip, box)


def positions(bar, ip, v, v_old):
    """x_p = sum_i (v_i . U_ip - v_old_i . lag_p) dw_ip - w_ip B_p^T v_i + ddw_ip L_p^T v_i, for the
    velocities v_i and v_old_i (or None) of the nodes of the pairs (N, S, d).
    """
    U = spread(bar, ip) + 0 * ip.r
    along = np.einsum("psa,psa->ps", v, U)
    if v_old is not None:
        along = along - np.einsum("psa,pa->ps", v_old, bar.lag)
    x = np.einsum("ps,psb->pb", along, ip.dw)
    if bar.B is not None:
        x = x - np.einsum("ps,pab,psa->pb", ip.w, bar.B, v)
    if bar.L is not None:
        x = x + np.einsum("psbc,pac,psa->pb", ip.ddw, bar.L, v)
    return x


def updated(v_bar, over, v, dt):
    """`NodeBars` of v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g: over is 1/(m_i + eps), v the new
    velocity without dt g.
    """
    mv = v_bar * over[..., None]
    return NodeBars(-np.einsum("...a,...a->...", mv, v), mv, dt * mv)


def with_old(of, v_old_bar, over, v_old):
    """`NodeBars` with those of v_old_i = m_i v_i/m_i (FLIP)."""
    mv = v_old_bar * over[..., None]
    return NodeBars(of.m - np.einsum("...a,...a->...", mv, v_old), of.mv + mv, of.f)


def lever(ip, D):
    """a_ip of f_i = -sum_p V0_p tau_p a_ip: dw_ip, or w_ip r_ip/D (MLS); D is None otherwise."""
    return ip.dw if D is None else ip.w[..., None] * ip.r * (1 / D)


def levered(ip, D, q):
    """sum_i (da_ip/dx_p)^T q_ip of q (N, S, d)."""
    if D is None:
        return np.einsum("psbc,psc->pb", ip.ddw, q)
    along = np.einsum("psc,psc,psb->pb", ip.r, q, ip.dw)
    return (along - np.einsum("ps,psb->pb", ip.w, q)) * (1 / D)


def scattered(q, ip, bars, D):
    """`ParticleBars` of what p2g scattered, from the bars of the nodes of the pairs (N, S, ..)."""
    carried = q.v[:, None] + 0 * ip.r
    if q.C is not None:
        carried = carried + np.einsum("pab,psb->psa", q.C, ip.r)
    phi = bars.m + np.einsum("psa,psa->ps", bars.mv, carried)
    if q.b is not None:
        phi = phi + np.einsum("psa,pa->ps", bars.f, q.b)
    mv, f = (np.einsum("ps,psa->pa", ip.w, a) for a in (bars.mv, bars.f))
    T = np.einsum("psa,psb->pab", bars.f, lever(ip, D))
    x = q.m[:, None] * np.einsum("ps,psb->pb", phi, ip.dw)
    if q.C is not None:
        x = x - np.einsum("p,pab,pa->pb", q.m, q.C, mv)
    x = x - q.V0[:, None] * levered(ip, D, np.einsum("pac,psa->psc", q.tau, bars.f))
    C = None if q.C is None else np.einsum("p,ps,psa,psb->pab", q.m, ip.w, bars.mv, ip.r)
    return ParticleBars(x, q.m[:, None] * mv, C, -(q.V0[:, None, None] * T),
                       np.einsum("ps,ps->p", ip.w, phi), -np.einsum("pab,pab->p", q.tau, T),
                       None if q.b is None else q.m[:, None] * f)


def grown(G, F, bar, dt):
    """Bars of F and L of F' = G F, G = I + dt L."""
    return np.einsum("pba,pbc->pac", G, bar), dt * np.einsum("pab,pcb->pac", bar, F)


def swollen(G, J, bar, dt):
    """Bars of J and L of J' = det(G) J."""
    cof = cofactor(G)
    det = np.einsum("pa,pa->p", G[:, 0], cof[:, 0])
    return bar * det, dt * (bar * J)[:, None, None] * cof


def cofactor(G):
    """cof G = det(G) G^-T (N, d, d)."""
    e = PERMUTED[G.shape[1]]
    if e.ndim == 2:
        return np.einsum("ab,cd,pbd->pac", e, e, G)
    return 0.5 * np.einsum("abc,def,pbe,pcf->pad", e, e, G, G)


def moment(method):
    """D of the MLS form [m^2], None for the gradient form."""
    return transfer.moment(method.dx, method.degree) if method.transfer == "mls" else None
