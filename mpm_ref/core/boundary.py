"""Conditions on the velocities of the grid: colliders, prescribed nodes, walls counted in nodes.

A node carries the condition of a part if it has mass and its signed distance to the part is at
most 1e-9 cells: the wall is the zero contour of the level set (docs/explanation/boundaries.md).
Where several parts meet, all their conditions are satisfied at once (see `contact`).
"""

from dataclasses import dataclass
from math import inf

import numpy as np

from .collide import nodes_with_mass, solve, touch, touch_wall
from .contact import NOSLIP, PRESCRIBED, SEPARATE, SLIP, STICKY
from .motion import STILL, Motion

EVEN = 1e-9         # of a step: so far a sum of steps may miss a time
KINDS = {"sticky": STICKY, "slip": SLIP, "separate": SEPARATE, "noslip": NOSLIP}


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
        """The nodes it contains at time t; see `collide.touch`."""
        pose = self.motion.pose(t, dt, nodes.m.ndim)
        return touch(nodes, self.shape, self.inside, pose, pose)


@dataclass(frozen=True)
class Prescribed:
    """A region whose nodes move as told, whatever else they meet.

    The region goes along with the motion, unless `follows` is False: then it stays in place and
    gives its nodes the velocity of the motion. `inside` takes the nodes outside the shape instead.
    It holds in steps that end after `since` and not after `until` [s].
    """

    shape: object
    motion: Motion = STILL
    inside: bool = False
    follows: bool = True
    since: float = 0.0
    until: float = inf

    rule = PRESCRIBED
    friction = 0.0

    def __post_init__(self):
        if not 0.0 <= self.since < self.until:
            raise ValueError(f"since = {self.since}, until = {self.until}: expected times in s, "
                             "0 <= since < until")

    def touch(self, nodes, t, dt):
        """The nodes it contains at time t; see `collide.touch`."""
        d = nodes.m.ndim
        if not self.since < t - EVEN * dt <= self.until:
            nodes = nodes._replace(flat=nodes.flat[:0])
        pose = self.motion.pose(t, dt, d)
        region = pose if self.follows else self.motion.at_rest.pose(t, dt, d)
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
        """The nodes of each wall, low before high, axis by axis; see `collide.touch_wall`."""
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

    @property
    def parts(self):
        """Colliders and prescribed regions."""
        return *self.colliders, *self.prescribed

    @property
    def moves(self):
        """Whether a part moves, and so may do work."""
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

    def touched(self, grid, t, dt):
        """What `apply` solves for: the `Touch` of each part at time t, its rule and its friction,
        three lists.
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
