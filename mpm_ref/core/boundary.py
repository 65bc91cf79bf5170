"""Conditions on the velocities of the grid: colliders, prescribed nodes, walls counted in nodes.

A node carries the condition of a part if it has mass and its signed distance to the part is at
most 1e-9 cells: the wall is the zero contour of the level set (docs/explanation/boundaries.md).
Where several parts meet, all their conditions are satisfied at once (see `contact`).

    Collider, Prescribed, BoxWalls    parts; `Conditions` is all those of a scene
    touch, touch_wall                 the nodes of one part, with its normal and velocity: a `Touch`
    solve                             new velocities of all nodes touched, and each part's impulse
"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from .contact import NOSLIP, PRESCRIBED, SEPARATE, SLIP, STICKY, Contacts, meet
from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .levelset import distances, normals
from .mass_nodes import in_order_of_space, nodes_beyond, nodes_with_mass, place, selected
from .motion import STILL, Motion
from .tensor import lin, mat, mv, put_vec, vec, vm

ON = 1e-9     # cells: a node this near to the surface is on it, so that rounding moves no wall
EVEN = 1e-9         # of a step: so far a sum of steps may miss a time
KINDS = {"sticky": STICKY, "slip": SLIP, "separate": SEPARATE, "noslip": NOSLIP}


# conditions as a scene states them

@dataclass(frozen=True)
class Collider:
    """A shape that constrains the nodes it contains; `inside` makes it a container.

    kind is "sticky", "slip", "separate" or "noslip" (see `contact`); friction is Coulomb's
    coefficient, for slip and separate. Raises ValueError for other values.
    """

    shape: object
    kind: str = "sticky"
    friction: float = 0.0
    motion: Motion = STILL
    inside: bool = False

    def __post_init__(self):
        _check(self.kind, self.friction)

    @property
    def rule(self):
        """The kind as `contact` counts it."""
        return KINDS[self.kind]

    def touch(self, nodes, t, dt):
        """The nodes it contains at time t; see `touch`."""
        pose = self.motion.pose(t, dt, nodes.m.ndim)
        return touch(nodes, self.shape, self.inside, pose, pose)


@dataclass(frozen=True)
class Prescribed:
    """A region whose nodes move as told, whatever else they meet.

    The region goes along with the motion, unless `follows` is False: then it stays in place and
    gives its nodes the velocity of the motion. Where it has a motion `place` of its own, it stands
    for a step where that has it as the step begins. `inside` takes the nodes outside the shape
    instead.
    It holds in steps that end after `since` and not after `until` [s].
    """

    shape: object
    motion: Motion = STILL
    inside: bool = False
    follows: bool = True
    since: float = 0.0
    until: float = inf
    place: Motion | None = None

    rule = PRESCRIBED
    friction = 0.0

    def __post_init__(self):
        if not 0.0 <= self.since < self.until:
            raise ValueError(f"since = {self.since}, until = {self.until}: expected times in s, "
                             "0 <= since < until")

    @property
    def region_motion(self):
        """The motion of the region itself, whatever velocity its nodes have."""
        if self.place is not None:
            return self.place
        return self.motion if self.follows else self.motion.at_rest

    def touch(self, nodes, t, dt):
        """The nodes it contains at time t; see `touch`."""
        d = nodes.m.ndim
        if not self.since < t - EVEN * dt <= self.until:
            nodes = selected(nodes, slice(0))
        pose = self.motion.pose(t, dt, d)
        region = pose
        if self.place is not None:
            region = self.place.pose(t - dt, dt, d)
        elif not self.follows:
            region = self.motion.at_rest.pose(t, dt, d)
        return touch(nodes, self.shape, self.inside, region, pose)


@dataclass(frozen=True)
class BoxWalls:
    """Walls along the axes, counted in nodes: a node with index < low or > high is in a wall.

    The node at the world's origin has index 0 on every axis. low and high have one integer for each
    axis, or None where there is no wall; kind and friction are as for a `Collider`.
    """

    low: tuple
    high: tuple
    kind: str = "separate"
    friction: float = 0.0

    def __post_init__(self):
        _check(self.kind, self.friction)
        limits = (*self.low, *self.high)
        whole = all(k is None or isinstance(k, int | np.integer) for k in limits)
        if not whole or len(self.low) != len(self.high):
            raise ValueError(f"walls from {self.low} to {self.high}: expected a node index or None "
                             "for each axis")

    @property
    def rule(self):
        """The kind as `contact` counts it."""
        return KINDS[self.kind]

    def touches(self, grid):
        """The nodes of each wall, low before high, axis by axis; see `touch_wall`."""
        if len(self.low) != grid.m.ndim:
            raise ValueError(f"walls from {self.low} to {self.high} in {grid.m.ndim}D: expected "
                             f"{grid.m.ndim} limits each")
        return [touch_wall(grid, axis, limit, below)
                for axis, pair in enumerate(zip(self.low, self.high))
                for limit, below in zip(pair, (True, False))]


def nclaw_walls(nodes, bound, dim=3, kind="separate"):
    """The walls of NCLAW-sim: index < bound or > nodes - bound, where an axis has `nodes` nodes.

    With kind "separate", its free slip, the component towards a wall becomes zero; with "noslip",
    which its release offers too, the velocity of a node that moves towards a wall does.
    """
    return BoxWalls((bound,) * dim, (nodes - bound,) * dim, kind)


@dataclass(frozen=True)
class Conditions:
    """All conditions of a scene; those that meet at a node are satisfied together."""

    colliders: tuple = ()
    prescribed: tuple = ()
    walls: BoxWalls | None = None

    read_distance = 0       # cells from a node with mass to the nodes that are read for it

    @property
    def parts(self):
        """Colliders and prescribed regions."""
        return *self.colliders, *self.prescribed

    @property
    def rules(self):
        """Colliders, prescribed regions and walls."""
        return self.parts if self.walls is None else (*self.parts, self.walls)

    @property
    def moves(self):
        """True if a part moves, and so may do work."""
        return any(part.motion.moves for part in self.parts)

    def fastest(self, grid, t, dt):
        """Largest speed [m/s] that moving parts give to nodes with mass in the step of length dt
        that ends at time t; 0 where none moves.
        """
        if not self.moves:
            return 0.0
        nodes = nodes_with_mass(grid)
        touches = [part.touch(nodes, t, dt) for part in self.parts if part.motion.moves]
        return max(float(np.sqrt((touch.v**2).sum(axis=1)).max(initial=0.0)) for touch in touches)

    def apply(self, grid, t, dt):
        """Change the velocities of an updated grid, in the step of length dt that ends at time t.

        Returns the impulses [kg m/s] that the parts gave to the matter, (P, d): the colliders, the
        prescribed regions, then for each axis the low and the high wall. The force on a part is
        minus its impulse / dt. Nodes without mass are left alone.
        """
        return solve(*self.touched(grid, t, dt), grid)

    def apply_all(self, grids, t, dt):
        """Apply to the grids of several velocity fields; returns the sums of the impulses."""
        return sum(self.apply(grid, t, dt) for grid in grids)

    def touched(self, grid, t, dt):
        """Return three lists with an entry for each part: its `Touch` at time t, rule and friction.

        `apply` solves for them.
        """
        touches, rules = [], list(self.parts)
        if self.parts:
            nodes = nodes_with_mass(grid)
            touches = [part.touch(nodes, t, dt) for part in self.parts]
        if self.walls is not None:
            touches += self.walls.touches(grid)
            rules += [self.walls] * (2 * grid.m.ndim)
        return touches, [r.rule for r in rules], [r.friction for r in rules]


def _check(kind, friction):
    if kind not in KINDS:
        raise ValueError(f"kind = {kind!r}: expected one of {', '.join(KINDS)}")
    if not 0.0 <= friction < inf:
        raise ValueError(f"friction = {friction}: expected a finite number >= 0")
    if friction and kind not in ("slip", "separate"):
        raise ValueError(f"friction = {friction} with kind {kind!r}: only slip and separate rub")


# the nodes of each part, and one velocity for each that satisfies all parts

class Touch(NamedTuple):
    """The nodes that one part contains."""

    node: np.ndarray      # (K,)    index in the grid's flattened arrays
    n: np.ndarray         # (K, d)  outward normal of the part
    v: np.ndarray         # (K, d)  velocity of the part there [m/s]


def touch(nodes, shape, inside, region, pose):
    """The nodes inside a shape placed by the pose `region`, or outside of it for a container.

    Their velocities are those of the rigid motion `pose`, the same one where the region follows it.
    """
    return nodes_within(nodes, shape, inside, (region, pose), ON)[0]


def nodes_within(nodes, shape, inside, poses, margin):
    """The nodes inside a shape, or up to `margin` cells in front of it, and their signed distances
    (K,) [cells]. poses is (region, pose) of `touch`.
    """
    d, (region, pose) = nodes.m.ndim, poses
    X = np.empty((len(nodes.flat), d))
    _pull_back_all(nodes, region, X)
    side = -1.0 if inside else 1.0
    away = side * distances(X, shape)
    near = np.flatnonzero(away <= margin * nodes.dx)
    if nodes.origin.ndim > 1:
        near = near[in_order_of_space(nodes.origin[near])]
    n, v = side * normals(X[near], shape), np.empty((len(near), d))
    nodes = selected(nodes, near)
    carry(nodes, region, pose, n, v, (0, len(n)))
    return Touch(nodes.flat, n, v), away[near] / nodes.dx


def touch_wall(grid, axis, limit, below):
    """The nodes with mass whose index on an axis is < limit (below), or > limit, from the origin.

    Nodes are counted in integers. A limit of None is no wall.
    """
    node = nodes_beyond(grid, axis, limit, below)
    n = np.zeros((len(node), grid.m.ndim))
    n[:, axis] = 1.0 if below else -1.0
    return Touch(node, n, np.zeros_like(n))


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
        add_impulses_by_chunk(contacts, grid.m.reshape(-1), J)
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


@parallel_if_many
def _pull_back_all(nodes, region, X):
    for c in prange(CHUNKS):
        pull_back(nodes, region, X, chunk(c, len(X)))


@parallel_if_many
def _settle_all(contacts, start, v, like):
    for c in prange(CHUNKS):
        settle(contacts, start, v, like, chunk(c, len(start) - 1))


# Few nodes are in contact, and each parallel driver takes half a second to compile.

@kernel
def add_impulses_by_chunk(contacts, m, J):
    """`add_impulses` of all pairs, with the sums J (CHUNKS, P, d) of the chunks kept separate."""
    for c in range(CHUNKS):
        add_impulses(contacts, m, J[c], chunk(c, len(contacts.node)))
