"""Contact of two bodies that have a velocity field each, at the nodes where both have mass.

Near a node i the matter of a body fills a share of space, whose gradient points into it:

    phi_i = sum_p w_ip V_p/dx^d,    G_i = -sum_p V_p dw_ip/dx^d,    V_p = |J_p| V0_p

The normal from body 1 to body 2 is n = (G_2 - G_1)/|G_2 - G_1|. Two half-spaces that touch fill all
space, wherever the node lies; with a gap between them they leave free, to first order, as much as
its width times the slope of the shares. So

    g = 2 (1 - phi_1 - phi_2)/|G_2 - G_1|

is the width of the gap. Where |G_2 - G_1| is less than LEAST_SLOPE in a cell, as deep in two bodies
that lie in each other, round-off would choose n: there is no normal, and nothing acts. In a step of
length dt the gap may close, and no more: with the mass m = m_1 m_2/(m_1 + m_2) and the velocity
w = v_1 - v_2, body 2 gets from body 1 the impulse

    l n + t,    l = m (n . w - max(g, 0)/dt) where that is positive,

with t along w - (n . w) n, of the size that ends all sliding, but at most mu l, Coulomb's law. The
impulses on both bodies are opposite and act at one point, so that momentum and its moment are kept;
none adds energy. Without a gap bodies would act on each other from their first common node on, more
than half a cell apart [Bardenhagen2001]; [Nairn2013] has other measures of it. Nodes that three
fields or more share are those of `crowded_nodes`.
"""

from itertools import product as tuples
from typing import NamedTuple

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .order import slabs_of
from .stencil import (
    column,
    columns,
    gradient,
    locate,
    node,
    product,
    slopes_per_axis,
    weights_per_axis,
)
from .tensor import det, dot, lin, mat, norm, put_vec, vec

LEAST_SLOPE = 1e-3      # of the shares in a cell, |G_2 - G_1| dx: below it there is no normal


class Shared(NamedTuple):
    """Nodes at which two grids have mass, by their index in the flattened arrays of each."""

    first: np.ndarray       # (K,)
    second: np.ndarray      # (K,)


class BodyPoints(NamedTuple):
    """Particles of a body."""

    x: np.ndarray           # (N, d)     position [m]
    V0: np.ndarray          # (N,)       volume at rest [m^d]
    F: np.ndarray           # (N, d, d)  deformation gradient, or (N,) its determinant


class VolumeShare(NamedTuple):
    """The share of space that a body fills near K nodes."""

    slot: np.ndarray        # (n1, .., nd)  number of a node of the grid in those, or -1
    phi: np.ndarray         # (K,)          the share of space that it fills
    G: np.ndarray           # (K, d)        the gradient of that share [1/m]


class Side(NamedTuple):
    """One of two fields at K nodes."""

    node: np.ndarray        # (K,)    index in the flattened arrays of its grid
    m: np.ndarray           # (n,)    mass of all nodes of the grid [kg]
    v: np.ndarray           # (n, d)  their velocity, which contact changes [m/s]
    phi: np.ndarray         # (K,)    see `VolumeShare`
    G: np.ndarray           # (K, d)


class ContactTerms(NamedTuple):
    """Numbers of the contact of two bodies in a step."""

    mu: float               # coefficient of friction
    dt: float               # length of the step [s]
    dx: float               # grid spacing [m]


# both rules

def glue(a, b, nodes):
    """Give two grids their common velocity at `Shared` nodes; that before forces, too, where they
    carry it.
    """
    d = a.m.ndim
    nothing = np.empty(0), np.empty((0, d))
    for name in ("v", "v_old") if a.v_old.ndim > 1 else ("v",):
        sides = [Side(at, grid.m.reshape(-1), getattr(grid, name).reshape(-1, d), *nothing)
                 for grid, at in zip((a, b), nodes, strict=True)]
        _stick_all(*sides, tuple(range(d)))


def apply_contact(one, two, nodes, terms):
    """Change the velocities of two fields at `Shared` nodes by contact on some `ContactTerms`.

    one and two are pairs of a grid and the `VolumeShare` of its body near these nodes, or more.
    """
    sides = []
    for (grid, shares), at in zip((one, two), nodes, strict=True):
        k = shares.slot.reshape(-1)[at]
        sides.append(Side(at, grid.m.reshape(-1), grid.v.reshape(-1, grid.m.ndim), shares.phi[k],
                          shares.G[k]))
    _separate_all(*sides, terms, tuple(range(one[0].m.ndim)))


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


