"""Conditions of a step as a linear space: nodes fixed, or free along planes only (HOT-bc).

A collider that fixes a node takes all its freedom; one with a plane n . (u - v_c) = 0 takes one
direction. "separate" is an inequality, which an active set decides: a plane becomes active if the
node would go through it, and is released if it would have to pull the node. Near rest a node may
ask for both in turn without end, since solves are inexact: a plane that has been released twice
stays active for the rest of the step. The loads of active planes give their friction (`friction`).
"""

import numpy as np

from ..core.boundary import by_node
from ..core.contact import (
    PARALLEL,
    SLIP,
    STICKY,
    approach,
    extended,
    load,
    nearest,
    rank,
    rest,
    strongest,
)
from ..core.jit import CHUNKS, chunk, kernel, parallel, prange
from ..core.tensor import dot, fill, identity, lin, mlin, norm, outer, put_mat, put_vec, vec
from .friction import Friction

FREE, PLANE, FIXED = range(3)     # roles of a pair of node and part
RELEASES = 2                      # of a plane in a step, at most
SLACK = 1e-9                      # of the largest speed or impulse at any node: round-off


class ActiveSet:
    """The conditions at the nodes of one step, of length dt and ending at time t [s]."""

    def __init__(self, conditions, grid, unknowns, t, dt):
        touches, kind, mu = conditions.touched(grid, t, dt)
        self.rubs = any(mu)
        self.like = tuple(range(grid.m.ndim))
        self.role = np.zeros(sum(len(touch.node) for touch in touches), dtype=np.int8)
        self.releases = np.zeros_like(self.role)        # of each pair so far
        if len(self.role):
            contacts, self.start = by_node(touches, kind, mu)
            numbers = unknowns.number.reshape(-1)[contacts.node]
            self.contacts = contacts._replace(node=numbers)

    def initial_unknowns(self, unknowns, u):
        """`unknowns` under the conditions that the velocities u (n, d) would break."""
        if len(self.role):
            _initial_roles_all(self.contacts, self.start, self.role, u, self.like)
        return self.apply(unknowns)

    def apply(self, unknowns):
        """`unknowns` with B and dv0 of the fixed nodes and active planes."""
        if not len(self.role):
            return unknowns
        B, u = np.tile(np.eye(len(self.like)), (len(unknowns.m), 1, 1)), unknowns.v.copy()
        _apply_all(self.contacts, self.start, self.role, (B, u), self.like)
        return unknowns._replace(B=B, dv0=u - unknowns.v)

    def update(self, u, g):
        """Update which separate planes are active; return how many changed.

        u (n, d) [m/s] are the velocities, g (n, d) [kg m/s] is the gradient, the impulse of the
        parts.
        """
        if not len(self.role):
            return 0
        before = self.role.copy()
        slack = SLACK * float(np.abs(u).max()), SLACK * float(np.abs(g).max())
        _update_roles_all(self.contacts, self.start, (self.role, self.releases), (u, g), slack,
                          self.like)
        return int(np.count_nonzero(self.role != before))


    def friction(self, unknowns, impulse, eps):
        """Return the `Friction` of active planes, or None where none rubs.

        impulse (n, d) [kg m/s] is that of the parts on the nodes, eps [m/s] the speed of creep.
        """
        if not (self.rubs and len(self.role)):
            return None
        w, c = np.zeros(len(self.start) - 1), np.zeros((len(self.start) - 1, len(self.like)))
        _fill_friction_all(self.contacts, self.start, self.role, impulse, (w, c), self.like)
        k = np.flatnonzero(w > 0.0)
        node = self.contacts.node[self.start[k]]
        return Friction(node, w[k], c[k], unknowns.B[node], eps) if len(k) else None


@kernel
def initial_roles(contacts, pairs, role, u):
    """Roles of the pairs of one node whose velocity without them is u; see `contact.meet`."""
    r = strongest(contacts, pairs, u)
    found, planes = nearest(contacts, pairs, u)
    for k in range(pairs[0], pairs[1]):
        if r <= STICKY:
            role[k] = FIXED if rank(contacts, k, u) <= r else FREE
        elif not found:
            role[k] = FIXED
        elif contacts.kind[contacts.part[k]] == SLIP or k in planes:
            role[k] = PLANE
        else:
            role[k] = FREE


@kernel
def fixed_velocity(contacts, pairs, role, u):
    """Number of pairs that fix the node, and their mean velocity."""
    count, v = 0, fill(0.0, u)
    for k in range(pairs[0], pairs[1]):
        if role[k] == FIXED:
            count, v = count + 1, lin(1.0, v, 1.0, vec(contacts.v, k, u))
    return count, lin(1.0 / max(count, 1), v, 0.0, v)


