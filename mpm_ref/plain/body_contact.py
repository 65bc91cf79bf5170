"""Contact of two bodies with a velocity field each, at the nodes that both reach.

Each body fills a share phi of the space around a node, whose gradient G points into the body. The
normal from body 1 to body 2 is along G_2 - G_1. Two flat bodies that touch fill all space; a gap of
width g leaves about g |G_2 - G_1|/2 free. A step may close the gap, not more: seen from the common
centre of mass, the bodies lose the rest of their approach, and friction slows their sliding by at
most mu times that.
"""

import numpy as np

from .transfer import sum_to_nodes


def volume_share(V, ip, box, dx):
    """Return phi_i = sum_p w_ip V_p/dx^d and its gradient G_i = -sum_p V_p dw_ip/dx^d [1/m].

    V (N,) [m^d] is the volume of the particles as they are; arrays over the `NodeBox` box.
    """
    share = V / dx ** ip.node.shape[-1]
    return (sum_to_nodes(ip.w * share[:, None], ip, box),
            sum_to_nodes(-ip.dw * share[:, None, None], ip, box))


def normal_and_gap(phi, G):
    """Return the normal (d,) from body 1 to body 2 at one node and the width of the gap [m].

    phi are the shares of both bodies there, G their gradients (d,).
    """
    difference = G[1] - G[0]
    slope = np.sqrt(difference @ difference)
    if slope == 0:
        return difference, 0.0
    return difference / slope, 2 * (1 - phi[0] - phi[1]) / slope


def velocities_after(m, v, n, gap_speed, mu):
    """Return the velocities of both bodies at one node after contact.

    m and v are their masses [kg] and velocities (d,) [m/s], n the normal from body 1 to body 2,
    gap_speed [m/s] that with which the gap would close in the step, mu the coefficient of friction.
    """
    total = m[0] + m[1]
    mean = (m[0] * v[0] + m[1] * v[1]) / total
    closing = n @ (v[0] - v[1])
    lost = closing - max(gap_speed, 0)
    if not lost > 0:
        return list(v)
    sliding = v[0] - v[1] - closing * n
    speed = np.sqrt(sliding @ sliding)
    kept = 0.0 if speed <= mu * lost else 1 - mu * lost / speed
    relative = (closing - lost) * n + kept * sliding
    return [mean + m[1] / total * relative, mean - m[0] / total * relative]


def touching_velocities(m, v, shares, mu, dt):
    """Return the velocities of both fields over their box after contact.

    m, v: masses (..) [kg] and velocities (.., d) [m/s] of both fields over one `NodeBox`; shares:
    (phi, G) of both, see `volume_share`; dt: length of the step [s].
    """
    after = [u.copy() for u in v]
    for node in zip(*np.nonzero((m[0] > 0) & (m[1] > 0)), strict=True):
        n, gap = normal_and_gap(*([share[k][node] for share in shares] for k in range(2)))
        pair = velocities_after([a[node] for a in m], [u[node] for u in v], n, gap / dt, mu)
        for u, new in zip(after, pair, strict=True):
            u[node] = new
    return after
