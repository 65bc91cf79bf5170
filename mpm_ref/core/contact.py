"""The condition at one node that lies in one or more colliders.

Collider k has the outward normal n_k and moves with velocity v_k at the node. With u the node's
velocity and a_k = n_k . (u - v_k):

    prescribed  u = v_k, and nothing else at this node counts
    sticky      u = v_k
    noslip      u = v_k if a_k < 0 to begin with, else a_k >= 0
    slip        a_k = 0
    separate    a_k >= 0

Of all velocities that its colliders allow, the node takes the one nearest to its own. That is the
projection on a polyhedron, hence on the planes of at most d of its faces: the nearest of the
projections on one, two or three planes that all colliders allow, exact for planes at any angle.

Friction is Coulomb's, as in [Stomakhin2013], section 8, extended to several planes. The change of
velocity is u - v = sum_k l_k n_k over the planes that bear it. The part of u relative to these
planes that is tangential to all of them is shortened by sum_k mu_k |l_k|, at most to zero.
"""

from typing import NamedTuple

import numpy as np

from .jit import kernel, leaf
from .tensor import dot, fill, lin, norm, put_vec, vec

PRESCRIBED, STICKY, NOSLIP, SLIP, SEPARATE = range(5)

PARALLEL = 1e-10     # sine of an angle: a normal this near to the span of others lies in it
ROUNDING = 1e-9      # of the speeds at the node: how well a plane in the span of others is met
ESCAPE = 10.0        # of the relative speeds: a node that would have to be faster is squeezed


class Contacts(NamedTuple):
    """Pairs of a node and a collider that it is in, sorted by node: K pairs, P colliders."""

    node: np.ndarray    # (K,)    which node
    part: np.ndarray    # (K,)    which collider
    n: np.ndarray       # (K, d)  outward unit normal
    v: np.ndarray       # (K, d)  velocity of the collider at the node [m/s]
    dv: np.ndarray      # (K, d)  change of the node's velocity by the collider [m/s]; zero on entry
    kind: np.ndarray    # (P,)    PRESCRIBED .. SEPARATE
    mu: np.ndarray      # (P,)    coefficient of friction


@kernel
def approach(contacts, k, u):
    """a_k = n_k . (u - v_k), negative towards the collider."""
    return dot(vec(contacts.n, k, u), lin(1.0, u, -1.0, vec(contacts.v, k, u)))


@kernel
def meet(contacts, pairs, v):
    """Velocity of a node in the colliders pairs[0] .. pairs[1] - 1, where v is that without them.

    What each collider changes is stored in contacts.dv. A node that colliders squeeze, so that no
    velocity suits all, or only one ESCAPE times theirs, moves with their mean velocity.
    """
    if pairs[1] - pairs[0] == 1 and contacts.kind[contacts.part[pairs[0]]] >= SLIP:
        return meet_plane(contacts, pairs[0], v)
    r = strongest(contacts, pairs, v)
    if r <= STICKY:
        return hold(contacts, pairs, v, r)
    found, planes = nearest(contacts, pairs, v)
    if not found:
        return hold(contacts, pairs, v, SEPARATE)
    u, basis, _ = projected(contacts, planes, v)
    return rub(contacts, planes, u, v, basis)


@leaf
def meet_plane(contacts, k, v):
    """`meet` for a node in one collider, of the kind slip or separate."""
    n, v_c, part = vec(contacts.n, k, v), vec(contacts.v, k, v), contacts.part[k]
    a = dot(n, lin(1.0, v, -1.0, v_c))
    if not (a < 0.0 or (a > 0.0 and contacts.kind[part] == SLIP)):
        return v
    size = norm(n)
    e = lin(1.0 / size, n, 0.0, n)
    u = lin(1.0, v, -a / dot(n, e), e)
    l = dot(lin(1.0, u, -1.0, v), n) / dot(n, n)
    dv, grip = lin(l, n, 0.0, n), contacts.mu[part] * abs(l)
    if grip > 0.0:
        t = lin(1.0, u, -1.0, v_c)
        t = lin(1.0, t, -dot(t, e), e)
        slide = norm(t)
        lost = grip / slide if grip < slide else 1.0
        u, dv = lin(1.0, u, -lost, t), lin(1.0, dv, -lost, t)
    put_vec(contacts.dv, k, dv)
    return u


# colliders that hold the node

@kernel
def rank(contacts, k, v):
    """The kind of a collider, where noslip means sticky or separate: the smallest counts."""
    kind = contacts.kind[contacts.part[k]]
    if kind == NOSLIP:
        return STICKY if approach(contacts, k, v) < 0.0 else SEPARATE
    return kind


@kernel
def strongest(contacts, pairs, v):
    """Smallest rank of the pairs."""
    r = SEPARATE
    for k in range(pairs[0], pairs[1]):
        r = min(r, rank(contacts, k, v))
    return r


