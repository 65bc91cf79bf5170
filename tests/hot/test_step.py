"""The implicit step as a whole: against the explicit one, and what backward Euler must do."""

from dataclasses import replace

import numpy as np
import pytest
from threads import by_threads

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Collider, Conditions, Prescribed
from mpm_ref.core.levelset import half_space
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.energy import angular_momentum, energy, momentum
from mpm_ref.explicit import Scheme, Stepper, scatter
from mpm_ref.hot.methods import options_of
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.monitor import Unstable
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import State, next_dt, simulate, swiftest

DX, RHO, SIDE = 0.1, 1000.0, 6
TIGHT = options_of("pn-pcg", eps=1e-11)
NOTHING = np.zeros(2)
D = DX**2 / 4       # of the affine motion


def block(E=1e5, v=None, low=(0.2, 0.2)):
    """A square of 6 x 6 particles, 2 x 2 in a cell, whose corner is at `low`."""
    x = np.stack(np.meshgrid(*[np.arange(SIDE)] * 2, indexing="ij"), -1).reshape(-1, 2) * DX / 2
    x = x + np.array(low) + DX / 4
    V0 = np.full(len(x), DX**2 / 4)
    v = np.zeros_like(x) if v is None else v(x)
    particles = particles_at(x, v, RHO * V0, V0, "apic")
    return Body("block", particles, make_law("fixed_corotated", E=E, nu=0.3), NoFlow(),
                np.arange(len(x)))


def squeezed(x):
    """Velocities of a block that contracts along one axis and shears."""
    r = x - x.mean(axis=0)
    return r @ np.array([[-2.0, 0.0], [1.5, 0.5]])


def stepped(body, dt, steps=1, gravity=NOTHING, conditions=None, options=TIGHT):
    """The body after some implicit steps, and the stepper."""
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, 2, gravity, conditions, options)
    stepper.start([body])
    for k in range(steps):
        stepper.step([body], k * dt, dt)
    return body, stepper


def test_approaches_the_explicit_step_at_second_order_in_one_step():   # HOT-sec3.1-seq
    def apart(dt):
        implicit, _ = stepped(block(v=squeezed), dt)
        explicit = block(v=squeezed)
        stepper = Stepper(Scheme(transfer="apic"), DX, 2, NOTHING)
        stepper.start([explicit])
        stepper.step([explicit], 0.0, dt)
        return np.abs(implicit.particles.v - explicit.particles.v).max()

    errors = [apart(dt) for dt in (4e-4, 2e-4, 1e-4)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(rates - 2.0) < 0.1), rates


def test_energy_never_rises_and_momentum_is_kept():
    body = block(v=squeezed)
    before, p = [energy([body], NOTHING, D).sum], momentum([body])
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, 2, NOTHING, None, TIGHT)
    stepper.start([body])
    for k in range(20):
        stepper.step([body], k * 0.01, 0.01)
        assert stepper.report.converged, stepper.report.message
        before.append(energy([body], NOTHING, D).sum)
    assert np.all(np.diff(before) <= 1e-12 * before[0])
    scale = np.sum(body.particles.m) * 0.1
    assert np.allclose(momentum([body]), p, atol=1e-7 * scale)


def test_angular_momentum_is_lost_at_first_order():
    """Backward Euler changes it by dt sum_i m_i v_i^{n+1} x v_i^n in a step."""
    def lost(steps):
        body, _ = stepped(block(v=squeezed), 0.02 / steps, steps)
        return abs(angular_momentum([body], D) - angular_momentum([block(v=squeezed)], D))[0]

    rate = np.log2(lost(40) / lost(80))
    assert 0.8 < rate < 1.2


@pytest.mark.parametrize("start", ["zero", "gravity"])
def test_free_fall_is_exact(start):
    g, dt = np.array([0.3, -9.8]), 0.02
    body, stepper = stepped(block(), dt, 3, g, options=replace(TIGHT, start=start))
    assert np.allclose(body.particles.v, 3 * dt * g, rtol=1e-10)
    assert (stepper.report.iterations > 0) == (start == "zero")


def test_at_rest_there_is_nothing_to_do():
    body, stepper = stepped(block(), 0.1)
    assert stepper.report.converged
    assert stepper.report.iterations == 0
    assert not body.particles.v.any()


def test_step_is_the_accepted_minimiser():
    body = block(v=squeezed)
    seen = []
    stepper = ImplicitStepper(Scheme(transfer="apic"), DX, 2, NOTHING, None, TIGHT)
    solve = stepper.solve
    stepper.solve = lambda pose: seen.append(solve(pose)) or seen[-1]
    stepper.start([body])
    grid = stepper.step([body], 0.0, 0.01)
    full = grid.m > 0.0
    old = block(v=squeezed)
    other = Stepper(Scheme(transfer="apic"), DX, 2, NOTHING)
    other.start([old])
    before = other_velocity(old, other)
    assert np.array_equal(grid.v[full], before + seen[0])
    assert stepper.report.residuals[-1] <= TIGHT.eps


