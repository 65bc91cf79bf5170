"""Contact of two bodies that have a velocity field each, at the nodes where both have mass.

Near a node i the matter of body a has the volume, its moment and the mean position

    V_a = sum_p w_ip V0_p,   M_a = sum_p w_ip V0_p (x_p - x_i),   x_a - x_i = M_a/V_a

The normal from body 1 to body 2 is n = (M_2 - M_1)/|M_2 - M_1|, the gradient of the difference of
the volumes but for a factor. A half-space whose surface is at the distance d in front of the node
has its mean position at -xi(d) on the normal, xi(d) = -int_-inf^d s N(s) ds / int_-inf^d N(s) ds
with the spline N; the inverse of xi gives the distances of both surfaces, and their gap

    g = -(d_1 + d_2) dx,    xi(d_1) = -n . M_1/V_1,   xi(d_2) = n . M_2/V_2

which depends on no density. In a step of length dt the bodies may not approach by more than the gap
is wide: with the mass m = m_1 m_2/(m_1 + m_2) and the velocity w = v_1 - v_2, body 2 gets from
body 1 the impulse

    l n + t,    l = m (n . w - max(g, 0)/dt) where that is positive,

where t is along w - (n . w) n, of the size that ends that sliding, but at most mu l, Coulomb's law.
Impulses are equal and opposite at one point, so that momentum and moment of momentum are kept; no
impulse adds energy. Without a gap bodies act on each other from the first common node on, more than
a cell apart [Bardenhagen2001]; that a gap must close first is the criterion of [Nairn2013], with
other measures of the gap and the normal.
"""

from itertools import product as tuples
from typing import NamedTuple

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel, prange
from .order import slabs_of
from .spline import base_of
from .stencil import arm, column, columns, locate, node, product, weights_per_axis
from .tensor import dot, lin, norm, put_vec, vec

ENTRIES = 1025          # of a table of xi


class Shared(NamedTuple):
    """Nodes at which two grids have mass, by their index in the flattened arrays of each."""

    first: np.ndarray       # (K,)
    second: np.ndarray      # (K,)


class Cloud(NamedTuple):
    """Particles of a field."""

    x: np.ndarray           # (N, d)  position [m]
    V0: np.ndarray          # (N,)    volume at rest [m^d]


class Matter(NamedTuple):
    """The matter of a field near K nodes."""

    slot: np.ndarray        # (n1, .., nd)  which of them a node of the grid is, or -1
    V: np.ndarray           # (K,)    volume at rest [m^d]
    M: np.ndarray           # (K, d)  its first moment about the node [m^(d+1)]


class Side(NamedTuple):
    """One of two fields at K nodes."""

    m: np.ndarray           # (n,)    mass of all its nodes [kg]
    v: np.ndarray           # (n, d)  velocity, which contact changes [m/s]
    node: np.ndarray        # (K,)    which of them
    V: np.ndarray           # (K,)    volume near the node, see `Matter`
    M: np.ndarray           # (K, d)


class Law(NamedTuple):
    """The rule between two fields in a step."""

    mu: float               # coefficient of friction
    dt: float               # [s]
    dx: float               # [m]
    xi: np.ndarray          # table of mean positions, see `mean_positions`


def mean_positions(degree):
    """Return the table of xi(d) at ENTRIES distances d from -r to r, r = (degree + 1)/2 cells: it
    falls from r to 0.
    """
    r = 0.5 * (degree + 1)
    s = np.linspace(-r, r, 16 * (ENTRIES - 1) + 1)
    N = b_spline(s, degree)
    V, M = integral(N, s), integral(s * N, s)
    table = np.append(r, -M[16::16] / V[16::16])
    table[-1] = 0.0
    return table


def b_spline(s, degree):
    """Return the centred B-spline of a degree at s (K,) [cells], by its recursion."""
    if degree == 0:
        return np.where(np.abs(s) < 0.5, 1.0, 0.0)
    r = 0.5 * (degree + 1)
    return ((r + s) * b_spline(s + 0.5, degree - 1)
            + (r - s) * b_spline(s - 0.5, degree - 1)) / degree