@kernel
def hold(contacts, pairs, v, r):
    """Mean velocity of the colliders of rank r or less, which share the change equally."""
    count, u = 0, fill(0.0, v)
    for k in range(pairs[0], pairs[1]):
        if rank(contacts, k, v) <= r:
            count, u = count + 1, lin(1.0, u, 1.0, vec(contacts.v, k, v))
    for k in range(pairs[0], pairs[1]):
        if rank(contacts, k, v) <= r:
            put_vec(contacts.dv, k, lin(1.0 / count, vec(contacts.v, k, v), -1.0 / count, v))
    return lin(1.0 / count, u, 0.0, u)


# projections: planes are three pairs, -1 for none; a basis is three orthonormal vectors, or zeros

@kernel
def rest(n, basis):
    """n without its components along the basis."""
    p, q, r = basis
    return lin(1.0, lin(1.0, n, -dot(n, p), p), -1.0, lin(dot(n, q), q, dot(n, r), r))


@kernel
def extended(basis, e):
    """The basis with one more vector."""
    return e, basis[0], basis[1]


@kernel
def projected(contacts, planes, v):
    """Velocity nearest to v on all the planes, basis of their normals, are they independent."""
    zero = fill(0.0, v)
    u, basis = v, (zero, zero, zero)
    for k in planes:
        if k >= 0:
            n = vec(contacts.n, k, v)
            e = rest(rest(n, basis), basis)      # twice: then orthogonal to round-off
            size = norm(e)
            if not size > PARALLEL:
                return u, basis, False
            e = lin(1.0 / size, e, 0.0, e)
            u = lin(1.0, u, -approach(contacts, k, u) / dot(n, e), e)
            basis = extended(basis, e)
    return u, basis, True


@kernel
def allowed(contacts, pairs, planes, u, basis, speed):
    """Return whether u, on the planes, suits all other colliders. NaN does, to stay visible."""
    for k in range(pairs[0], pairs[1]):
        if k != planes[0] and k != planes[1] and k != planes[2]:
            a, slack = approach(contacts, k, u), 0.0
            if norm(rest(vec(contacts.n, k, u), basis)) <= PARALLEL:
                slack = ROUNDING * (speed + norm(vec(contacts.v, k, u)))
            if a < -slack or (a > slack and contacts.kind[contacts.part[k]] == SLIP):
                return False
    return True


@kernel
def nearer(contacts, pairs, planes, v, best):
    """Change and planes of `best` or, if nearer and allowed, of the projection on `planes`."""
    u, basis, independent = projected(contacts, planes, v)
    change = norm(lin(1.0, u, -1.0, v))
    if not (independent and change < best[0]):
        return best
    if not allowed(contacts, pairs, planes, u, basis, norm(u) + norm(v)):
        return best
    return change, planes


@kernel
def nearest(contacts, pairs, v):
    """Return whether there is an allowed velocity, and the planes of the smallest change to one."""
    zero, none = fill(0.0, v), (-1, -1, -1)
    if allowed(contacts, pairs, none, v, (zero, zero, zero), 0.0):
        return True, none
    limit = 0.0
    for i in range(pairs[0], pairs[1]):
        limit += ESCAPE * norm(lin(1.0, v, -1.0, vec(contacts.v, i, v)))
    best, out = (limit, none), pairs[0] - 1
    for i in range(pairs[0], pairs[1]):
        for j in range(out, i):
            for k in range(out, max(j, out + 1)):
                planes = (i, j if j > out else -1, k if k > out else -1)
                best = nearer(contacts, pairs, planes, v, best)
    return best[1][0] >= 0, best[1]


# friction

@kernel
def load(contacts, k, planes, change):
    """l_k of change = sum_k l_k n_k over the planes."""
    zero = fill(0.0, change)
    others = (zero, zero, zero)
    for j in planes:
        if j >= 0 and j != k:
            e = rest(vec(contacts.n, j, change), others)
            others = extended(others, lin(1.0 / norm(e), e, 0.0, e))
    n = vec(contacts.n, k, change)
    e = rest(rest(n, others), others)
    return dot(change, e) / dot(n, e)


@kernel
def rub(contacts, planes, u, v, basis):
    """u with friction on the planes that bear the change from v to u."""
    grip, drift = 0.0, fill(0.0, v)
    for k in planes:
        if k >= 0:
            l = load(contacts, k, planes, lin(1.0, u, -1.0, v))
            w = contacts.mu[contacts.part[k]] * abs(l)
            n = vec(contacts.n, k, v)
            put_vec(contacts.dv, k, lin(l, n, 0.0, n))
            grip, drift = grip + w, lin(1.0, drift, w, vec(contacts.v, k, v))
    if grip == 0.0:
        return u
    t = rest(lin(1.0, u, -1.0 / grip, drift), basis)
    lost = grip / norm(t) if grip < norm(t) else 1.0
    for k in planes:
        if k >= 0:
            dv = vec(contacts.dv, k, v)
            w = contacts.mu[contacts.part[k]] * norm(dv)
            put_vec(contacts.dv, k, lin(1.0, dv, -lost * w / grip, t))
    return lin(1.0, u, -lost, t)
