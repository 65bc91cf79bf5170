"""The sums of the adjoint of a step, for plain arrays and for `Rough` ones, as in `plain.transfer`.

A bar is the gradient of a loss by the field of the same name; i is a node, p a particle, ip a pair.
"""

from typing import Any, NamedTuple

import numpy as np

from ..plain import transfer
from .rough import collected, einsum

PERMUTED = {2: np.array([[0, 1], [-1, 0]]), 3: np.zeros((3, 3, 3), int)}    # Levi-Civita
for _k in range(3):
    PERMUTED[3][_k, (_k + 1) % 3, (_k + 2) % 3] = 1
    PERMUTED[3][_k, (_k + 2) % 3, (_k + 1) % 3] = -1


class Gathered(NamedTuple):
    """Bars of what g2p gathers for one body; None for what it does not."""

    u: Any              # (N, d)     of sum_i w_ip v_i
    B: Any              # (N, d, d)  of sum_i w_ip v_i r_ip^T
    L: Any              # (N, d, d)  of sum_i v_i dw_ip^T
    lag: Any            # (N, d)     of -sum_i w_ip v_old_i (FLIP)


class Scattered(NamedTuple):
    """What p2g scatters of one body; None for what it does not carry."""

    m: Any              # (N,)
    V0: Any             # (N,)
    v: Any              # (N, d)
    C: Any              # (N, d, d)
    tau: Any            # (N, d, d)
    b: Any              # (N, d)


class OfNodes(NamedTuple):
    """Bars of nodes: of mass, momentum and force."""

    m: Any
    mv: Any
    f: Any


class OfParticles(NamedTuple):
    """Bars of one body that p2g's adjoint gathers; None for what is not carried."""

    x: Any
    v: Any
    C: Any
    tau: Any
    m: Any
    V0: Any
    b: Any


def spread(bar, ip):
    """U_ip = u_p + B_p r_ip (N, S, d), or (N, 1, d) where B is not carried."""
    U = bar.u[:, None]
    return U if bar.B is None else U + einsum("pab,psb->psa", bar.B, ip.r)


def velocities(bar, ip, box):
    """v_i = sum_p w_ip U_ip + L_p dw_ip."""
    q = ip.w[..., None] * spread(bar, ip)
    if bar.L is not None:
        q = q + einsum("pab,psb->psa", bar.L, ip.dw)
    return collected(q, ip, box)


def old_velocities(bar, ip, box):
    """v_old_i = -sum_p w_ip lag_p (FLIP)."""
    return collected(-(ip.w[..., None] * bar.lag[:, None]), ip, box)


def positions(bar, ip, v, v_old):
    """x_p = sum_i (v_i . U_ip - v_old_i . lag_p) dw_ip - w_ip B_p^T v_i + ddw_ip L_p^T v_i, for the
    velocities v_i and v_old_i (or None) of the nodes of the pairs (N, S, d).
    """
    U = spread(bar, ip) + 0 * ip.r
    along = einsum("psa,psa->ps", v, U)
    if v_old is not None:
        along = along - einsum("psa,pa->ps", v_old, bar.lag)
    x = einsum("ps,psb->pb", along, ip.dw)
    if bar.B is not None:
        x = x - einsum("ps,pab,psa->pb", ip.w, bar.B, v)
    if bar.L is not None:
        x = x + einsum("psbc,pac,psa->pb", ip.ddw, bar.L, v)
    return x


def updated(v_bar, over, v, dt):
    """`OfNodes` of v_i = (m_i v_i + dt f_i)/(m_i + eps) + dt g: over is 1/(m_i + eps), v the new
    velocity without dt g.
    """
    mv = v_bar * over[..., None]
    return OfNodes(-einsum("...a,...a->...", mv, v), mv, dt * mv)


def with_old(of, v_old_bar, over, v_old):
    """`OfNodes` with those of v_old_i = m_i v_i/m_i (FLIP)."""
    mv = v_old_bar * over[..., None]
    return OfNodes(of.m - einsum("...a,...a->...", mv, v_old), of.mv + mv, of.f)


def lever(ip, D):
    """a_ip of f_i = -sum_p V0_p tau_p a_ip: dw_ip, or w_ip r_ip/D (MLS); D is None otherwise."""
    return ip.dw if D is None else ip.w[..., None] * ip.r * (1 / D)


def levered(ip, D, q):
    """sum_i (da_ip/dx_p)^T q_ip of q (N, S, d)."""
    if D is None:
        return einsum("psbc,psc->pb", ip.ddw, q)
    return (einsum("psc,psc,psb->pb", ip.r, q, ip.dw) - einsum("ps,psb->pb", ip.w, q)) * (1 / D)


def scattered(q, ip, bars, D):
    """`OfParticles` of what p2g scattered, from the bars of the nodes of the pairs (N, S, ..)."""
    carried = q.v[:, None] + 0 * ip.r
    if q.C is not None:
        carried = carried + einsum("pab,psb->psa", q.C, ip.r)
    phi = bars.m + einsum("psa,psa->ps", bars.mv, carried)
    if q.b is not None:
        phi = phi + einsum("psa,pa->ps", bars.f, q.b)
    mv, f = (einsum("ps,psa->pa", ip.w, a) for a in (bars.mv, bars.f))
    T = einsum("psa,psb->pab", bars.f, lever(ip, D))
    x = q.m[:, None] * einsum("ps,psb->pb", phi, ip.dw)
    if q.C is not None:
        x = x - einsum("p,pab,pa->pb", q.m, q.C, mv)
    x = x - q.V0[:, None] * levered(ip, D, einsum("pac,psa->psc", q.tau, bars.f))
    C = None if q.C is None else einsum("p,ps,psa,psb->pab", q.m, ip.w, bars.mv, ip.r)
    return OfParticles(x, q.m[:, None] * mv, C, -(q.V0[:, None, None] * T),
                       einsum("ps,ps->p", ip.w, phi), -einsum("pab,pab->p", q.tau, T),
                       None if q.b is None else q.m[:, None] * f)


def grown(G, F, bar, dt):
    """Bars of F and L of F' = G F, G = I + dt L."""
    return einsum("pba,pbc->pac", G, bar), dt * einsum("pab,pcb->pac", bar, F)


def swollen(G, J, bar, dt):
    """Bars of J and L of J' = det(G) J."""
    cof = cofactor(G)
    det = einsum("pa,pa->p", G[:, 0], cof[:, 0])
    return bar * det, dt * (bar * J)[:, None, None] * cof


def cofactor(G):
    """cof G = det(G) G^-T (N, d, d)."""
    e = PERMUTED[G.shape[1]]
    if e.ndim == 2:
        return einsum("ab,cd,pbd->pac", e, e, G)
    return 0.5 * einsum("abc,def,pbe,pcf->pad", e, e, G, G)


def moment(method):
    """D of the MLS form [m^2], None for the gradient form."""
    return transfer.moment(method.dx, method.degree) if method.transfer == "mls" else None