@kernel
def plane_velocity(contacts, pairs, role, u):
    """Velocity nearest to u on the active planes, an orthonormal basis of their normals, padded
    by zeros, and the planes that span it, padded by -1.
    """
    zero = fill(0.0, u)
    basis, planes = (zero, zero, zero), (-1, -1, -1)
    for k in range(pairs[0], pairs[1]):
        if role[k] == PLANE:
            n = vec(contacts.n, k, u)
            e = rest(rest(n, basis), basis)
            size = norm(e)
            if size > PARALLEL:
                e = lin(1.0 / size, e, 0.0, e)
                u = lin(1.0, u, -approach(contacts, k, u) / dot(n, e), e)
                basis, planes = extended(basis, e), (k, planes[0], planes[1])
    return u, basis, planes


@kernel
def apply_roles(contacts, start, role, fields, like, bounds):
    """B and u, the fields, of the nodes bounds[0] .. bounds[1] - 1 of those touched."""
    B, u = fields
    for a in range(bounds[0], bounds[1]):
        pairs, i = (start[a], start[a + 1]), contacts.node[start[a]]
        v = vec(u, i, like)
        count, v_fixed = fixed_velocity(contacts, pairs, role, v)
        if count > 0:
            put_vec(u, i, v_fixed)
            put_mat(B, i, mlin(0.0, identity(like), 0.0, identity(like)))
        else:
            v_plane, (p, q, r), _ = plane_velocity(contacts, pairs, role, v)
            N = mlin(1.0, mlin(1.0, outer(p, p), 1.0, outer(q, q)), 1.0, outer(r, r))
            put_vec(u, i, v_plane)
            put_mat(B, i, mlin(1.0, identity(like), -1.0, N))


@kernel
def update_roles(contacts, pairs, state, u, g, slack):
    """Release planes that would pull; activate planes that the node goes through. `state` has the
    roles of the pairs and how often each was released.
    """
    role, releases = state
    count, _ = fixed_velocity(contacts, pairs, role, u)
    if count > 0:
        return
    _, _, planes = plane_velocity(contacts, pairs, role, u)
    for k in range(pairs[0], pairs[1]):
        if contacts.kind[contacts.part[k]] != SLIP:
            if role[k] == FREE and approach(contacts, k, u) < -slack[0]:
                role[k] = PLANE
            elif (k in planes and releases[k] < RELEASES
                  and load(contacts, k, planes, g) < -slack[1]):
                role[k], releases[k] = FREE, releases[k] + 1


@kernel
def fill_friction(contacts, pairs, role, impulse):
    """w and c of `Friction` at one node, which gets an impulse from its planes."""
    w, c = 0.0, fill(0.0, impulse)
    count, _ = fixed_velocity(contacts, pairs, role, impulse)
    if count == 0:
        _, _, planes = plane_velocity(contacts, pairs, role, impulse)
        for k in planes:
            if k >= 0:
                l = load(contacts, k, planes, impulse)
                l = abs(l) if contacts.kind[contacts.part[k]] == SLIP else max(l, 0.0)
                mu_l = contacts.mu[contacts.part[k]] * l
                w, c = w + mu_l, lin(1.0, c, mu_l, vec(contacts.v, k, impulse))
    return w, lin(1.0 / w if w > 0.0 else 0.0, c, 0.0, c)


@parallel
def _fill_friction_all(contacts, start, role, impulse, out, like):
    for c in prange(CHUNKS):
        first, last = chunk(c, len(start) - 1)
        for a in range(first, last):
            J = vec(impulse, contacts.node[start[a]], like)
            w, v = fill_friction(contacts, (start[a], start[a + 1]), role, J)
            out[0][a] = w
            put_vec(out[1], a, v)


@parallel
def _initial_roles_all(contacts, start, role, u, like):
    for c in prange(CHUNKS):
        first, last = chunk(c, len(start) - 1)
        for a in range(first, last):
            v = vec(u, contacts.node[start[a]], like)
            initial_roles(contacts, (start[a], start[a + 1]), role, v)


@parallel
def _apply_all(contacts, start, role, fields, like):
    for c in prange(CHUNKS):
        apply_roles(contacts, start, role, fields, like, chunk(c, len(start) - 1))


@parallel
def _update_roles_all(contacts, start, state, fields, slack, like):
    for c in prange(CHUNKS):
        first, last = chunk(c, len(start) - 1)
        for a in range(first, last):
            i = contacts.node[start[a]]
            u, g = vec(fields[0], i, like), vec(fields[1], i, like)
            update_roles(contacts, (start[a], start[a + 1]), state, u, g, slack)
