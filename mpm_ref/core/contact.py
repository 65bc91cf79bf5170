"""The condition at one node that lies in one or more colliders.

Collider k has an outward normal n_k and moves with v_k at the node. With u the node's velocity and a_k = n_k . (u - v_k):

    sticky      u = v_k
    slip        a_k = 0
    separate    a_k >= 0
    noslip      u = v_k if a_k < 0 to begin with, else a_k >= 0        (NCLaw's second kind of wall)
    prescribed  u = v_k, and nothing else at this node counts

Without friction the node takes the velocity nearest to its own that all its colliders allow. That is the projection on a
polyhedron, hence on the planes of at most d of its faces: of the projections on such sets of planes, the nearest one that all
colliders allow. Projections on several planes are exact for any angle between them, and independent of their order.

Friction follows [Stomakhin2013], section 8, extended to several planes. u - v = sum_k l_k n_k over the planes that carry
load; the velocity relative to them, tangential to all, is shortened by sum_k mu_k |l_k|, at most to zero.
Exact for one plane (Coulomb's law); for an edge of two planes it is Coulomb's law for sliding along the edge.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from .jit import kernel
from .tensor import dot, fill, lin, norm, put_vec, vec

PRESCRIBED, STICKY, NOSLIP, SLIP, SEPARATE = range(5)

PARALLEL = 1e-10     # sine of an angle: a normal this near to the span of others is in it
ROUNDING = 1e-9      # of the speeds at the node: a plane in the span of others is met this well
ESCAPE = 10.0        # times the relative speeds: a node that would have to be faster is squeezed


class Contacts(NamedTuple):
    """Pairs of a node and a collider that it is in, sorted by node; K pairs, P colliders."""

    node: np.ndarray    # (K,)    which node
    part: np.ndarray    # (K,)    which collider
    n: np.ndarray       # (K, d)  outward unit normal
    v: np.ndarray       # (K, d)  velocity of the collider at the node [m/s]
    dv: np.ndarray      # (K, d)  change of the node's velocity by the collider [m/s]; output
    kind: np.ndarray    # (P,)    PRESCRIBED .. SEPARATE
    mu: np.ndarray      # (P,)    coefficient of friction


@kernel
def approach(contacts, k, u):
    """a_k = n_k . (u - v_k), negative towards the collider."""
    return dot(vec(contacts.n, k, u), lin(1.0, u, -1.0, vec(contacts.v, k, u)))


@kernel
def rank(contacts, k, v):
    """PRESCRIBED and STICKY hold the node; the smallest counts."""
    kind = contacts.kind[contacts.part[k]]
    if kind == NOSLIP:
        return STICKY if approach(contacts, k, v) < 0.0 else SEPARATE
    return kind


@kernel
def strongest(contacts, pairs, v):
    """Smallest rank of the pairs pairs[0] .. pairs[1] - 1."""
    r = SEPARATE
    for k in range(pairs[0], pairs[1]):
        r = min(r, rank(contacts, k, v))
    return r


@kernel
def hold(contacts, pairs, v, r):
    """Mean velocity of the colliders of rank r or less; each is credited with its part of the change."""
    count, u = 0, fill(0.0, v)
    for k in range(pairs[0], pairs[1]):
        if rank(contacts, k, v) <= r:
            count, u = count + 1, lin(1.0, u, 1.0, vec(contacts.v, k, v))
    for k in range(pairs[0], pairs[1]):
        share = 1.0 / count if rank(contacts, k, v) <= r else 0.0
        put_vec(contacts.dv, k, lin(share, vec(contacts.v, k, v), -share, v))
    return lin(1.0 / count, u, 0.0, u)


# projections. A set of planes is a tuple of three pairs, -1 for none; a basis three orthonormal vectors, or zeros.

@kernel
def rest(n, basis):
    """n without its components in the span of the basis."""
    p, q, r = basis
    return lin(1.0, lin(1.0, n, -dot(n, p), p), -1.0, lin(dot(n, q), q, dot(n, r), r))


@kernel
def projected(contacts, planes, v):
    """Velocity nearest to v on all the planes, a basis of their normals, whether these are independent."""
    zero = fill(0.0, v)
    u, basis, independent = v, (zero, zero, zero), True
    for k in planes:
        if k >= 0:
            n = vec(contacts.n, k, v)
            e = rest(rest(n, basis), basis)      # twice: at right angles to the basis to round-off
            size = norm(e)
            if not size > PARALLEL:
                return u, basis, False
            e = lin(1.0 / size, e, 0.0, e)
            u = lin(1.0, u, -approach(contacts, k, u) / dot(n, e), e)
            basis = (e, basis[0], basis[1])
    return u, basis, independent


@kernel
def allowed(contacts, pairs, u, planes, basis):
    """Whether u, which is on the planes, is allowed by all other colliders; NaN is."""
    for k in range(pairs[0], pairs[1]):
        if k not in planes:
            n, a = vec(contacts.n, k, u), approach(contacts, k, u)
            slack = 0.0
            if norm(rest(n, basis)) <= PARALLEL:
                slack = ROUNDING * (norm(u) + norm(vec(contacts.v, k, u)))
            if a < -slack or (a > slack and contacts.kind[contacts.part[k]] == SLIP):
                return False
    return True


@kernel
def nearer(contacts, pairs, v, planes, best):
    """`best` or, if it is allowed and nearer to v, the projection on the planes."""
    u, basis, independent = projected(contacts, planes, v)
    change = norm(lin(1.0, u, -1.0, v))
    if independent and change < best[0] and allowed(contacts, pairs, u, planes, basis):
        return change, planes
    return best


@kernel
def nearest(contacts, pairs, v):
    """Change of velocity and planes of the nearest allowed velocity; the change is infinite if there is none."""
    first, last = pairs
    none = (-1, -1, -1)
    zero = fill(0.0, v)
    best = (0.0 if allowed(contacts, pairs, v, none, (zero, zero, zero)) else limit, none)
    for i in range(first, last):
        best = nearer(contacts, pairs, v, (i, -1, -1), best)
        for j in range(first, i):
            best = nearer(contacts, pairs, v, (j, i, -1), best)
            for k in range(first, j):
                best = nearer(contacts, pairs, v, (k, j, i), best)
    return best
