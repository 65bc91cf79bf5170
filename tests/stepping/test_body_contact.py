"""Steps of bodies that touch each other."""

from dataclasses import replace

import numpy as np
import pytest
from problems import DT, DX, JELLY, ball, digest, moving
from threads import by_threads

from mpm_ref.adjoint import StepAdjoint
from mpm_ref.attempt import fault_of
from mpm_ref.body_contact import BodyContact, ContactStepper
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.energy import angular_momentum, energy, momentum
from mpm_ref.energy_budget import EnergyBudget
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import NoFlow
from mpm_ref.oracle.golden_file import require_recordable
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import State, simulate

FLOOR = Collider(half_space((0.0, 0.04), (0.0, 1.0)), "separate", 0.3)
TOUCH = (BodyContact(("left", "right"), 0.3),)
RADIUS = 2.4                # of the disks [cells]
STEPS = 60


def disks(d=2, gap=0.2, speed=2.0, scheme=None, contacts=TOUCH, **keys):
    """Two disks or balls, `gap` cells apart, that meet with twice a speed and spin."""
    scheme = scheme or Scheme(transfer="apic")
    bodies = []
    for name, side in (("left", -1.0), ("right", 1.0)):
        center = np.full(d, 0.31)
        center[0] += side * (RADIUS + 0.5 * gap) * DX
        at = ball(name, center, JELLY, NoFlow(), transfer=scheme.transfer, radius=RADIUS)
        v = np.zeros(d)
        v[0] = -side * speed
        bodies.append(moving(at, v, 5.0))
    keys = {"gravity": np.zeros(d)} | keys
    keys = {"clock": Clock(dt=DT, steps=STEPS)} | keys
    return Problem(tuple(bodies), DX, scheme=scheme, contacts=contacts, **keys)


def run(problem, steps=STEPS):
    """The bodies after some steps, sorted now and then."""
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    for k in range(steps):
        if k % 16 == 0:
            stepper.sort(problem.bodies)
        stepper.step(problem.bodies, k * DT, DT)
    return problem.bodies


def speeds(bodies):
    """Mean velocity of each body along the first axis."""
    return [float(body.particles.v[:, 0].mean()) for body in bodies]


# without contact

def test_a_problem_without_contacts_has_the_stepper_of_one_field():
    assert type(disks(contacts=()).stepper()) is Stepper


@pytest.mark.parametrize("transfer", ["flip", "apic", "mls"])
def test_bodies_that_stick_move_as_in_one_field(d, transfer):
    scheme = Scheme(transfer=transfer)
    stick = (BodyContact(("left", "right"), kind="stick"),)
    ours, one = (run(disks(d, scheme=scheme, contacts=c), 20) for c in (stick, ()))
    for a, b in zip(ours, one, strict=True):
        for name in ("x", "v", "F"):
            x, y = getattr(a.particles, name), getattr(b.particles, name)
            assert x == pytest.approx(y, abs=1e-11 * np.abs(y).max())


def test_bodies_whose_pair_has_no_contact_move_as_in_one_field():
    """A disk that no contact names, on one that meets another later."""
    ours, one = (run(with_third(disks(gap=4.0, contacts=c)), 20) for c in (TOUCH, ()))
    assert ours[2].particles.v[:, 0].max() > 0.5
    for a, b in zip(ours, one, strict=True):
        for name in ("x", "v", "F"):
            x, y = getattr(a.particles, name), getattr(b.particles, name)
            assert x == pytest.approx(y, abs=1e-11 * np.abs(y).max())


def with_third(problem):
    """The problem with a third disk on the left one."""
    center = problem.bodies[0].particles.x.mean(axis=0) + [0.0, 2.0 * RADIUS * DX]
    third = ball("third", center, JELLY, NoFlow(), transfer=problem.scheme.transfer)
    return replace(problem, bodies=(*problem.bodies, third))


# with it

@pytest.mark.parametrize("transfer", ["flip", "apic", "mls"])
def test_momentum_and_angular_momentum_are_kept(d, transfer):
    """The latter by affine transfers; friction turns the disks."""
    problem = disks(d, scheme=Scheme(transfer=transfer))
    about, D = np.full(d, 0.31), problem.inertia
    first = [angular_momentum(problem.bodies, D, about), energy(problem.bodies, np.zeros(d), D).sum]
    left, right = run(problem)
    assert momentum((left, right)) == pytest.approx(0.0, abs=1e-12)
    assert speeds((left, right))[0] < 0.0 < speeds((left, right))[1]
    if transfer != "flip":
        assert angular_momentum((left, right), D, about) == pytest.approx(first[0], abs=1e-10)
    assert energy((left, right), np.zeros(d), D).sum < first[1]


def test_bodies_that_part_are_free_of_each_other():
    """From a distance at which one field would pull them along."""
    problem = disks(gap=0.0, speed=-1.0)
    first = speeds(problem.bodies)
    assert speeds(run(problem, 10)) == pytest.approx(first, rel=1e-9)
    one = speeds(run(disks(gap=0.0, speed=-1.0, contacts=()), 10))
    assert abs(one[0]) < 0.99 * abs(first[0])


def test_bodies_with_a_gap_of_half_a_cell_do_not_feel_each_other():
    problem = disks(gap=0.5, speed=1.0)
    first = speeds(problem.bodies)
    assert speeds(run(problem, 5)) == pytest.approx(first, rel=1e-9)
    assert speeds(run(disks(gap=0.5, speed=1.0, contacts=()), 5))[0] < 0.99 * first[0]


