"""How much round-off each entry of a stage may carry, in any order of additions.

The scale S of an entry is the first-order bound of its error per unit of round-off: an evaluation
in a precision with unit eps is off by a small multiple of eps S. Sums take the sum of the sizes of
their terms and of what their factors pass on; functions of F take their differences. What enters a
step (x, v, C, F) has its own size for a scale, and what the reference measured of its error.

There is one number for each pair, node or particle, in the norm of the vector or matrix there.
"""

from typing import NamedTuple

import numpy as np

from ..plain import transfer
from ..plain.flows import project
from ..plain.laws import energy
from ..plain.spline import bspline, slope
from ..plain.step import stress

NEAR = 2.0**-20       # cells: slopes are taken at their largest within this distance
STEP = 2.0**-20       # of the differences, in units of the scale of F,
LARGEST = 2.0**-12    # and at most, in units of F
CURVATURE = 2         # largest second derivative of the splines, per cell^2


class Weights(NamedTuple):
    """Scales of the pairs of one body, (N, S) each; and their sizes."""

    w: np.ndarray
    dw: np.ndarray
    r: np.ndarray
    size_dw: np.ndarray
    size_r: np.ndarray


def size(a, first=1):
    """Norm over all axes from `first` on."""
    return np.sqrt((a * a).sum(axis=tuple(range(first, a.ndim))))


def weights(ip, method, x):
    """Scales of w, dw and r, for positions with the scale x (N,) [m]."""
    degree, half = method.degree, (method.degree + 1) / method.dx.dtype.type(2)
    u = -ip.r / method.dx + half
    S_u = 1 + x[:, None, None] / method.dx + 0 * u
    n, dn = bspline(u, degree), abs(slope(u, degree))
    steep = np.maximum(dn, np.maximum(abs(slope(u - NEAR, degree)), abs(slope(u + NEAR, degree))))
    S_n, S_dn = n + S_u * steep, dn + CURVATURE * S_u
    d = u.shape[2]
    S_w = sum(others(n, a) * S_n[..., a] for a in range(d))
    S_dw = sum(others(n, a) * S_dn[..., a] + bent(n, S_n, dn, a) for a in range(d)) / method.dx
    S_r = method.dx * size(S_u, 2)
    return Weights(S_w, S_dw, S_r, size(ip.dw, 2), size(ip.r, 2))


def others(n, a):
    """Product of the factors of all axes but a."""
    return np.prod(np.delete(n, a, axis=-1), axis=-1)


def bent(n, S_n, dn, a):
    """Change of dn_a prod_(b != a) n_b by that of the n_b."""
    d = n.shape[-1]
    rest = [np.prod(np.delete(n, (a, b), axis=-1), axis=-1) * S_n[..., b]
            for b in range(d) if b != a]
    return dn[..., a] * sum(rest)


class Inputs(NamedTuple):
    """Scales of what enters the step, (N,) each; C is 0 where it is not carried."""

    x: np.ndarray
    v: np.ndarray
    C: np.ndarray
    F: np.ndarray
    tau: np.ndarray


def inputs(q, errors, eps):
    """Scales of a body's state: the size of its entries, and the errors measured so far over eps.

    errors has the largest error of x, v, C and F.
    """
    fields = {"x": q.x, "v": q.v, "C": 0 * q.m if q.C is None else q.C, "F": q.F}
    S = {name: size(a[:, None]) + errors.get(name, 0) / eps for name, a in fields.items()}
    tau, = through(lambda F: [stress(F, q.y, q)], q.F, S["F"])
    return Inputs(**S, tau=tau)


def to_grid(q, ip, box, method, S, W):
    """Scales of mass, momentum and force from one body, over the box."""
    m, V0 = q.m[:, None], q.V0[:, None]
    v_ip, S_v_ip = size(velocities(q, ip), 2), passed(q, S, W)
    tau, S_tau = size(q.tau[:, None])[:, None], S.tau[:, None]
    mass = m * (W.w + ip.w)
    momentum = m * (W.w * v_ip + ip.w * S_v_ip)
    if method.transfer == "mls":
        arm = W.w * W.size_r + ip.w * W.r
        force = V0 / method.moment * (arm * tau + ip.w * W.size_r * S_tau)
    else:
        force = V0 * (W.dw * tau + W.size_dw * S_tau)
    if q.b is not None:
        force = force + m * (W.w + ip.w) * size(q.b)[:, None]
    return [transfer.sum_to_nodes(a, ip, box) for a in (mass, momentum, force)]