def shares_near(nodes, points, grid, stencil):
    """Return the `VolumeShare` near nodes (K,), indices in a grid's flattened arrays, of the body
    whose grid it is, with some `BodyPoints`.
    """
    d = grid.m.ndim
    shares = VolumeShare(np.full(grid.m.shape, -1), np.zeros(len(nodes)),
                         np.zeros((len(nodes), d)))
    shares.slot.reshape(-1)[nodes] = np.arange(len(nodes))
    marks = np.empty(len(points.x), dtype=np.bool_)
    _mark_all(points.x, grid, stencil, bases_of(nodes, grid.m.shape, stencil), marks)
    near = BodyPoints(*(a[marks] for a in points))
    slabs = slabs_of(near.x, grid, stencil)
    for color in (0, 1):
        _collect_color(near, grid, stencil, slabs, shares, color)
    return shares


def bases_of(nodes, shape, stencil):
    """Return the mask over a grid's nodes of those from which a stencil reaches one of `nodes`."""
    mask, at = np.zeros(shape, dtype=np.bool_), np.stack(np.unravel_index(nodes, shape))
    for offset in tuples(range(len(stencil)), repeat=len(shape)):
        base = at - np.array(offset)[:, None]
        mask[tuple(base[:, (base >= 0).all(axis=0)])] = True
    return mask


@kernel
def mark(x, grid, stencil, bases, marks, bounds):
    """Mark those of the particles bounds[0] .. bounds[1] - 1 whose base node is in a mask."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, _ = locate(vec(x, p, d), grid, stencil)
        marks[p] = bases[node(base, (0, 0, 0), 0)]


@kernel
def collect(points, grid, stencil, members, shares):
    """phi_i += w_ip V_p/dx^d, G_i -= V_p dw_ip/dx^d for the particles listed in `members` and the
    nodes that have a slot.
    """
    d = grid.m.shape
    for p in members:
        base, s = locate(vec(points.x, p, d), grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        cells = points.V0[p] * abs(volume_ratio(points.F, p, d)) / grid.dx ** len(d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                i = shares.slot[node(base, k, l)]
                if i >= 0:
                    shares.phi[i] += cells * product(k, l, w)
                    dw_ip = gradient(k, l, w, dw, grid.dx)
                    put_vec(shares.G, i, lin(1.0, vec(shares.G, i, d), -cells, dw_ip))


@kernel
def volume_ratio(F, p, like):
    """J of particle p."""
    if F.ndim == 1:
        return F[p]
    else:
        return det(mat(F, p, like))


# the law at a node

@kernel
def normal_and_gap(G1, G2, empty, dx):
    """Unit vector n from body 1 to body 2, from the gradients of their shares, and the width of the
    gap [m], negative in an overlap, from the share of space that is empty. Below LEAST_SLOPE there
    is no normal, and n is zero.
    """
    n = lin(1.0, G2, -1.0, G1)
    slope = norm(n)
    if not slope * dx > LEAST_SLOPE:
        return lin(0.0, n, 0.0, n), 0.0
    return lin(1.0 / slope, n, 0.0, n), 2.0 * empty / slope


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
def separate(one, two, terms, like, bounds):
    """Velocities of both sides after contact at the nodes bounds[0] .. bounds[1] - 1."""
    for k in range(bounds[0], bounds[1]):
        i, j = one.node[k], two.node[k]
        v1, v2 = vec(one.v, i, like), vec(two.v, j, like)
        m = one.m[i] * two.m[j] / (one.m[i] + two.m[j])
        n, gap = normal_and_gap(vec(one.G, k, like), vec(two.G, k, like),
                                1.0 - one.phi[k] - two.phi[k], terms.dx)
        mw = lin(m, v1, -m, v2)
        l = impulse(mw, n, dot(n, mw) - m * max(gap, 0.0) / terms.dt, terms.mu)
        put_vec(one.v, i, lin(1.0, v1, -1.0 / one.m[i], l))
        put_vec(two.v, j, lin(1.0, v2, 1.0 / two.m[j], l))


@kernel
def stick(one, two, like, bounds):
    """Give both sides their common velocity at the nodes bounds[0] .. bounds[1] - 1."""
    for k in range(bounds[0], bounds[1]):
        i, j = one.node[k], two.node[k]
        weight = one.m[i] / (one.m[i] + two.m[j])
        v = lin(weight, vec(one.v, i, like), 1.0 - weight, vec(two.v, j, like))
        put_vec(one.v, i, v)
        put_vec(two.v, j, v)


@parallel_if_many
def _mark_all(x, grid, stencil, bases, marks):
    for c in prange(CHUNKS):
        mark(x, grid, stencil, bases, marks, chunk(c, len(x)))


@parallel_if_many
def _collect_color(points, grid, stencil, slabs, shares, color):
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        collect(points, grid, stencil, members, shares)


@parallel_if_many
def _separate_all(one, two, terms, like):
    for c in prange(CHUNKS):
        separate(one, two, terms, like, chunk(c, len(one.node)))


@parallel_if_many
def _stick_all(one, two, like):
    for c in prange(CHUNKS):
        stick(one, two, like, chunk(c, len(one.node)))