def test_one_and_two_threads_give_the_same_bits(d):
    one, two = by_threads(lambda: digest(run(disks(d), 40)))
    assert one == two


# with conditions, and in runs

@pytest.mark.parametrize("conditions", [Conditions, SurfaceConditions])
def test_impulses_of_conditions_are_those_on_all_fields(conditions):
    """The change of momentum by a floor in one step."""
    problem = disks(gravity=np.array([0.0, -9.8]), conditions=conditions((FLOOR,)))
    for body in problem.bodies:
        body.particles.x[:, 1] -= 0.15
        body.particles.v[:, 1] = -1.0
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    grids = stepper.accelerate(problem.bodies, DT)
    before = [grid.v.copy() for grid in grids]
    J = stepper.conditions.apply_all(grids, DT, DT)
    change = sum((g.m[..., None] * (g.v - v)).sum(axis=(0, 1))
                 for g, v in zip(grids, before, strict=True))
    assert J[0, 1] > 0.0
    assert J[0] == pytest.approx(change, abs=1e-10)


def test_a_run_ends_and_its_grid_is_that_of_both_bodies():
    *_, last = simulate(disks())
    assert last.state.step == STEPS
    assert speeds(last.state.bodies)[0] < 0.0


def test_a_run_that_is_resumed_touches_too():
    """The state after some steps goes on by another stepper, as from a checkpoint: same bits."""
    *_, whole = simulate(disks())
    first = disks(clock=Clock(dt=DT, steps=STEPS // 2))
    *_, half = simulate(first)
    *_, last = simulate(disks(), half.state)
    assert last.state.step == STEPS
    assert digest(last.state.bodies) == digest(whole.state.bodies)


def test_a_fast_body_is_noticed_in_its_own_field():
    problem = disks(speed=0.1)
    stepper, state = problem.stepper(), State(problem.bodies)
    stepper.start(problem.bodies)
    assert fault_of(problem, stepper, state, stepper.advance_grid(problem.bodies, 0.0, DT), DT) \
        is None
    problem.bodies[1].particles.v[:, 0] = 2.0 * DX / DT
    grids = stepper.advance_grid(problem.bodies, 0.0, DT)
    assert "crosses more than" in fault_of(problem, stepper, state, grids, DT)


# what is refused

@pytest.mark.parametrize(("values", "message"), [
    ({"kind": "slip"}, "kind = 'slip': expected one of separate, stick"),
    ({"friction": -1.0}, "expected a finite number >= 0"),
    ({"friction": 0.1, "kind": "stick"}, "only separate rubs"),
    ({"bodies": ("left",)}, "expected two bodies or more"),
    ({"bodies": ("left", "left")}, "body 'left' stands there twice"),
])
def test_wrong_contacts_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        BodyContact(**{"bodies": ("left", "right")} | values)


def test_contacts_that_do_not_fit_the_bodies_are_refused():
    with pytest.raises(ValueError, match="body 'other': there is none of this name"):
        disks(contacts=(BodyContact(("left", "other")),))
    with pytest.raises(ValueError, match="two contacts name this pair"):
        disks(contacts=(*TOUCH, BodyContact(("right", "left"))))
    with pytest.raises(ValueError, match="degree = 1: expected 2 or 3"):
        disks(scheme=Scheme(1, "flip"))
    with pytest.raises(ValueError, match=r"gimp = 11\.0: expected at most 10"):
        disks(scheme=Scheme(transfer="flip", gimp=11.0))
    with pytest.raises(ValueError, match=r"mass_eps = 0\.001: expected 0, since each"):
        disks(scheme=Scheme(mass_eps=1e-3))
    stepper = ContactStepper((BodyContact(("left", "other")),), Scheme(), DX, np.zeros(2))
    with pytest.raises(ValueError, match="there is none of this name"):
        stepper.start(disks(scheme=Scheme()).bodies)


def test_two_bodies_of_one_name_are_refused():
    """A contact could not tell which it means; without one they pass."""
    left, right = disks().bodies
    bodies = left, right, right
    with pytest.raises(ValueError, match="body 'right': two bodies have this name"):
        replace(disks(), bodies=bodies)
    stepper = ContactStepper(TOUCH, Scheme(transfer="apic"), DX, np.zeros(2))
    with pytest.raises(ValueError, match="two bodies have this name"):
        stepper.start(bodies)
    assert replace(disks(contacts=()), bodies=bodies).contacts == ()


def test_conditions_of_a_single_grid_are_refused():
    """When the stepper is made, not in its first step; without contacts they serve."""
    class Still:
        def apply(self, grid, t, dt):
            grid.v[:] = 0.0

    with pytest.raises(ValueError, match="conditions Still with contacts of bodies: expected a "
                                         "method apply_all"):
        disks(conditions=Still()).stepper()
    assert speeds(run(disks(conditions=Still(), contacts=()), 2)) == pytest.approx([0.0, 0.0])


def test_implicit_steps_and_budgets_are_refused():
    with pytest.raises(ValueError, match="contacts with the integrator 'implicit': expected 'expl"):
        disks(integrator="implicit")
    with pytest.raises(ValueError, match="energy budget with contacts of bodies"):
        disks(budget=EnergyBudget())


def test_adjoints_and_golden_files_are_refused():
    with pytest.raises(ValueError, match="contact of bodies has no adjoint"):
        StepAdjoint(disks().stepper())
    with pytest.raises(ValueError, match="golden files have one velocity field"):
        require_recordable(disks())