def other_velocity(body, stepper):
    """Velocities of the nodes with mass before the step."""
    grid = scatter([body], stepper.storage, stepper.scheme, 0.0)
    full = grid.m > 0.0
    return grid.v[full] / grid.m[full][:, None]


@pytest.mark.parametrize("kind", ["sticky", "slip", "separate"])
def test_block_on_a_floor_comes_to_rest(kind):
    floor = Collider(half_space((0.0, 0.2), (0.0, 1.0)), kind)
    g, conditions = np.array([0.0, -9.8]), Conditions((floor,))
    body, stepper = stepped(block(), 0.02, 60, g, conditions, options_of("pn-pcg", eps=1e-9))
    assert stepper.report.converged
    assert np.abs(body.particles.v).max() < 1e-3
    assert abs(body.particles.x[:, 0].mean() - 0.35) < 1e-6


def test_block_leaves_a_separate_floor_but_not_a_slip_one():
    away = {}
    for kind in ("slip", "separate"):
        floor = Collider(half_space((0.0, 0.2), (0.0, 1.0)), kind)
        up = block(v=lambda x: np.full_like(x, [0.0, 1.0]))
        body, _ = stepped(up, 0.01, 10, NOTHING, Conditions((floor,)))
        away[kind] = body.particles.x[:, 1].min()
    assert np.isclose(away["separate"], 0.225 + 0.1, rtol=1e-6)
    assert away["slip"] < 0.3


def test_same_bits_for_any_number_of_threads():
    def particles():
        floor = Conditions((Collider(half_space((0.0, 0.2), (0.0, 1.0)), "separate"),))
        body, _ = stepped(block(v=squeezed), 0.01, 3, np.array([0.0, -9.8]), floor)
        return body.particles

    assert all(np.array_equal(a, b) for a, b in zip(*by_threads(particles), strict=True))


def problem_of(**changes):
    return Problem((block(v=squeezed),), DX, Clock(dt=0.01, steps=3), NOTHING,
                   Scheme(transfer="apic"), integrator="implicit", **changes)


def test_solve_that_does_not_converge_ends_the_run():
    capped = problem_of(solver=options_of("pn-pcg", max_iterations=1, eps=1e-12))
    with pytest.raises(Unstable, match="the implicit step was not solved: 1 iterations, the cap"):
        list(simulate(capped))
    frames = list(simulate(replace(capped, bodies=(block(v=squeezed),), allow_unstable=True)))
    assert not frames[-1].state.solve.converged


def test_large_steps_are_allowed_and_follow_the_speed():               # HOT-cfl, HOT-dt
    clock = Clock(cfl=0.6, end=0.3, longest=0.05)
    frames = list(simulate(replace(problem_of(), clock=clock)))
    assert frames[-1].dt == pytest.approx(0.05)
    slow = replace(clock, cfl=0.05)
    first = next(f for f in simulate(replace(problem_of(), clock=slow)) if f.dt)
    assert first.dt < 0.05


@pytest.mark.parametrize(("low", "moves"), [((0.3, -9.0), True), ((3.0, -9.0), False)])
def test_steps_follow_the_speed_of_what_drives_them(low, moves):       # HOT-dt
    beyond = half_space(low, (-1.0, 0.0))
    clock = Clock(cfl=0.5, end=1.0, longest=0.5)
    for motion, speed in ((Motion(translation=Steady((2.0, 0.0))), 2.0), (Motion(), 0.0)):
        held = Conditions(prescribed=(Prescribed(beyond, motion),))
        problem = replace(problem_of(), bodies=(block(),), clock=clock, conditions=held)
        state = State(problem.bodies)
        dt = next_dt(clock, state, swiftest(problem, problem.stepper(), state))
        expected = 0.5 * DX / speed if speed and moves else 0.5
        assert dt == pytest.approx(expected)


def test_what_has_no_implicit_form_is_refused():
    with pytest.raises(ValueError, match="f_bar = true with an implicit integrator"):
        ImplicitStepper(Scheme(transfer="apic", f_bar=True), DX, 2, NOTHING)
    with pytest.raises(ValueError, match=r"gimp = 2.0 with an implicit integrator: its matrices"):
        ImplicitStepper(Scheme(transfer="flip", gimp=2.0), DX, 2, NOTHING)
    body = block()
    driven = body._replace(particles=body.particles._replace(b=np.zeros((SIDE**2, 2))))
    with pytest.raises(ValueError, match="has body forces b of its own"):
        stepped(driven, 0.01)
    with pytest.raises(ValueError, match="integrator = 'hop'"):
        list(simulate(replace(problem_of(), integrator="hop")))
