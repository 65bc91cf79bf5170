"""Boundary conditions at the nodes, as the nearest velocity that all colliders allow.

Which nodes a collider contains, its normal and its velocity there, are data: a `Contact`. So any
shape and motion is covered; where a level set is zero is tested apart. The rules are those of
docs/explanation/boundaries.md, written as one small minimisation per node.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

PARALLEL = 1e-10      # sine of an angle below which normals count as dependent
ROUNDING = 1e-9       # of the speeds: how well a dependent condition is met
ESCAPE = 10           # of the relative speeds: a node that would have to be faster is squeezed


class Contact(NamedTuple):
    """A node in a collider."""

    n: np.ndarray     # (d,)  outward unit normal
    v: np.ndarray     # (d,)  velocity of the collider at the node [m/s]
    kind: str         # "prescribed", "sticky", "noslip", "slip" or "separate"
    mu: float         # coefficient of friction


def conditioned(v, contacts):
    """Nodal velocities v (.., d) after the contacts {node: list of `Contact`}."""
    out = v.copy()
    for node, at_node in contacts.items():
        out[node] = meet(v[node], at_node)
    return out


def meet(v, contacts):
    """Velocity (d,) of one node that would have v without its contacts."""
    for held in (of_kind(contacts, v, "prescribed"), of_kind(contacts, v, "prescribed", "sticky")):
        if held:
            return mean([c.v for c in held])
    planes = nearest(v, contacts)
    if planes is None:
        return mean([c.v for c in contacts])
    return rub(v, planes)


def of_kind(contacts, v, *kinds):
    """The contacts of some kinds; "noslip" is sticky if the node approaches, else separate."""
    def kind(c):
        if c.kind != "noslip":
            return c.kind
        return "sticky" if c.n @ (v - c.v) < 0 else "separate"

    return [c for c in contacts if kind(c) in kinds]


def mean(vectors):
    """Mean of some vectors."""
    return sum(vectors) / len(vectors)


def nearest(v, contacts):
    """The planes on which lies the allowed velocity nearest to v; None if there is none.

    The nearest point of a polyhedron is its own projection on the planes it lies on: try all.
    """
    if allowed(v, contacts, []):
        return []
    limit = ESCAPE * sum(length(v - c.v) for c in contacts)
    found = [(limit, None)]
    for count in range(1, len(v) + 1):
        for planes in combinations(contacts, count):
            G = gram(planes)
            if det(G) > PARALLEL**2:
                u = v + change(v, planes)
                if allowed(u, contacts, planes):
                    found.append((length(u - v), list(planes)))
    return min(found, key=lambda entry: entry[0])[1]


def allowed(u, contacts, planes):
    """Whether u satisfies every contact that is not one of the planes."""
    for c in contacts:
        if not any(c is plane for plane in planes):
            gap = c.n @ (u - c.v)
            dependent = planes and det(gram([*planes, c])) <= PARALLEL**2
            slack = ROUNDING * (length(u) + length(c.v)) if dependent else 0
            if gap < -slack or (c.kind == "slip" and gap > slack):
                return False
    return True


def change(v, planes):
    """u - v = sum_k l_k n_k with n_k . (u - v_k) = 0 on every plane."""
    return sum((c.n * load for c, load in zip(planes, loads(v, planes))), 0 * v)


def loads(v, planes):
    """The l_k, by Cramer's rule on G l = -n_k . (v - v_k)."""
    G = gram(planes)
    right = np.array([-(c.n @ (v - c.v)) for c in planes])
    columns = []
    for k in range(len(planes)):
        A = G.copy()
        A[:, k] = right
        columns.append(det(A) / det(G))
    return columns


def gram(planes):
    """n_j . n_k."""
    n = np.array([c.n for c in planes])
    return n @ n.T


def det(A):
    """Determinant of a small matrix, by expansion."""
    if len(A) == 1:
        return A[0, 0]
    return sum((-1) ** k * A[0, k] * det(np.delete(A[1:], k, axis=1)) for k in range(len(A)))


def length(x):
    """|x|."""
    return np.sqrt(x @ x)


def rub(v, planes):
    """The velocity on the planes with Coulomb friction: its tangential part is shortened.

    |t| is reduced by sum_k mu_k |l_k|, at most to zero; t is relative to the mean velocity of the
    planes, weighted by what they bear [Stomakhin2013].
    """
    u = v + change(v, planes)
    grips = [c.mu * abs(load) for c, load in zip(planes, loads(v, planes))]
    grip = sum(grips)
    if not grip > 0:
        return u
    t = u - sum(g * c.v for g, c in zip(grips, planes)) / grip
    still = [c._replace(v=0 * v) for c in planes]
    t = t + change(t, still)
    size = length(t)
    return u - (t if grip >= size else t * (grip / size))
