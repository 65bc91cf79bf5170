"""Conditions at the surface of a part, between the nodes: second order in dx.

Nodes behind a wall carry the velocity that puts the wall's velocity v_w on its surface. Let node j
lie at the signed distance d_j <= NEAR dx of a surface with the outward normal n, which meets it at
the point x_j - d_j n, and let x_r be the point on the same normal at the distance D >= NEAR dx
where it crosses the first plane of nodes. The velocity of the matter at the surface is the linear
interpolation (d_j < 0) or extrapolation (d_j > 0)

    u_j = (D v_j - d_j v(x_r)) / (D - d_j),     v(x_r) = sum_k w_k v_k

with v(x_r) linear between the nodes of that plane. The rules of `contact` hold for u_j in place of
the velocity of a node, with an impulse l_j for each node j that changes the nodal momenta by

    m_i dv_i = a_ji l_j,                        u_j = sum_i a_ji v_i,   sum_i a_ji = 1

so that the momentum and the moment of l_j act at the surface. All rules are satisfied at once, by
projected Gauss-Seidel sweeps over the impulses in a fixed order:

    l_j <- P(l_j - (u_j - v_w) / sum_i a_ji^2 / m_i)

where P keeps all of l_j (sticky), or its normal part (slip; separate: where it pushes) and a
tangential part of at most mu times that, Coulomb's law. Where parts that close on each other
contradict, the impulses of each sweep add to those before without end, or nodes gain more energy
than walls could give them: such a step has conditions at nodes, with their rule for matter that is
squeezed.
Ghost values by mirrors and by extrapolation are common for grids [Mittal2008]; constraints in the
metric of the nodal masses keep the step's momentum exact and its bound of the time step.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .boundary import Conditions, nodes_with_mass, nodes_within, solve
from .contact import ESCAPE, NOSLIP, SEPARATE, SLIP, STICKY
from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .tensor import dot, fill, lin, norm, put_vec, vec

NEAR = 0.75         # cells in front of a surface, up to which nodes carry its condition
EDGE = 1e-6         # cells: nodes this near to NEAR do not, so that D - d >= 1 for those that do
DEEP = 2.0          # cells behind a surface, out of reach of matter in front of it
FARTHEST = 5        # cells along an axis from a node behind a surface to those that interpolate
LIGHT = 1e-2        # of the heaviest node of a plane: a node below it does not count
LIGHTEST = 1e-200   # [kg] least mass of a node, so that its inverse is finite
SWEEPS = 300        # at most
CLOSE = 1e-12       # of an impulse: its change in the last sweep
GROWING = 1e-3      # of an impulse: change in the last sweep that is one of parts that contradict
SMALL = 1e-4        # of all impulses: that of a point which need not converge


AT_NODES = ('boundary = "surface": expected "nodes" for adjoints, golden files, reduced models and '
            "implicit steps, which know conditions at nodes alone")


class SurfacePoints(NamedTuple):
    """Points of surfaces at which conditions hold, each with the nodes that interpolate to it."""

    node: np.ndarray      # (K, n)  index in the grid's flattened arrays; first the node behind
    a: np.ndarray         # (K, n)  weight of each; 0 for a node that does not count
    n: np.ndarray         # (K, d)  outward normal of the part
    v: np.ndarray         # (K, d)  velocity of the part there [m/s]


class Rules(NamedTuple):
    """The rule of each point, and the inverse mass of its nodes."""

    share: np.ndarray     # (K, n)  1/m [1/kg]; 0 for a node whose velocity is prescribed
    kind: np.ndarray      # (K,)    PRESCRIBED .. SEPARATE, see `contact`
    mu: np.ndarray        # (K,)    coefficient of friction


@dataclass(frozen=True)
class SurfaceConditions(Conditions):
    """Conditions that hold at the surfaces of the colliders.

    Prescribed regions and walls counted in nodes act on nodes, as in `Conditions`.
    """

    read_distance = FARTHEST

    def apply(self, grid, t, dt):
        """Change the velocities of an updated grid; see `Conditions.apply`."""
        before = grid.v.copy()
        J, solved = self.apply_at_surface(grid, t, dt)
        if solved:
            return J
        grid.v[:] = before
        return solve(*super().touched(grid, t, dt), grid)

    def apply_at_surface(self, grid, t, dt):
        """Change the velocities of a grid; return the impulses of the parts (P, d) [kg m/s], and
        whether no parts contradict.
        """
        nodes, dim = nodes_with_mass(grid), grid.m.ndim
        regions = [part.touch(nodes, t, dt) for part in self.prescribed]
        J_regions = solve(regions, *rules_of(self.prescribed), grid)
        walls = [] if self.walls is None else self.walls.touches(grid)
        points = [surface_points(nodes, grid, part, (t, dt)) for part in self.colliders]
        points += [node_points(wall, dim) for wall in walls]
        rules = rules_of([*self.colliders, *[self.walls] * len(walls)])
        prescribed = [node for touch in regions for node in touch.node]
        J, solved = satisfy(points, rules, prescribed, grid)
        count = len(self.colliders)
        return np.concatenate((J[:count], J_regions, J[count:])), solved

    def touched(self, grid, t, dt):
        """Raise ValueError: a condition is not one of a single node."""
        raise ValueError(AT_NODES)


def rules_of(parts):
    """Return the rule and the coefficient of friction of each part, two lists."""
    return [part.rule for part in parts], [part.friction for part in parts]


def surface_points(nodes, grid, part, time):
    """Return the `SurfacePoints` of a collider in the step of length dt that ends at t; time is
    (t, dt).
    """
    pose = part.motion.pose(*time, grid.m.ndim)
    near, d = nodes_within(nodes, part.shape, part.inside, (pose, pose), NEAR - EDGE)
    points = node_points(near, grid.m.ndim)
    points.v[:] -= np.einsum("ab,kb,k->ka", pose.W[0], points.n, d * grid.dx)
    _attach_all(points, d, grid.m)
    return points


def node_points(touch, dim):
    """Return `SurfacePoints` at the nodes of a `Touch`."""
    K, n = len(touch.node), 1 + 2 ** (dim - 1)
    node, a = np.zeros((K, n), dtype=np.int64), np.zeros((K, n))
    node[:, 0], a[:, 0] = touch.node, 1.0
    return SurfacePoints(node, a, touch.n, touch.v)


def satisfy(points, rules, prescribed, grid):
    """Change grid.v to satisfy all parts; return the impulse of each, (P, d) [kg m/s], and whether
    parts do not contradict, and squeeze no matter.

    points has one `SurfacePoints` for each part, rules its kinds and frictions (see `rules_of`);
    the velocities of the nodes `prescribed`, indices in the flattened arrays, stay as they are, and
    a point that needs one of them is at its node.
    """
    d, sizes = grid.m.ndim, [len(p.node) for p in points]
    if not sum(sizes):
        return np.zeros((len(sizes), d)), True
    every = SurfacePoints(*(np.concatenate(column) for column in zip(*points, strict=True)))
    stored = grid.v.reshape(-1, d)
    v = stored.astype(float, copy=False)
    fixed = np.isin(every.node, prescribed)
    detach(every, (fixed & (every.a != 0.0)).any(axis=1))
    m = np.maximum(grid.m.reshape(-1)[every.node], LIGHTEST, dtype=float)
    share = np.where((every.a != 0.0) & ~fixed, 1.0 / m, 0.0)
    kind, mu = (np.repeat(rule, sizes) for rule in rules)
    kind = by_approach(every, kind, v)
    J = np.zeros((len(kind), d))
    rules = Rules(share, kind, mu.astype(float))
    nodes = first_appearances(every.node[every.a != 0.0])
    most = largest_energy(grid.m.reshape(-1)[nodes], v[nodes], every.v)
    solved = solve_impulses(every, rules, J, v, tuple(range(d)))
    if v.dtype != stored.dtype:
        stored[nodes] = v[nodes]
    solved &= not kinetic(grid.m.reshape(-1)[nodes], v[nodes]) > most
    sums = [part.sum(axis=0) for part in np.split(J, np.cumsum(sizes)[:-1])]
    return np.array(sums), solved


def first_appearances(nodes):
    """Return nodes (K,) in the order in which they appear, each once."""
    return nodes[np.sort(np.unique(nodes, return_index=True)[1])]


def largest_energy(m, v, v_w):
    """Return the kinetic energy [J] above which matter counts as squeezed, of nodes of masses m and
    velocities v, and of walls of velocities v_w [m/s].

    Constraints at rest add no energy, and those of one rigid motion no more than nodes that move
    with it would have; ESCAPE times these speeds is that of walls that leave no room.
    """
    speed = np.sqrt((v_w**2).sum(axis=1)).max()
    return ESCAPE**2 * (kinetic(m, v) + 0.5 * m.sum() * speed**2)


def kinetic(m, v):
    """Return sum_i m_i |v_i|^2 / 2 [J]."""
    return 0.5 * float(m @ (v**2).sum(axis=1))


def detach(points, chosen):
    """Let the chosen points, a mask (K,), be at their nodes."""
    points.a[chosen, 0], points.a[chosen, 1:] = 1.0, 0.0


def by_approach(points, kind, v):
    """Return the kinds, where noslip is sticky for matter that approaches and else separate."""
    u = np.einsum("kc,kca->ka", points.a, v[points.node]) - points.v
    approaches = np.einsum("ka,ka->k", u, points.n) < 0.0
    return np.where(kind == NOSLIP, np.where(approaches, STICKY, SEPARATE), kind)


@kernel
def steepest(n):
    """Return the axis of the largest component of n."""
    axis = 0
    for b in range(1, len(n)):
        if abs(n[b]) > abs(n[axis]):
            axis = b
    return axis


@kernel
def reference(d, n):
    """Return the distance D and the point x_r on the first plane of nodes at D >= NEAR [cells], on
    the normal n through a node, which lies at the distance d; and the axis of that plane. The point
    is counted from the node, so that round-off does not depend on where the grid begins.
    """
    axis = steepest(n)
    foot = lin(-d, n, 0.0, n)
    start = foot[axis] + NEAR * n[axis]
    nearest = round(start)
    if abs(start - nearest) > 1e-9:
        nearest = np.ceil(start) if n[axis] > 0.0 else np.floor(start)
    D = (nearest - foot[axis]) / n[axis]
    return D, lin(1.0, foot, D, n), axis


@kernel
def corner(r, c, axis):
    """Return corner c of the cell of a plane of nodes around r, and its weight for linear
    interpolation in the plane.
    """
    k, w, bit = fill(0, r), 1.0, c
    for b in range(len(r)):
        whole = np.floor(r[b] + 1e-9)
        part = max(r[b] - whole, 0.0)
        if b == axis:
            k = with_entry(k, b, round(r[b]))
        else:
            k = with_entry(k, b, whole + bit % 2)
            w *= part if bit % 2 else 1.0 - part
            bit //= 2
    return k, w


@kernel
def with_entry(k, b, value):
    """Return the integers k with another b-th entry."""
    if len(k) == 2:
        return int(value) if b == 0 else k[0], int(value) if b == 1 else k[1]
    else:
        return (int(value) if b == 0 else k[0], int(value) if b == 1 else k[1],
                int(value) if b == 2 else k[2])


@kernel
def flat_index(i, k, shape):
    """Return the index in the flattened arrays of a grid of the node k from node i on, -1 outside
    of the grid.
    """
    j = 0
    for b in range(len(shape)):
        if not 0 <= i[b] + k[b] < shape[b]:
            return -1
        j = j * shape[b] + i[b] + k[b]
    return j


@kernel
def indices_of(i, shape):
    """Return the indices of a node from that in the flattened arrays."""
    if len(shape) == 2:
        return i // shape[1], i % shape[1]
    else:
        j = i // shape[2]
        return j // shape[1], j % shape[1], i % shape[2]


@kernel
def attach(points, d, m, bounds):
    """Nodes and weights of the points bounds[0] .. bounds[1] - 1; points.node[:, 0] and n are
    given, d (K,) is the distance of that node [cells], m the nodal masses.

    A point whose plane of reference has no mass, or too deep in the part, is the node itself. Nodes
    of the plane that are LIGHT beside another do not count: two points that share a light node
    would need as many sweeps as their other nodes are heavier.
    """
    shape, masses = m.shape, m.reshape(-1)
    for j in range(bounds[0], bounds[1]):
        first = indices_of(points.node[j, 0], shape)
        D, r, axis = reference(d[j], vec(points.n, j, shape))
        total, heaviest = 0.0, 0.0
        for c in range(points.a.shape[1] - 1):
            k, w = corner(r, c, axis)
            i = flat_index(first, k, shape)
            if i >= 0 and w > 0.0 and masses[i] > 0.0:
                points.node[j, 1 + c], points.a[j, 1 + c] = i, w
                heaviest = max(heaviest, masses[i])
        for c in range(1, points.a.shape[1]):
            if masses[points.node[j, c]] < LIGHT * heaviest:
                points.a[j, c] = 0.0
            total += points.a[j, c]
        if total > 0.0 and d[j] >= -DEEP:
            points.a[j, 0] = D / (D - d[j])
            for c in range(1, points.a.shape[1]):
                points.a[j, c] *= -d[j] / (D - d[j]) / total
        else:
            points.a[j, 0] = 1.0
            points.a[j, 1:] = 0.0


@kernel
def velocity_at(points, j, v, like):
    """u_j - v_w, u_j = sum_i a_ji v_i."""
    u = vec(points.v, j, like)
    u = lin(-1.0, u, 0.0, u)
    for c in range(points.a.shape[1]):
        if points.a[j, c] != 0.0:
            u = lin(1.0, u, points.a[j, c], vec(v, points.node[j, c], like))
    return u


@kernel
def projected_impulse(l, n, kind, mu):
    """P(l): the normal part of an impulse where the kind allows it, and a tangential part of at
    most mu times that.
    """
    if kind <= STICKY:
        return l
    normal = dot(l, n)
    t = lin(1.0, l, -normal, n)
    if kind != SLIP and normal < 0.0:
        normal = 0.0
    size, most = norm(t), mu * abs(normal)
    scale = most / size if size > most else 1.0
    return lin(normal, n, scale, t)


@kernel
def relax(points, rules, J, v, like):
    """One sweep: improve the impulse J_j of each point and the nodal velocities v; returns the
    largest |dJ_j|/|J_j| of points that bear more than SMALL of all impulses.
    """
    worst, least = 0.0, SMALL * total_impulse(J, like)
    for j in range(len(points.node)):
        u, weight = velocity_at(points, j, v, like), 0.0
        for c in range(points.a.shape[1]):
            weight += points.a[j, c] ** 2 * rules.share[j, c]
        if weight > 0.0:
            before = vec(J, j, like)
            l = projected_impulse(lin(1.0, before, -1.0 / weight, u), vec(points.n, j, like),
                                  rules.kind[j], rules.mu[j])
            put_vec(J, j, l)
            dl = lin(1.0, l, -1.0, before)
            if norm(l) > least:
                worst = max(worst, norm(dl) / norm(l))
            for c in range(points.a.shape[1]):
                i, share = points.node[j, c], points.a[j, c] * rules.share[j, c]
                put_vec(v, i, lin(1.0, vec(v, i, like), share, dl))
    return worst


@kernel
def total_impulse(J, like):
    """Sum of |J_j|."""
    s = 0.0
    for j in range(len(J)):
        s += norm(vec(J, j, like))
    return s


@kernel
def solve_impulses(points, rules, J, v, like):
    """Sweep until no impulse changes by more than CLOSE, at most SWEEPS times; returns whether none
    grows on as those of parts do that contradict.
    """
    worst = 0.0
    for _ in range(SWEEPS):
        worst = relax(points, rules, J, v, like)
        if not worst > CLOSE:
            return True
    return not worst > GROWING


@parallel_if_many
def _attach_all(points, d, m):
    for c in prange(CHUNKS):
        attach(points, d, m, chunk(c, len(d)))