def velocities(q, ip):
    """v_p + C_p r_ip (N, S, d)."""
    spin = 0 if q.C is None else np.einsum("pab,psb->psa", q.C, ip.r)
    return q.v[:, None] + spin + 0 * ip.r


def passed(q, S, W):
    """Scales of v_p + C_p r_ip."""
    C = 0 * q.m if q.C is None else size(q.C)
    v, S_v, C, S_C = (a[:, None] for a in (size(q.v), S.v, C, S.C))
    return v + S_v + (S_C + C) * W.size_r + C * W.r


def swing(q, ip, box, v_i, S_W):
    """Scale of m_i times sum_p w_ip m_p (v_p + C_p r_ip)/m_i, from one body, over the box.

    An error of w_ip counts only where v_ip is not v_i: nodes with little mass are no worse.
    """
    S, W = S_W
    apart = size(velocities(q, ip) - v_i[transfer.at(ip, box)], 2)
    return transfer.sum_to_nodes(q.m[:, None] * (W.w * apart + ip.w * passed(q, S, W)), ip, box)


def velocity(nodes, S, gravity, dt, m):
    """Scale of the nodal velocities before boundary conditions; m is the mass to divide by.

    S has the scales of mass and force, and `swing` for that of m times the velocity before forces.
    """
    pushed = dt * (S["force"] + size(nodes.f, nodes.m.ndim) / m * S["mass"])
    return np.where(nodes.m > 0, (S["swing"] + pushed) / m + dt * size(gravity, 0), 0)


def held(nodes, S_v, contacts):
    """Scale after boundary conditions: projections and friction pass errors on, up to a factor."""
    out = S_v.copy()
    for i, at_node in contacts.items():
        speeds = sum(np.sqrt(c.v @ c.v) for c in at_node)
        rubbing = 1 + sum(c.mu for c in at_node)
        out[i] = 2 * rubbing * (out[i] + size(nodes.v_free[i], 0) + speeds)
    return out


def gathered(v, S_v, ip, W):
    """Scale of sum_i w_ip v_i, for sizes v and scales S_v of the nodes of the pairs."""
    return (ip.w * S_v + (W.w + ip.w) * v).sum(axis=1)


def gradient(v, S_v, W):
    """Scale of sum_i v_i dw_ip^T."""
    return (W.size_dw * (S_v + v) + W.dw * v).sum(axis=1)


def affine(v, S_v, ip, W):
    """Scale of sum_i w_ip v_i r_ip^T."""
    return (ip.w * W.size_r * (S_v + v) + (W.w * W.size_r + ip.w * W.r) * v).sum(axis=1)


def through(function, F, S_F):
    """Scales of the results of `function` (arrays over particles) at F with the scale S_F (N,).

    S_F sum_kl |f(F + h E_kl) - f(F)| / h over steps h of both signs in each entry of F: a return
    map may have a kink right here.
    """
    here, h = function(F), np.minimum(STEP * S_F, LARGEST * size(F[:, None]))
    total = [size(a[:, None]) for a in here]
    for k in np.ndindex(F.shape[1:]):
        for sign in (1, -1):
            moved = F.copy()
            moved[(slice(None), *k)] += sign * h
            changes = zip(total, function(moved), here)
            total = [s + size((a - b)[:, None]) / h * S_F for s, a, b in changes]
    return total


def deformation(q, F_trial, S_F, dt):
    """Scales of F, tau, psi and, where it is carried, y after the return map.

    That of tau allows for a code that computes it from the stored F, where a map may have ended on
    a corner of its surface at which the stress of the trial state no longer counts.
    """
    def new(F):
        F, y = project(F, q.y, dt, q.law, q.flow)
        carried = [] if y is None else [y]
        return [F, stress(F, y, q), energy(F, q.law), *carried]

    F, *_ = new(F_trial)
    S_F, S_tau, S_psi, *S_y = through(new, F_trial, S_F)
    again, = through(lambda F: [stress(F, q.y, q)], F, size(F[:, None]))
    return S_F, S_tau + again, S_psi + S_tau + again, *S_y


def energies(q, method, gravity, S, S_psi):
    """Scales of kinetic, elastic and gravitational energy, (3,); S has those of v, x and C."""
    v, x = size(q.v), size(q.x)
    kinetic = q.m * v * (v + S["v"])
    if q.C is not None:
        kinetic = kinetic + method.moment * q.m * size(q.C) * (size(q.C) + S["C"])
    height = q.m * size(gravity, 0) * (x + S["x"])
    return np.stack([kinetic.sum(), (q.V0 * S_psi).sum(), height.sum()])
