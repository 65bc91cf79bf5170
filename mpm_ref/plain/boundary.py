"""Contact at the grid nodes: the nearest velocity that all colliders allow, and friction.

A node in a collider with the outward normal n and the velocity v_k may not approach it:
n . (u - v_k) >= 0 (separate), must not leave it either, = 0 (slip), or moves with it, u = v_k
(sticky). The velocity u after contact is the point nearest to v that meets all conditions, one
small minimisation for each node; Coulomb friction then shortens its tangential part. The rules are
those of docs/explanation/boundaries.md.

Which nodes a collider contains, its normal and its velocity there are data, a `Contact`. So the
text covers every shape and motion.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

PARALLEL = 1e-10      # sine of an angle below which normals count as linearly dependent
ROUNDING = 1e-9       # relative to the speeds: slack of a condition that depends on others
ESCAPE = 10           # times the relative speeds: a node that had to be faster is squeezed


class Contact(NamedTuple):
    """A node in a collider, seen from the node."""

    n: np.ndarray     # (d,)  outward unit normal
    v: np.ndarray     # (d,)  velocity of the collider at the node [m/s]
    kind: str         # "prescribed", "sticky", "noslip", "slip" or "separate"
    mu: float         # coefficient of friction


def apply_contacts(v, contacts):
    """Return nodal velocities v (.., d) [m/s] after the contacts {node: list of `Contact`}."""
    out = v.copy()
    for node, at_node in contacts.items():
        out[node] = contact_velocity(v[node], at_node)
    return out


def contact_velocity(v, contacts):
    """Return the velocity (d,) of one node that would have v without its contacts.

    A prescribed velocity wins over a sticky collider, and that over planes. A node squeezed between
    planes takes the mean of their velocities.
    """
    for kinds in (("prescribed",), ("prescribed", "sticky")):
        fixed = contacts_of_kind(contacts, v, *kinds)
        if fixed:
            return mean([c.v for c in fixed])
    planes = active_planes(v, contacts)
    if planes is None:
        return mean([c.v for c in contacts])
    return apply_friction(v, planes)


def contacts_of_kind(contacts, v, *kinds):
    """Return the contacts of some kinds; "noslip" is sticky if v approaches, else separate."""
    def kind(c):
        if c.kind != "noslip":
            return c.kind
        return "sticky" if c.n @ (v - c.v) < 0 else "separate"

    return [c for c in contacts if kind(c) in kinds]


def mean(vectors):
    """Return the arithmetic mean of vectors (d,)."""
    return sum(vectors) / len(vectors)


def active_planes(v, contacts):
    """Return the contacts whose planes the allowed velocity nearest to v lies on, or None.

    The allowed velocities are a polyhedron. Its point nearest to v is the projection of v on the
    planes that it lies on, so all sets of up to d planes are tried. None: there is no such point.
    """
    if is_allowed(v, contacts, []):
        return []
    limit = ESCAPE * sum(length(v - c.v) for c in contacts)
    candidates = [(limit, None)]
    for count in range(1, len(v) + 1):
        for planes in combinations(contacts, count):
            G = gram_matrix(planes)
            if det(G) > PARALLEL**2:
                u = v + correction(v, planes)
                if is_allowed(u, contacts, planes):
                    candidates.append((length(u - v), list(planes)))
    return min(candidates, key=lambda entry: entry[0])[1]


def is_allowed(u, contacts, planes):
    """Return whether u satisfies every contact that is not one of the planes.

    n . (u - v_k) >= 0, and = 0 for "slip", up to round-off where n depends on the planes' normals.
    """
    for c in contacts:
        if not any(c is plane for plane in planes):
            gap = c.n @ (u - c.v)
            dependent = planes and det(gram_matrix([*planes, c])) <= PARALLEL**2
            slack = ROUNDING * (length(u) + length(c.v)) if dependent else 0
            if gap < -slack or (c.kind == "slip" and gap > slack):
                return False
    return True


def correction(v, planes):
    """u - v = sum_k l_k n_k, with the multipliers l_k of the planes n_k . (u - v_k) = 0."""
    return sum((c.n * l for c, l in zip(planes, multipliers(v, planes))), 0 * v)


def multipliers(v, planes):
    """Return the l_k of `correction` [m/s]: sum_k (n_j . n_k) l_k = -n_j . (v - v_j).

    By Cramer's rule.
    """
    G = gram_matrix(planes)
    right = np.array([-(c.n @ (v - c.v)) for c in planes])
    columns = []
    for k in range(len(planes)):
        A = G.copy()
        A[:, k] = right
        columns.append(det(A) / det(G))
    return columns


def gram_matrix(planes):
    """G_jk = n_j . n_k, the products of the normals of some contacts."""
    n = np.array([c.n for c in planes])
    return n @ n.T


def det(A):
    """Return the determinant of a small matrix, by expansion along its first row."""
    if len(A) == 1:
        return A[0, 0]
    return sum((-1) ** k * A[0, k] * det(np.delete(A[1:], k, axis=1)) for k in range(len(A)))


def length(x):
    """Return the Euclidean length of a vector."""
    return np.sqrt(x @ x)


def apply_friction(v, planes):
    """Return the velocity on the planes, its tangential part shortened by Coulomb friction.

    With u = v + sum_k l_k n_k on the planes, the tangential velocity t relative to them loses the
    length sum_k mu_k |l_k|, at most all of it. The planes' velocity is the mean of the v_k weighted
    by mu_k |l_k| [Stomakhin2013].
    """
    u = v + correction(v, planes)
    frictions = [c.mu * abs(l) for c, l in zip(planes, multipliers(v, planes))]
    friction = sum(frictions)
    if not friction > 0:
        return u
    t = u - sum(f * c.v for f, c in zip(frictions, planes)) / friction
    at_rest = [c._replace(v=0 * v) for c in planes]
    t = t + correction(t, at_rest)
    speed = length(t)
    return u - (t if friction >= speed else t * (friction / speed))
