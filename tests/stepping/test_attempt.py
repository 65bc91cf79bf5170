"""Steps that fail their checks are made shorter, before a particle is changed."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from small_runs import DX, block, colliding
from threads import by_threads

from mpm_ref import attempt
from mpm_ref.attempt import HALVINGS, fault_of, take_step
from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Conditions, Prescribed
from mpm_ref.core.displacement import largest_speed, speed_bound
from mpm_ref.core.levelset import half_space
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.methods import options_of
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.monitor import Unstable
from mpm_ref.problem import Clock
from mpm_ref.simulate import State, simulate, start
from mpm_ref.store import checkpoint
from mpm_ref.store.checkpoint import digest
from mpm_ref.store.results import Results
from mpm_ref.store.running import Options, run

ADAPTIVE = Clock(end=0.03, interval=0.005)


def grabbed(clock=ADAPTIVE, speed=40.0, **rules):
    """The two blocks, the left one of which is pulled down, all of it, from 0.02 s to 0.0225 s."""
    shape = half_space((0.46, 0.0), (1.0, 0.0))
    pull = Motion(translation=Steady((0.0, -speed), start=0.02, stop=0.0225))
    part = Prescribed(shape, pull, since=0.02, until=0.0225)
    return colliding(clock, conditions=Conditions(prescribed=(part,)), **rules)


def last(problem, **more):
    *_, frame = simulate(problem, **more)
    return frame


def test_a_step_that_moves_a_particle_too_far_is_made_shorter():
    lengths = []
    frame = last(grabbed(), on_step=lambda state, dt: lengths.append((state.t, dt)))
    assert 1 <= frame.state.rejected <= HALVINGS
    assert frame.t == pytest.approx(0.03)
    x = frame.state.bodies[0].particles.x - grabbed().bodies[0].particles.x
    assert x[:, 1].mean() == pytest.approx(-0.4, abs=0.01)     # pulled 0.1 m, then free
    assert max(dt for t, dt in lengths if t > 0.0205) * 40.0 <= DX


def test_a_run_without_faults_counts_none():
    assert last(colliding(ADAPTIVE)).state.rejected == 0


def test_a_rejected_step_leaves_particles_as_they_were():
    problem = grabbed()
    stepper, state = problem.stepper(), State(problem.bodies, t=0.02, bound=inf)
    stepper.start(state.bodies)
    before = [a.copy() for body in state.bodies for a in body.particles]
    grid = stepper.advance_grid(state.bodies, state.t, 2e-3)
    assert "crosses more than 1 dx" in fault_of(problem, stepper, state, grid, 2e-3)
    after = [a for body in state.bodies for a in body.particles]
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    grid = stepper.advance_grid(state.bodies, state.t, 1e-3)
    assert fault_of(problem, stepper, state, grid, 1e-3) is None


def test_same_bits_for_any_number_of_threads():
    digests = by_threads(lambda: digest(last(grabbed()).state))
    assert digests[0] == digests[1]


def test_same_bits_across_an_interruption(tmp_path):
    whole = run(grabbed(), tmp_path / "whole.h5")
    assert whole.state.rejected > 0
    for steps in range(1, whole.state.step):
        run(grabbed(), tmp_path / "part.h5", Options(steps=steps, resume=True))
    rest = run(grabbed(), tmp_path / "part.h5", Options(resume=True))
    assert digest(rest.state) == digest(whole.state)
    assert rest.state.rejected == whole.state.rejected
    with Results(tmp_path / "part.h5") as results:
        assert results.manifest["parts"][-1]["rejected"] == whole.state.rejected


def capped():
    """The blocks, implicit, with a solver that gives up early, for fast blocks."""
    bodies = tuple(body._replace(particles=body.particles._replace(
        v=4.0 * body.particles.v, C=0.0 * body.particles.L.copy())) for body in colliding().bodies)
    return replace(colliding(Clock(dt=0.01, steps=6, every=1)), bodies=bodies,
                   scheme=Scheme(transfer="apic"), integrator="implicit",
                   solver=options_of("hot", max_iterations=6))


def test_a_fixed_step_that_is_not_solved_is_made_in_equal_parts():
    times = []
    frames = list(simulate(capped(), on_step=lambda state, dt: times.append((state.t, dt))))
    assert frames[-1].state.rejected > 0
    assert [t for t, _ in times] == [0.01 * k for k in range(1, 7)]
    assert min(dt for _, dt in times) in [0.01 / 2**k for k in range(1, HALVINGS + 1)]
    assert frames[-1].state.solve.converged


class Recorder:
    """A stepper that notes the parts of a step, from t to t + dt."""

    implicit, report = True, None

    def __init__(self):
        self.tried, self.parts = None, []

    def advance_grid(self, bodies, t, dt):
        self.tried = t, dt

    def update_particles(self, bodies, grid, dt):
        self.parts.append(self.tried)


@pytest.mark.parametrize(("clock", "parts", "rejected"), [
    (Clock(dt=1.0, steps=1), [(0.0, 0.5), *((0.5 + k / 8, 0.125) for k in range(4))], 3),
    (Clock(end=1.0), [(0.0, 0.5)], 1),
], ids=["fixed dt", "adaptive dt"])
def test_parts_follow_each_other(monkeypatch, clock, parts, rejected):
    """At first a half is short enough, later an eighth."""
    def fault(problem, stepper, state, grid, dt):
        return "too long" if dt > (0.5 if stepper.tried[0] < 0.5 else 0.125) else None

    monkeypatch.setattr(attempt, "fault_of", fault)
    problem, stepper = colliding(clock), Recorder()
    state = State(problem.bodies)
    assert take_step(problem, stepper, state, 1.0) == parts[-1][1]
    assert stepper.parts == parts
    assert state.rejected == rejected


def test_a_step_that_fails_at_every_length_ends_the_run():
    problem = replace(capped(), solver=options_of("pn-pcg", max_iterations=0, eps=1e-12))
    state = start(problem, problem.stepper())
    with pytest.raises(Unstable, match=r"was not solved.*also with dt = 3\.91e-05 s"):
        last(problem, state=state)
    assert state.rejected == HALVINGS


def test_an_explicit_step_past_its_bound_is_not_tried_again():
    problem, states = colliding(Clock(dt=0.02, steps=500), allow_unstable=True), []
    with pytest.raises(Unstable):
        last(problem, on_step=lambda state, dt: states.append(state))
    assert states[-1].rejected == 0


def test_particles_too_fast_for_a_fixed_step_are_not_tried_again():
    states = []

    def kick(state, dt):
        states.append(state)
        if state.step == 3:
            state.bodies[0].particles.v[:] = 2.0 * DX / dt

    with pytest.raises(Unstable) as fault:
        last(colliding(Clock(dt=5e-4, steps=20)), on_step=kick)
    assert fault.value.step == 4
    assert states[-1].rejected == 0


def cloud(d, transfer, seed):
    """Particles at random places with random velocities."""
    rng = np.random.default_rng(seed)
    x, v = rng.uniform(0.0, 4.0 * DX, (50, d)), rng.standard_normal((50, d))
    return Body(f"cloud {seed}", particles_at(x, v, np.ones(50), np.ones(50), transfer),
                make_law("fixed_corotated", E=1.0, nu=0.3), NoFlow(), np.arange(50))


def naive_speeds(bodies, grid, scheme):
    """The largest speed after the step, by making it."""
    copies = tuple(body._replace(particles=type(body.particles)(*(
        a.copy() for a in body.particles))) for body in bodies)
    stepper = Stepper(scheme, grid.dx, grid.m.ndim, np.zeros(grid.m.ndim))
    stepper.update_particles(copies, grid, 1e-3)
    moved = [np.linalg.norm(new.particles.x - old.particles.x, axis=1).max() / 1e-3
             for new, old in zip(copies, bodies, strict=True)]
    return max(*moved, *(np.linalg.norm(body.particles.v, axis=1).max() for body in copies))


@pytest.mark.parametrize("transfer", ["flip", "apic"])
@pytest.mark.parametrize("d", [2, 3])
def test_speeds_are_those_after_the_step(transfer, d):
    scheme = Scheme(transfer=transfer, flip=0.9)
    bodies = cloud(d, transfer, 1), cloud(d, transfer, 2)
    stepper = Stepper(scheme, DX, d, np.linspace(1.0, -9.8, d))
    stepper.start(bodies)
    grid = stepper.advance_grid(bodies, 0.0, 1e-3)
    speed = max(largest_speed(b.particles, grid, scheme.stencil, scheme.flip) for b in bodies)
    assert speed == pytest.approx(naive_speeds(bodies, grid, scheme), rel=1e-9)
    assert speed <= speed_bound(grid, bodies)
    grid.v[grid.m > 0.0] = np.nan
    assert largest_speed(bodies[0].particles, grid, scheme.stencil, scheme.flip) == inf


def test_counts_are_saved(tmp_path):
    problem = colliding()
    state = State((block("left", (0.2, 0.5), (1.0, 0.0)), problem.bodies[1]), step=2, bound=1.0,
                  rejected=7, stalled=3)
    checkpoint.save(tmp_path / "a.checkpoint.h5", state, problem)
    loaded, _ = checkpoint.load(tmp_path / "a.checkpoint.h5", problem)
    assert (loaded.rejected, loaded.stalled) == (7, 3)
