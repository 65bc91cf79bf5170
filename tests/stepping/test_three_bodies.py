"""Steps of three bodies that touch each other at common nodes, against the plain twin."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from grids import over
from problems import DT, DX, JELLY, ball, digest, moving
from threads import by_threads

from mpm_ref.body import Body, particles_at
from mpm_ref.body_contact import BodyContact, ContactStepper
from mpm_ref.core.body_contact import shared_nodes
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.crowded_nodes import crowd_solution, meetings
from mpm_ref.core.levelset import half_space
from mpm_ref.energy import angular_momentum, energy, momentum
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow
from mpm_ref.plain.body_contact import touching_velocities, volume_share
from mpm_ref.plain.boundary import Contact, apply_contacts
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.transfer import box_of
from mpm_ref.problem import Clock, Problem

RADIUS = 2.4                # of the disks [cells]
NAMES = "left", "right", "top"
PAIRS = ("left", "right"), ("left", "top"), ("right", "top")
ALL = (BodyContact(NAMES, 0.3),)
STEPS = 30
HEIGHT = 0.21               # of the lower disks [m]
CASES = {
    "all touch": (ALL, dict.fromkeys(PAIRS, 0.3)),
    "without friction": ((BodyContact(NAMES),), dict.fromkeys(PAIRS, 0.0)),
    "two stick": ((BodyContact(("left", "right"), 0.5), BodyContact(("right", "top"), 0.1),
                   BodyContact(("left", "top"), kind="stick")),
                  {("left", "right"): 0.5, ("right", "top"): 0.1}),
    "one is not named": ((BodyContact(("left", "right"), 0.3),), {("left", "right"): 0.3}),
}


def triangle(d=2, contacts=ALL, order=(0, 1, 2), gap=0.1, **keys):
    """Three disks or balls at the corners of a triangle, `gap` cells apart, that spin and fly at
    its centre; the bodies in some order.
    """
    side, bodies = (2.0 * RADIUS + gap) * DX, []
    corners = np.full((3, d), 0.31)
    corners[:, :2] = (0.3, HEIGHT), (0.3 + side, HEIGHT), (0.3 + 0.5 * side,
                                                          HEIGHT + 0.75**0.5 * side)
    for name, center in zip(NAMES, corners, strict=True):
        v = corners.mean(axis=0) - center
        one = ball(name, center, JELLY, NoFlow(), transfer="apic", radius=RADIUS)
        bodies.append(moving(one, 2.0 * v / np.linalg.norm(v), 5.0))
    keys = {"gravity": np.zeros(d)} | keys
    return Problem(tuple(bodies[k] for k in order), DX, Clock(dt=DT, steps=STEPS),
                   scheme=Scheme(transfer="apic"), contacts=contacts, **keys)


def run(problem, steps=STEPS):
    """The stepper and the bodies after some steps."""
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    for k in range(steps):
        stepper.step(problem.bodies, k * DT, DT)
    return stepper, problem.bodies


class Watched(ContactStepper):
    """A stepper that keeps masses and velocities of its grids as they were before contact."""

    def touch(self, parts, dt):
        self.before = [(grid.m.copy(), grid.v.copy()) for grid, _ in parts]
        super().touch(parts, dt)


def watched(problem, steps):
    """A `Watched` stepper of a problem, and its bodies after some steps."""
    stepper = Watched(problem.contacts, problem.scheme, DX, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    for k in range(steps):
        stepper.step(problem.bodies, k * DT, DT)
    return stepper, problem.bodies


def plain_velocities(stepper, bodies, grids, friction):
    """Nodal masses and velocities of fields after contact by the plain twin, from those that a
    `Watched` stepper has noted, those before, and their box.
    """
    fields = stepper.fields(bodies)
    ips = [[pairs(body.particles.x, DX, 2) for body in field] for field in fields]
    box = box_of(*(ip for field in ips for ip in field))
    m, v = ([over(grid, before[k], box) for grid, before in zip(grids, stepper.before, strict=True)]
            for k in range(2))
    shares = [[volume_share(body.particles.V0 * np.linalg.det(body.particles.F), ip, box, DX)
               for body, ip in zip(*field, strict=True)] for field in zip(fields, ips, strict=True)]
    shares = [tuple(map(sum, zip(*field, strict=True))) for field in shares]
    names = [field[0].name for field in fields]
    rules = {tuple(sorted(map(names.index, pair))): mu for pair, mu in friction.items()}
    return m, touching_velocities(m, v, shares, rules, (DT, DX)), v, box


# against the plain twin

@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_velocities_are_those_of_the_plain_twin(d, case, order):
    contacts, friction = CASES[case]
    stepper, bodies = watched(triangle(d, contacts, order), 12)
    grids = stepper.accelerate(bodies, DT)
    m, expected, before, box = plain_velocities(stepper, bodies, grids, friction)
    _, crowd = meetings(grids)
    assert len(crowd.start) > 5
    largest = max(np.abs(mass[..., None] * u).max() for mass, u in zip(m, expected, strict=True))
    for grid, mass, u, v in zip(grids, m, expected, before, strict=True):
        change = over(grid, grid.v, box) - u
        assert mass[..., None] * change == pytest.approx(0.0, abs=1e-11 * largest)
        assert change == pytest.approx(0.0, abs=1e-8 * np.abs(u).max())
        assert np.abs(u - v).max() > 0.1


@pytest.mark.parametrize("kind", ["sticky", "separate"])
def test_conditions_follow_contact(kind):
    """They act on each field, and come last: fields move with a sticky floor, whatever contact
    did.
    """
    height = 0.2
    floor = Collider(half_space((0.0, height), (0.0, 1.0)), kind, 0.0 if kind == "sticky" else 0.3)
    problem = triangle(gap=-0.5, conditions=Conditions((floor,)), gravity=np.array([0.0, -9.8]))
    for body in problem.bodies:
        body.particles.v[:, 1] -= 3.0
    stepper, bodies = watched(problem, 0)
    grids, shared = stepper.advance_grid(bodies, 0.0, DT), 0
    m, expected, before, box = plain_velocities(stepper, bodies, grids, CASES["all touch"][1])
    for k, grid in enumerate(grids):
        touched = [tuple(i) for i in np.argwhere(m[k] > 0.0)
                   if (i[1] + box.first[1]) * DX <= height + 1e-9 * DX]
        contact = Contact(np.array([0.0, 1.0]), np.zeros(2), kind, floor.friction)
        after = apply_contacts(expected[k], {i: [contact] for i in touched})
        assert over(grid, grid.v, box) == pytest.approx(after, abs=1e-9)
        shared += sum(np.abs(after[i] - expected[k][i]).max() > 0.1
                      and np.abs(expected[k][i] - before[k][i]).max() > 0.1 for i in touched)
    assert shared > 2


# whole steps

def test_the_order_of_bodies_does_not_matter(d):
    """But for the tolerance of the sweeps: momenta of nodes are those of another order."""
    _, bodies = run(triangle(d), 12)
    momenta = []
    for order in permutations(range(3)):
        stepper = triangle(d).stepper()
        reordered = [bodies[k] for k in order]
        stepper.start(reordered)
        grids = stepper.accelerate(reordered, DT)
        momenta.append({body.name: grid.m[..., None] * grid.v
                        for body, grid in zip(reordered, grids, strict=True)})
    for name in NAMES:
        p = momenta[0][name]
        for other in momenta[1:]:
            assert other[name] == pytest.approx(p, abs=1e-9 * np.abs(p).max())


def test_three_bodies_bounce_off_each_other():
    """Where two of them stick, or all, some part at half of the speed, or not yet."""
    bodies = run(triangle(gap=0.4), 80)[1]
    assert momentum(bodies) == pytest.approx(0.0, abs=1e-12)
    assert parting(bodies).min() > 2.0
    for pair in PAIRS:
        others = [BodyContact(other, 0.3) for other in PAIRS if other != pair]
        stuck = triangle(contacts=(*others, BodyContact(pair, kind="stick")), gap=0.4)
        assert parting(run(stuck, 80)[1]).min() < 1.5
    stuck = triangle(contacts=(BodyContact(NAMES, kind="stick"),), gap=0.4)
    assert parting(run(stuck, 80)[1]).max() < 0.0


def parting(bodies):
    """Speeds at which the bodies of each pair leave each other [m/s]."""
    x, v = ({body.name: getattr(body.particles, key).mean(axis=0) for body in bodies}
            for key in ("x", "v"))
    r, w = (np.array([a[two] - a[one] for one, two in PAIRS]) for a in (x, v))
    return (w * r).sum(axis=1) / np.linalg.norm(r, axis=1)


def test_momentum_and_its_moment_are_kept_and_energy_does_not_grow(d):
    problem = triangle(d)
    about, D = np.full(d, 0.31), problem.inertia
    first = [momentum(problem.bodies), angular_momentum(problem.bodies, D, about),
             energy(problem.bodies, np.zeros(d), D).sum]
    _, bodies = run(problem, 60)
    assert momentum(bodies) == pytest.approx(first[0], abs=1e-12)
    assert angular_momentum(bodies, D, about) == pytest.approx(first[1], abs=1e-10)
    assert energy(bodies, np.zeros(d), D).sum < first[2]


def test_one_and_two_threads_give_the_same_bits(d):
    one, two = by_threads(lambda: digest(run(triangle(d), 20)[1]))
    assert one == two


def test_bodies_that_are_glued_to_a_third_one_do_not_rub():
    """A disk that no contact names glues two that touch, where all three share nodes."""
    problem = triangle(contacts=CASES["one is not named"][0])
    stepper, bodies = run(problem, 5)
    grids = stepper.accelerate(bodies, DT)
    _, crowd = meetings(grids)
    for k in range(len(crowd.start) - 1):
        ends = slice(crowd.start[k], crowd.start[k + 1])
        v = [grids[f].v.reshape(-1, 2)[i]
             for f, i in zip(crowd.field[ends], crowd.node[ends], strict=True)]
        assert np.ptp(v, axis=0) == pytest.approx(0.0, abs=1e-12)


# the gap

def test_space_of_a_third_body_is_no_gap():
    """Two blocks side by side on a third one, flush: they do not approach each other at the nodes
    where all three meet.
    """
    stepper, bodies = junction(0.0)
    _, left, right = stepper.accelerate(bodies, DT)
    nodes = shared_nodes(left, right)
    x, y = np.unravel_index(nodes.first, left.m.shape) + left.origin[:, None]
    corner = (x == 4) & (y >= 3) & (y <= 5)
    assert corner.sum() == 3
    v, u = (grid.v.reshape(-1, 2)[at][corner, 0]
            for grid, at in zip((left, right), nodes, strict=True))
    assert v == pytest.approx(u, abs=1e-9)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_bodies_that_fill_all_space_have_no_gap(shift):
    stepper, bodies = junction(shift)
    grids = stepper.accelerate(bodies, DT)
    parts = stepper.parts(grids, bodies)
    alone, crowd = meetings(grids)
    shares = stepper.shares(parts, alone, crowd)
    _, three = crowd_solution(grids, crowd, shares, stepper.rules, DT)
    assert len(three.gap) > 10
    assert three.gap == pytest.approx(0.0, abs=1e-9)


def junction(shift):
    """Two blocks that fly at each other, flush, on a third one at rest."""
    h, bodies = 0.5 * DX, []
    for name, low, high, speed in (("floor", (0.0, 0.0), (8.0, 4.0), 0.0),
                                   ("left", (0.0, 4.0), (4.0, 8.0), 0.5),
                                   ("right", (4.0, 4.0), (8.0, 8.0), -0.5)):
        axes = [DX * shift + DX * np.arange(a, b, 0.5) + 0.5 * h
                for a, b in zip(low, high, strict=True)]
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        V = np.full(len(x), h**2)
        q = particles_at(x, np.zeros_like(x), 1e3 * V, V, "apic")
        one = Body(name, q, JELLY, NoFlow(), np.arange(len(x)))
        bodies.append(moving(one, (speed, 0.0)))
    problem = replace(triangle(), bodies=tuple(bodies),
                      contacts=(BodyContact(("floor", "left", "right")),))
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    return stepper, problem.bodies