def integral(y, s):
    """Return the integral (K,) of y (K,) from the first of the points s (K,), by trapezoids."""
    return np.append(0.0, np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(s)))


# both rules

def glue(a, b, nodes):
    """Give two grids, whose velocities change, their common velocity at `Shared` nodes."""
    nothing = np.empty(0), np.empty((0, a.m.ndim))
    sides = [Side(*flat(grid), at, *nothing) for grid, at in zip((a, b), nodes, strict=True)]
    _stick_all(*sides, tuple(range(a.m.ndim)))


def keep_apart(one, two, nodes, law, stencil):
    """Change the velocities of two fields at `Shared` nodes by the `Law` of their contact.

    one and two are pairs of a grid and the clouds of its particles.
    """
    sides = []
    for (grid, clouds), at in zip((one, two), nodes, strict=True):
        matter = matter_near(at, clouds, grid, stencil)
        sides.append(Side(*flat(grid), at, matter.V, matter.M))
    _separate_all(*sides, law, tuple(range(one[0].m.ndim)))


def flat(grid):
    """Return the masses (n,) and velocities (n, d) of all nodes of a grid."""
    return grid.m.reshape(-1), grid.v.reshape(-1, grid.m.ndim)


# the nodes, and the matter near them

def shared_nodes(a, b):
    """Return the `Shared` nodes of two grids, in the order of their indices."""
    low = np.maximum(a.origin, b.origin)
    high = np.minimum(a.origin + a.m.shape, b.origin + b.m.shape)
    if not (low < high).all():
        return Shared(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    cut = [g.m[tuple(map(slice, low - g.origin, high - g.origin))] for g in (a, b)]
    at = np.stack(np.nonzero((cut[0] > 0.0) & (cut[1] > 0.0))) + low[:, None]
    return Shared(*(np.ravel_multi_index(at - g.origin[:, None], g.m.shape) for g in (a, b)))


def matter_near(nodes, clouds, grid, stencil):
    """Return the `Matter` near nodes (K,), indices in a grid's flattened arrays, of the clouds
    whose grid it is.
    """
    d = grid.m.ndim
    matter = Matter(np.full(grid.m.shape, -1), np.zeros(len(nodes)), np.zeros((len(nodes), d)))
    matter.slot.reshape(-1)[nodes] = np.arange(len(nodes))
    bases = bases_of(nodes, grid.m.shape, stencil)
    for cloud in clouds:
        marks = np.empty(len(cloud.x), dtype=np.bool_)
        _mark_all(cloud.x, grid, stencil, bases, marks)
        near = Cloud(cloud.x[marks], cloud.V0[marks])
        slabs = slabs_of(near.x, grid, stencil)
        for color in (0, 1):
            _collect_color(near, grid, stencil, slabs, matter, color)
    return matter


def bases_of(nodes, shape, stencil):
    """Return the mask over a grid's nodes of those from which a stencil reaches one of `nodes`."""
    mask, at = np.zeros(shape, dtype=np.bool_), np.stack(np.unravel_index(nodes, shape))
    for offset in tuples(stencil, repeat=len(shape)):
        base = at - np.array(offset)[:, None]
        mask[tuple(base[:, (base >= 0).all(axis=0)])] = True
    return mask


@kernel
def mark(x, grid, stencil, bases, marks, bounds):
    """Whether the base node of each of the particles bounds[0] .. bounds[1] - 1 is in a mask."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, _ = locate(vec(x, p, d), grid, stencil)
        marks[p] = bases[node(base, (0, 0, 0), 0)]


@kernel
def collect(cloud, grid, stencil, members, matter):
    """V_i += w_ip V0_p, M_i += w_ip V0_p (x_p - x_i) for the particles listed in `members` and the
    nodes that have a slot.
    """
    d = grid.m.shape
    for p in members:
        base, s = locate(vec(cloud.x, p, d), grid, stencil)
        w = weights_per_axis(s, stencil)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = matter.slot[node(base, k, l)]
                if i >= 0:
                    V = product(k, l, w) * cloud.V0[p]
                    matter.V[i] += V
                    M = vec(matter.M, i, d)
                    put_vec(matter.M, i, lin(1.0, M, -V, arm(k, l, s, grid.dx)))


# the law at a node

@kernel
def depth(xi, table):
    """Distance [cells] of the surface of a half-space in front of a node, from its mean position
    -xi [cells] on the normal; at most half the width of the spline.
    """
    low, high = 0, len(table) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle] > xi:
            low = middle
        else:
            high = middle
    part = min(max((table[low] - xi) / (table[low] - table[high]), 0.0), 1.0)
    return table[0] * (2.0 * (low + part) / (len(table) - 1) - 1.0)


@kernel
def normal(one, two, k, like):
    """Unit vector from body 1 to body 2 at node k; zero where none is defined."""
    n = lin(1.0, vec(two.M, k, like), -1.0, vec(one.M, k, like))
    size = norm(n)
    return lin(1.0 / size, n, 0.0, n) if size > 0.0 else n


@kernel
def gap(one, two, k, n, law):
    """Width of the gap between both bodies at node k on the normal n [m], negative in overlap."""
    d1 = depth(-dot(n, vec(one.M, k, n)) / (one.V[k] * law.dx), law.xi)
    d2 = depth(dot(n, vec(two.M, k, n)) / (two.V[k] * law.dx), law.xi)
    return -(d1 + d2) * law.dx


@kernel
def impulse(mw, n, load, mu):
    """Impulse that body 1 gives body 2: `load` along the normal n where that is positive, and the
    tangential part of mw, the one that ends all relative motion, of at most mu times that.
    """
    if not load > 0.0:
        return lin(0.0, n, 0.0, n)
    t = lin(1.0, mw, -dot(n, mw), n)
    size, most = norm(t), mu * load
    return lin(load, n, most / size if size > most else 1.0, t)


@kernel
def separate(one, two, law, like, bounds):
    """Velocities of both sides after contact at the nodes bounds[0] .. bounds[1] - 1."""
    for k in range(bounds[0], bounds[1]):
        i, j = one.node[k], two.node[k]
        v1, v2 = vec(one.v, i, like), vec(two.v, j, like)
        m = one.m[i] * two.m[j] / (one.m[i] + two.m[j])
        n = normal(one, two, k, like)
        free = max(gap(one, two, k, n, law), 0.0) / law.dt
        mw = lin(m, v1, -m, v2)
        l = impulse(mw, n, dot(n, mw) - m * free, law.mu)
        put_vec(one.v, i, lin(1.0, v1, -1.0 / one.m[i], l))
        put_vec(two.v, j, lin(1.0, v2, 1.0 / two.m[j], l))


@kernel
def stick(one, two, like, bounds):
    """Give both sides their common velocity at the nodes bounds[0] .. bounds[1] - 1."""
    for k in range(bounds[0], bounds[1]):
        i, j = one.node[k], two.node[k]
        share = one.m[i] / (one.m[i] + two.m[j])
        v = lin(share, vec(one.v, i, like), 1.0 - share, vec(two.v, j, like))
        put_vec(one.v, i, v)
        put_vec(two.v, j, v)


@parallel
def _mark_all(x, grid, stencil, bases, marks):
    for c in prange(CHUNKS):
        mark(x, grid, stencil, bases, marks, chunk(c, len(x)))


@parallel
def _collect_color(cloud, grid, stencil, slabs, matter, color):
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        collect(cloud, grid, stencil, members, matter)


@parallel
def _separate_all(one, two, law, like):
    for c in prange(CHUNKS):
        separate(one, two, law, like, chunk(c, len(one.node)))


@parallel
def _stick_all(one, two, like):
    for c in prange(CHUNKS):
        stick(one, two, like, chunk(c, len(one.node)))
