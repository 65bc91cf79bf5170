"""Which nodes a shape or a wall contains, and one velocity for each that satisfies all of them.

    touch, touch_wall    the nodes of one part, with its normal and its velocity there: a `Touch`
    solve                new velocities of all nodes touched, and the impulse of each part

A node is in a shape if it has mass and its signed distance is at most `ON` cells.
"""

from typing import NamedTuple

import numpy as np

from .contact import Contacts, meet
from .jit import CHUNKS, chunk, kernel, parallel, prange
from .levelset import distances, normals
from .tensor import lin, mat, mv, put_vec, vec, vm

ON = 1e-9     # cells: a node this near to the surface is on it, so that rounding moves no wall


class Nodes(NamedTuple):
    """Some nodes of a grid, by their index in its flattened arrays."""

    flat: np.ndarray      # (A,)
    m: np.ndarray         # (n1, .., nd)  for its shape
    origin: np.ndarray    # (d,)          index of the first node, counted from the world's origin
    dx: float             # [m]


class Touch(NamedTuple):
    """The nodes that one part contains."""

    node: np.ndarray      # (K,)    index in the grid's flattened arrays
    n: np.ndarray         # (K, d)  outward normal of the part
    v: np.ndarray         # (K, d)  velocity of the part there [m/s]


def nodes_with_mass(grid):
    """`Nodes` of a grid that have mass."""
    flat = np.flatnonzero(grid.m.reshape(-1) > 0.0)
    return Nodes(flat, grid.m, grid.origin, float(grid.dx))


def touch(nodes, shape, inside, region, pose):
    """The nodes inside a shape placed by the pose `region`, or outside of it for a container.

    Their velocities are those of the rigid motion `pose`, the same one where the region follows it.
    """
    d = nodes.m.ndim
    X = np.empty((len(nodes.flat), d))
    _pull_back_all(nodes, region, X)
    side = -1.0 if inside else 1.0
    near = np.flatnonzero(side * distances(X, shape) <= ON * nodes.dx)
    n, v = side * normals(X[near], shape), np.empty((len(near), d))
    nodes = nodes._replace(flat=nodes.flat[near])
    _carry_all(nodes, region, pose, n, v)
    return Touch(nodes.flat, n, v)


def touch_wall(grid, axis, limit, below):
    """The nodes with mass whose index on an axis is < limit (below), or > limit, from the origin.

    Nodes are counted in integers. A limit of None is no wall.
    """
    shape, first = grid.m.shape, int(grid.origin[axis])
    start, stop = 0, shape[axis]
    if limit is None:
        stop = 0
    elif below:
        stop = min(max(limit - first, 0), stop)
    else:
        start = min(max(limit + 1 - first, 0), stop)
    slab = np.moveaxis(grid.m, axis, 0)[start:stop]
    i, *others = np.nonzero(slab > 0.0)
    others.insert(axis, i + start)
    n = np.zeros((len(i), len(shape)))
    n[:, axis] = 1.0 if below else -1.0
    return Touch(np.ravel_multi_index(others, shape), n, np.zeros_like(n))


def solve(touches, kind, mu, grid):
    """Change grid.v to satisfy all parts at once; returns the impulse of each, (P, d) [kg m/s].

    touches has one `Touch` for each part, kind its rule (see `contact`), mu its friction.
    """
    d = grid.m.ndim
    if not touches:
        return np.zeros((0, d))
    J = np.zeros((CHUNKS, len(touches), d))
    contacts, start = by_node(touches, kind, mu)
    if len(contacts.node):
        _settle_all(contacts, start, grid.v.reshape(-1, d), grid.m.shape)
        _add_all_impulses(contacts, grid.m.reshape(-1), J)
    return J.sum(axis=0)


def by_node(touches, kind, mu):
    """`Contacts` by node, those of the a-th node touched being start[a] .. start[a + 1] - 1. At a
    node the larger friction comes first, to which ties between planes go.
    """
    order = sorted(range(len(touches)), key=lambda p: -mu[p])
    rows = [touches[p] for p in order]
    node = np.concatenate([row.node for row in rows])
    part = np.repeat(order, [len(row.node) for row in rows])
    sort = np.argsort(node, kind="stable")
    n = np.concatenate([row.n for row in rows])[sort]
    v = np.concatenate([row.v for row in rows])[sort]
    node, kind, mu = node[sort], np.asarray(kind), np.asarray(mu, dtype=float)
    first = np.flatnonzero(node[1:] != node[:-1]) + 1
    start = np.concatenate(([0], first, [len(node)]))
    return Contacts(node, part[sort], n, v, np.zeros_like(v), kind, mu), start


@kernel
def place(nodes, k, n):
    """Position of the k-th of the nodes, of a grid of shape n [m]."""
    i, o, dx = nodes.flat[k], nodes.origin, nodes.dx
    if len(n) == 2:
        return (o[0] + i // n[1]) * dx, (o[1] + i % n[1]) * dx
    else:
        j = i // n[2]
        return (o[0] + j // n[1]) * dx, (o[1] + j % n[1]) * dx, (o[2] + i % n[2]) * dx


@kernel
def pull_back(nodes, region, X, bounds):
    """X_k = origin + R^T (x_k - center): the nodes in the frame of a shape that has moved."""
    d = nodes.m.shape
    origin, center, R = vec(region.origin, 0, d), vec(region.center, 0, d), mat(region.R, 0, d)
    for k in range(bounds[0], bounds[1]):
        r = lin(1.0, place(nodes, k, d), -1.0, center)
        put_vec(X, k, lin(1.0, origin, 1.0, vm(r, R)))


@kernel
def carry(nodes, region, pose, n, v, bounds):
    """n_k <- R n_k, and v_k = v + W (x_k - center), the velocity of the motion at the nodes."""
    d = nodes.m.shape
    R, center, W = mat(region.R, 0, d), vec(pose.center, 0, d), mat(pose.W, 0, d)
    for k in range(bounds[0], bounds[1]):
        r = lin(1.0, place(nodes, k, d), -1.0, center)
        put_vec(n, k, mv(R, vec(n, k, d)))
        put_vec(v, k, lin(1.0, vec(pose.v, 0, d), 1.0, mv(W, r)))


@kernel
def settle(contacts, start, v, like, bounds):
    """Velocities of the nodes bounds[0] .. bounds[1] - 1 of those in contact."""
    for a in range(bounds[0], bounds[1]):
        i = contacts.node[start[a]]
        put_vec(v, i, meet(contacts, (start[a], start[a + 1]), vec(v, i, like)))


@kernel
def add_impulses(contacts, m, J, bounds):
    """J_part += m_i dv of the pairs bounds[0] .. bounds[1] - 1."""
    for k in range(bounds[0], bounds[1]):
        for a in range(J.shape[1]):
            J[contacts.part[k], a] += m[contacts.node[k]] * contacts.dv[k, a]


@parallel
def _pull_back_all(nodes, region, X):
    for c in prange(CHUNKS):
        pull_back(nodes, region, X, chunk(c, len(X)))


@parallel
def _carry_all(nodes, region, pose, n, v):
    for c in prange(CHUNKS):
        carry(nodes, region, pose, n, v, chunk(c, len(n)))


@parallel
def _settle_all(contacts, start, v, like):
    for c in prange(CHUNKS):
        settle(contacts, start, v, like, chunk(c, len(start) - 1))


@parallel
def _add_all_impulses(contacts, m, J):
    for c in prange(CHUNKS):
        add_impulses(contacts, m, J[c], chunk(c, len(contacts.node)))
