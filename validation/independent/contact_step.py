"""Two bodies in 2D that touch: MLS-MPM with a velocity field for each, and Coulomb's friction.

Each body gives the nodes its mass m and, with its forces and gravity, its velocity v (NCLAW-mls).
From the volumes V_p = V0_p det F_p come the share of space that it fills at a node, and the
gradient of that share,

    phi = sum_p w_ip V_p/dx^2,          G = d phi/d x_i,

the normal from body 1 to body 2, and the gap between them:

    n = (G_2 - G_1)/|G_2 - G_1|,        gap = 2 (1 - phi_1 - phi_2)/|G_2 - G_1|

Where both have mass and |G_2 - G_1| dx >= 0.001, the relative velocity u = v_1 - v_2 has to obey
n . u <= max(gap, 0)/dt. An impulse along n removes the excess, and one along the tangent, at most
`friction` times as large, slows the sliding or ends it. Each body then gathers from its own field.
A body is a dictionary of its x (N, 2) [m], v (N, 2) [m/s], C (N, 2, 2) [1/s], F (N, 2, 2),
m (N,) [kg], V0 (N,) [m^2], and Lame's mu and lam [Pa].
"""

import numpy as np
from scipy.interpolate import BSpline

SPLINE = BSpline.basis_element(np.arange(4) - 1.5, extrapolate=False)


def stencil(x, dx, count):
    """Return the weights (N, n) at x (N, 2), their gradients in x, and r_ip, both (N, n, 2).

    Node (j, k) of count x count lies at (j, k) dx and is column j count + k.
    """
    s = x[:, None] / dx - np.arange(count)[:, None]
    w, dw = np.nan_to_num(SPLINE(s)), np.nan_to_num(SPLINE.derivative()(s)) / dx
    W, *dW = (np.einsum("pj,pk->pjk", a[..., 0], b[..., 1]).reshape(len(x), -1)
              for a, b in ((w, w), (dw, w), (w, dw)))
    return W, np.stack(dW, axis=2), np.indices((count, count)).reshape(2, -1).T * dx - x[:, None]


def scattered(body, g, dx, dt, count):
    """Return m (n,), v (n, 2), phi (n,) and G (n, 2) of a body at the nodes."""
    F, m, V0 = body["F"], body["m"], body["V0"]
    W, dW, r = stencil(body["x"], dx, count)
    J = np.linalg.det(F)
    U, _, Vt = np.linalg.svd(F)
    tau = (2 * body["mu"] * (F - U @ Vt) @ F.swapaxes(1, 2)
           + (body["lam"] * (J - 1) * J)[:, None, None] * np.eye(2))            # (NSF-eq12)
    slope = m[:, None, None] * body["C"] - dt * 4 / dx**2 * V0[:, None, None] * tau
    momentum = W.T @ (m[:, None] * body["v"]) + np.einsum("pi,pab,pib->ia", W, slope, r)
    m_i = W.T @ m
    v = np.divide(momentum, m_i[:, None], out=np.zeros_like(momentum), where=m_i[:, None] > 0)
    share = J * V0 / dx**2
    return m_i, v + dt * g, share @ W, -np.einsum("p,pia->ia", share, dW)


def touch(one, two, friction, dx, dt):
    """Return the velocities (n, 2) of both bodies at the nodes after contact."""
    (m1, v1, phi1, G1), (m2, v2, phi2, G2) = one, two
    size = np.linalg.norm(G2 - G1, axis=1)
    common = (m1 > 0) & (m2 > 0) & (size * dx >= 1e-3)
    size = np.where(common, size, 1)
    n = (G2 - G1) / size[:, None]
    u = v1 - v2
    normal = (u * n).sum(1)
    closing = np.maximum(2 * (1 - phi1 - phi2) / size, 0) / dt
    excess = np.where(common, np.maximum(normal - closing, 0), 0)
    along = u - normal[:, None] * n
    sliding = np.linalg.norm(along, axis=1)
    rubbed = np.minimum(1, friction * excess / np.where(sliding > 0, sliding, 1))
    change = excess[:, None] * n + rubbed[:, None] * along
    share = (m2 / np.where(common, m1 + m2, 1))[:, None]
    return v1 - share * change, v2 + (1 - share) * change


def step(bodies, *, friction, g, dx, dt, count):
    """Return the two bodies after a step of dt [s] under gravity g (2,) [m/s^2]."""
    fields = [scattered(body, g, dx, dt, count) for body in bodies]
    after = []
    for body, v_i in zip(bodies, touch(*fields, friction, dx, dt), strict=True):
        W, _, r = stencil(body["x"], dx, count)
        v, C = W @ v_i, np.einsum("pi,ia,pib->pab", W, v_i, r) * 4 / dx**2
        after.append({**body, "x": body["x"] + dt * v, "v": v, "C": C,
                      "F": (np.eye(2) + dt * C) @ body["F"]})
    return after
