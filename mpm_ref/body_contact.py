"""Explicit steps of bodies that touch: a velocity field for each body that has a contact.

    for each field: order -> p2g -> grid update     contact -> boundaries, g2p, deform

All bodies without a contact share one field. Fields whose pair has no contact are glued, as fields
of kind "stick" are: at each common node they get their joint mean velocity. Nodes that two fields
share have the direct solution of `core.body_contact`; nodes that more of them share that of
`core.crowded_nodes`, for all pairs at once.
"""

from dataclasses import dataclass
from itertools import combinations
from math import inf

import numpy as np

from .core.body_contact import BodyPoints, ContactTerms, apply_contact, glue, shares_near
from .core.crowded_nodes import FieldRules, meetings, settle_crowd
from .core.grid import Storage, update
from .explicit import Stepper, scatter

KINDS = "separate", "stick"
MOST_PER_CELL = 10      # particles of GIMP per cell and axis: slopes turn within 1/gimp of a cell


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
    one of `names` or stands there twice, and for a pair that two contacts state.
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
    for k, name in enumerate(names):
        if contacts and name in names[:k]:
            raise ValueError(f"body {name!r}: two bodies have this name; contacts expect one of "
                             "each")
    return rules


def check_contacts(contacts, names, scheme):
    """Raise ValueError for contacts that do not fit the names of bodies, or the scheme."""
    rules_of(contacts, names)
    if not contacts:
        return
    if scheme.precision != "double":
        raise ValueError(f"contact of bodies with precision = {scheme.precision!r}: expected "
                         "'double', which the gap of the bodies needs")
    if scheme.degree == 1:
        raise ValueError("contact of bodies with degree = 1: expected 2 or 3, whose weights have a "
                         "continuous slope, from which the normal is taken")
    if scheme.gimp > MOST_PER_CELL:
        raise ValueError(f"contact of bodies with gimp = {scheme.gimp}: expected at most "
                         f"{MOST_PER_CELL}, since the normal is taken from slopes that turn within "
                         "1/gimp of a cell")
    if scheme.mass_eps:
        raise ValueError(f"contact of bodies with mass_eps = {scheme.mass_eps}: expected 0, since "
                         "each field of bodies would add it once more")


class ContactStepper(Stepper):
    """A `Stepper` of bodies some of which touch by `BodyContact`.

    Its grids are lists, with a `Grid` for each field, which covers the bodies of the field alone.
    Raises ValueError for conditions without `apply_all` (see `core.boundary.Conditions`).
    """

    def __init__(self, contacts, scheme, dx, gravity, conditions=None):
        super().__init__(scheme, dx, len(gravity), gravity, conditions)
        if conditions is not None and not hasattr(conditions, "apply_all"):
            raise ValueError(f"conditions {type(conditions).__name__} with contacts of bodies: "
                             "expected a method apply_all(grids, t, dt), which applies them to the "
                             "grids of all fields, such as that of core.boundary.Conditions")
        self.contacts = tuple(contacts)
        self.stores = {}
        self.rules = None       # `FieldRules`, from `start` or the first step on

    def start(self, bodies):
        """Start as `Stepper.start`. Raises ValueError for contacts that do not fit the bodies."""
        super().start(bodies)
        check_contacts(self.contacts, [body.name for body in bodies], self.scheme)
        self.rules = field_rules(self.contacts, self.fields(bodies))

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
        if self.rules is None:          # of a run that is resumed, which does not `start`
            self.rules = field_rules(self.contacts, self.fields(bodies))
        for k, field in enumerate(self.fields(bodies)):
            if k not in self.stores:
                self.stores[k] = Storage(self.dx, scheme.stencil, len(self.gravity),
                                         flip=scheme.keeps_old_velocity)
            grids.append(scatter(field, self.stores[k], scheme, dt))
            update(grids[-1], self.gravity, dt, on_empty=scheme.gravity_on_empty)
        self.touch(self.parts(grids, bodies), dt)
        return grids

    def touch(self, parts, dt):
        """Change the velocities of the grids where their fields touch in a step of dt [s]; parts
        are those of `parts`.
        """
        grids, rules = [grid for grid, _ in parts], self.rules
        pairs, crowd = meetings(grids)
        shares = self.shares(parts, pairs, crowd)
        for (a, b), nodes in pairs.items():
            if rules.glued[a, b]:
                glue(grids[a], grids[b], nodes)
            else:
                sides = [(grids[k], shares[k]) for k in (a, b)]
                apply_contact(*sides, nodes, ContactTerms(float(rules.mu[a, b]), dt, self.dx))
        if len(crowd.node):
            settle_crowd(grids, crowd, shares, rules, dt)

    def shares(self, parts, pairs, crowd):
        """Return {field: `VolumeShare`} of the fields that are not glued to all others, near the
        nodes of `meetings` at which they may touch.
        """
        glued, nodes = self.rules.glued, {}
        for pair, shared in pairs.items():
            for field, node in zip(pair, shared, strict=True):
                if not glued[pair]:
                    nodes.setdefault(field, []).append(node)
        for field in np.unique(crowd.field):
            if not glued[field].all():
                nodes.setdefault(field, []).append(crowd.node[crowd.field == field])
        return {field: shares_near(np.concatenate(lists), points_of(*parts[field][1]),
                                   parts[field][0], self.scheme.stencil)
                for field, lists in nodes.items()}

    def constrain(self, grids, t, dt):
        """Apply the conditions to all grids, in the step from time t [s] by dt [s]."""
        if self.conditions is not None:
            self.conditions.apply_all(grids, t + dt, dt)

    def update_particles(self, bodies, grids, dt):
        """Update the bodies in place from the grids that `advance_grid` returned for them."""
        for grid, field in self.parts(grids, bodies):
            super().update_particles(field, grid, dt)


def field_rules(contacts, fields):
    """Return the `FieldRules` of fields, lists of bodies; bodies of a contact have one each."""
    rules = rules_of(contacts, [body.name for field in fields for body in field])
    size = 2 * (len(fields),)
    glued, mu = np.ones(size, dtype=np.bool_), np.zeros(size)
    for a, b in combinations(range(len(fields)), 2):
        contact = rules.get(frozenset((fields[a][0].name, fields[b][0].name)))
        if contact is not None and contact.kind == "separate":
            glued[a, b] = glued[b, a] = False
            mu[a, b] = mu[b, a] = contact.friction
    return FieldRules(glued, mu)


def points_of(body):
    """Return the `BodyPoints` of a body."""
    return BodyPoints(body.particles.x, body.particles.V0, body.particles.F)
