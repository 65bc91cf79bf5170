"""Explicit steps of bodies that touch: a velocity field for each body that has a contact.

    for each field: order -> p2g -> grid update     contact of each pair -> boundaries, g2p, deform

All bodies without a contact share one field. Fields whose pair has no contact act as one: at each
common node they get their common velocity (see `core.body_contact` for both rules). Pairs act one
after the other, in the order of their bodies.
"""

from dataclasses import dataclass
from itertools import combinations
from math import inf

from .core.body_contact import BodyPoints, apply_contact, glue, shared_nodes
from .core.grid import Storage, update
from .explicit import Stepper, scatter

KINDS = "separate", "stick"


@dataclass(frozen=True)
class BodyContact:
    """The rule between each two of some bodies, by their names.

    kind "separate": bodies may not approach where they touch, and may leave; friction is Coulomb's
    coefficient. kind "stick": they move together wherever they share nodes. Raises ValueError for
    other values.
    """

    bodies: tuple
    friction: float = 0.0
    kind: str = "separate"

    def __post_init__(self):
        if self.kind not in KINDS:
            raise ValueError(f"kind = {self.kind!r}: expected one of {', '.join(KINDS)}")
        if not 0.0 <= self.friction < inf:
            raise ValueError(f"friction = {self.friction}: expected a finite number >= 0")
        if self.friction and self.kind != "separate":
            raise ValueError(f"friction = {self.friction} with kind {self.kind!r}: only separate "
                             "rubs")
        if len(self.bodies) < 2:
            raise ValueError(f"bodies = {list(self.bodies)}: expected two bodies or more")
        for k, name in enumerate(self.bodies):
            if name in self.bodies[:k]:
                raise ValueError(f"bodies = {list(self.bodies)}: body {name!r} stands there twice")

    @property
    def pairs(self):
        """Return its pairs, frozen sets of two names."""
        return tuple(map(frozenset, combinations(self.bodies, 2)))


def rules_of(contacts, names):
    """Return {pair of names: `BodyContact`} of contacts. Raises ValueError for a name that is not
    one of `names`, and for a pair that two contacts state.
    """
    rules = {}
    for contact in contacts:
        for name in contact.bodies:
            if name not in names:
                raise ValueError(f"body {name!r}: there is none of this name; expected one of "
                                 f"{', '.join(map(repr, names))}")
        for pair in contact.pairs:
            if pair in rules:
                raise ValueError(f"bodies {' and '.join(map(repr, sorted(pair)))}: two contacts "
                                 "name this pair; expected one")
            rules[pair] = contact
    return rules


def check_contacts(contacts, names, scheme):
    """Raise ValueError for contacts that do not fit the names of bodies, or the scheme."""
    rules_of(contacts, names)
    if contacts and scheme.precision != "double":
        raise ValueError(f"contact of bodies with precision = {scheme.precision!r}: expected "
                         "'double', which the gap of the bodies needs")
    if contacts and scheme.degree == 1:
        raise ValueError("contact of bodies with degree = 1: expected 2 or 3, whose weights have a "
                         "continuous slope, from which the normal is taken")


class ContactStepper(Stepper):
    """A `Stepper` of bodies some of which touch by `BodyContact`.

    Its grids are lists, with a `Grid` for each field, which covers the bodies of the field alone.
    conditions need `apply_all` (see `core.boundary.Conditions`).
    """

    def __init__(self, contacts, scheme, dx, gravity, conditions=None):
        super().__init__(scheme, dx, len(gravity), gravity, conditions)
        self.contacts = tuple(contacts)
        self.stores = {}

    def start(self, bodies):
        """Start as `Stepper.start`. Raises ValueError for contacts that do not fit the bodies."""
        super().start(bodies)
        check_contacts(self.contacts, [body.name for body in bodies], self.scheme)

    def fields(self, bodies):
        """Return the bodies of each field, a list of lists: those without contact, and each that
        has one.
        """
        named = {name for contact in self.contacts for name in contact.bodies}
        free = [body for body in bodies if body.name not in named]
        return [free] * bool(free) + [[body] for body in bodies if body.name in named]

    def parts(self, grids, bodies):
        """Return pairs of the grid of each field and its bodies."""
        return list(zip(grids, self.fields(bodies), strict=True))

    def accelerate(self, bodies, dt):
        """Return the grids with the velocities that forces, gravity and contact give in dt [s]."""
        grids, scheme = [], self.scheme
        for k, field in enumerate(self.fields(bodies)):
            if k not in self.stores:
                self.stores[k] = Storage(self.dx, scheme.stencil, len(self.gravity),
                                         flip=scheme.keeps_old_velocity)
            grids.append(scatter(field, self.stores[k], scheme, dt))
            update(grids[-1], self.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
        self.touch(self.parts(grids, bodies), dt)
        return grids

    def touch(self, parts, dt):
        """Change the velocities of the grids where their fields touch in a step of dt [s]; parts
        are those of `parts`.
        """
        names = [body.name for _, field in parts for body in field]
        rules = rules_of(self.contacts, names)
        for a, b in combinations(parts, 2):
            nodes = shared_nodes(a[0], b[0])
            if not len(nodes.first):
                continue
            rule = rules.get(frozenset((a[1][0].name, b[1][0].name)))
            if rule is None or rule.kind == "stick":
                glue(a[0], b[0], nodes)
            else:
                sides = [(grid, points_of(field)) for grid, field in (a, b)]
                apply_contact(*sides, nodes, (rule.friction, dt), self.scheme.stencil)

    def constrain(self, grids, t, dt):
        """Apply the conditions to all grids, in the step from time t [s] by dt [s]."""
        if self.conditions is not None:
            self.conditions.apply_all(grids, t + dt, dt)

    def update_particles(self, bodies, grids, dt):
        """Update the bodies in place from the grids that `advance_grid` returned for them."""
        for grid, field in self.parts(grids, bodies):
            super().update_particles(field, grid, dt)


def points_of(bodies):
    """Return the `BodyPoints` of each body."""
    return [BodyPoints(q.x, q.V0, q.F) for q in (body.particles for body in bodies)]
