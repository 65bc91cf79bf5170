"""The transfers of a step of MPM in Warp, as its users would write them.

Functions and kernels are generic: Warp compiles them for 2D and 3D, in single and double precision.
Arguments are the structs of `warp_stages`: particles q, nodes, which lie in one row, the last axis
fastest, and constants k.
"""

from typing import Any

import warp as wp


@wp.func
def spline(s: Any):
    """Return the quadratic B-spline at a distance of s cells."""
    t = wp.abs(s)
    if t < type(s)(0.5):
        return type(s)(0.75) - t * t
    return type(s)(0.5) * (type(s)(1.5) - t) * (type(s)(1.5) - t)


@wp.func
def slope(s: Any):
    """Return the derivative of the quadratic B-spline."""
    if wp.abs(s) < type(s)(0.5):
        return type(s)(-2.0) * s
    return s - type(s)(1.5) * wp.sign(s)


@wp.func
def first_node(x: Any, dx: Any):
    """Return the first node that a particle reaches along an axis."""
    return int(wp.floor(x / dx - type(x)(0.5)))


@wp.func
def arm(x: Any, o: int, k: Any):
    """Return x_i - x_p of the o-th node of a particle's stencil."""
    r = type(x)()
    for a in range(len(x)):
        r[a] = x.dtype(first_node(x[a], k.dx) + k.offset[o, a]) * k.dx - x[a]
    return r


@wp.func
def node(x: Any, o: int, k: Any):
    """Return the place in the row of nodes of the o-th node of a stencil."""
    i = first_node(x[0], k.dx) + k.offset[o, 0]
    for a in range(1, len(x)):
        i = i * k.n + first_node(x[a], k.dx) + k.offset[o, a]
    return i


@wp.func
def weight(r: Any, k: Any):
    """Return the weight w_ip of a node at the arm r from a particle."""
    w = r.dtype(1.0)
    for a in range(len(r)):
        w *= spline(r[a] / k.dx)
    return w


@wp.func
def gradient(r: Any, k: Any):
    """Return the gradient of w_ip by x_p; in MLS-MPM w_ip r/D stands in its place."""
    if k.mls:
        return r * (weight(r, k) * r.dtype(4.0) / (k.dx * k.dx))
    g = type(r)()
    for a in range(len(r)):
        along = -slope(r[a] / k.dx) / k.dx
        for b in range(len(r)):
            if b != a:
                along *= spline(r[b] / k.dx)
        g[a] = along
    return g


# a step

@wp.kernel
def p2g(q: Any, nodes: Any, k: Any):
    """Scatter mass, momentum and internal force."""
    p = wp.tid()
    x = q.x[p]
    for o in range(k.offset.shape[0]):
        r = arm(x, o, k)
        w = weight(r, k)
        i = node(x, o, k)
        q.w[p, o] = w
        wp.atomic_add(nodes.m, i, w * q.m[p])
        wp.atomic_add(nodes.mv, i, w * q.m[p] * (q.v[p] + q.C[p] * r))
        wp.atomic_add(nodes.f, i, -q.V0[p] * (q.tau[p] * gradient(r, k)))


@wp.kernel
def accelerate(nodes: Any, k: Any):
    """Compute the velocities of the nodes with forces and gravity."""
    i = wp.tid()
    m = nodes.m[i]
    if m > type(m)(0.0):
        nodes.v_free[i] = (nodes.mv[i] + k.dt * nodes.f[i]) / m + k.dt * k.gravity[0]


@wp.kernel
def touch(nodes: Any, k: Any):
    """Stop what enters the floor, with Coulomb friction."""
    i = wp.tid()
    u = nodes.v_free[i]
    zero = u.dtype(0.0)
    approach = wp.dot(u, k.normal)
    if nodes.solid[i] and approach < zero:
        along = u - approach * k.normal
        speed = wp.length(along)
        lost = -k.friction * approach
        if speed > lost:
            nodes.v[i] = along * (u.dtype(1.0) - lost / speed)
        else:
            nodes.v[i] = type(u)()
    else:
        nodes.v[i] = u


@wp.kernel
def g2p(q: Any, nodes: Any, after: Any, k: Any):
    """Gather velocity, affine field and velocity gradient, and move the particles."""
    p = wp.tid()
    x = q.x[p]
    C = q.C[p]
    v = type(x)()
    B = type(C)()
    L = type(C)()
    for o in range(k.offset.shape[0]):
        r = arm(x, o, k)
        u = nodes.v[node(x, o, k)]
        v += weight(r, k) * u
        B += wp.outer(weight(r, k) * u, r)
        L += wp.outer(u, gradient(r, k))
    after.v[p] = v
    after.x[p] = x + k.dt * v
    after.C[p] = x.dtype(4.0) / (k.dx * k.dx) * B
    after.L[p] = L
