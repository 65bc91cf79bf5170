"""When a run is stopped, and when it must not be."""

import numpy as np
import pytest
from small_runs import DX, colliding

from mpm_ref.energy import energy
from mpm_ref.monitor import Unstable, account, runs_away, swing
from mpm_ref.problem import Clock
from mpm_ref.simulate import State, simulate


def run(problem, on_step=None):
    for _ in simulate(problem, on_step=on_step):
        pass


def quiet(**rules):
    """The two blocks at rest, far from each other's reach, without gravity."""
    problem = colliding(Clock(dt=5e-4, steps=200), **rules)
    for body in problem.bodies:
        body.particles.v[:] = 0.0
    problem.gravity[:] = 0.0
    return problem


def test_rest_is_no_alarm():
    problem = quiet()

    def rounding(state, dt):
        state.bodies[0].particles.F[:] *= 1.0 + (-1) ** state.step * 1e-15

    run(problem, rounding)


@pytest.mark.parametrize("factor", [4.0, 30.0, 1e6])
def test_a_run_that_blows_up_says_so_before_the_grid_overflows(factor):
    problem = colliding(Clock(dt=factor * 5e-3, steps=500), allow_unstable=True)
    with pytest.raises(Unstable) as fault:
        run(problem)
    assert fault.value.step <= 100
    assert np.isfinite(fault.value.cfl)


def test_a_fast_body_is_told_in_the_step_after_it_became_fast():
    problem = quiet()

    def kick(state, dt):
        if state.step == 7:
            state.bodies[1].particles.v[:] = 2.0 * DX / dt

    with pytest.raises(Unstable) as fault:
        run(problem, kick)
    assert fault.value.step == 8
    assert fault.value.body == "right"


def test_a_velocity_that_is_not_finite_is_told_in_the_next_step():
    problem = quiet()

    def spoil(state, dt):
        state.bodies[0].particles.v[2] = np.nan

    with pytest.raises(Unstable) as fault:
        run(problem, spoil)
    assert fault.value.step == 2
    assert fault.value.body == "left"


def test_a_state_that_cannot_start_names_its_particle():
    problem = quiet()
    problem.bodies[1].particles.F[5] *= 1e3
    with pytest.raises(Unstable, match=r"step 0.*'right', particle 5.*cannot start") as fault:
        run(problem)
    assert "smaller dt" not in str(fault.value)


def test_runs_away_sees_either_sign_and_nan():
    problem = quiet()
    state, v = State(problem.bodies), problem.bodies[0].particles.v
    assert not runs_away(problem, state, 1e-3)
    for bad in (1.1 * DX / 1e-3, -1.1 * DX / 1e-3, np.nan):
        v[4, 1] = bad
        assert runs_away(problem, state, 1e-3)
    v[4, 1] = 0.9 * DX / 1e-3
    assert not runs_away(problem, state, 1e-3)


def test_body_forces_are_no_gain_from_nothing():
    problem = quiet()
    first = problem.bodies[0]
    driven = first._replace(particles=first.particles._replace(b=np.zeros_like(first.particles.x)))
    assert account(problem, (driven, problem.bodies[1])) is None
    assert account(problem, problem.bodies) is not None


@pytest.mark.parametrize("r", [0.1, 0.53, 0.85])
def test_symplectic_euler_swings_as_far_as_allowed_and_no_farther(r):
    # one spring of frequency w with w dt = 2 r, from the phase of least energy
    energies, x, v, w = [], 1.0, 0.0, 2.0 * r
    for _ in range(20000):
        v -= w * w * x
        x += v
        energies.append(0.5 * (v * v + w * w * x * x))
    most = max(energies) / min(energies) - 1.0
    assert most == pytest.approx(swing(r, 1.0), rel=0.02)


def test_an_energy_gain_is_told():
    problem = colliding(Clock(dt=5e-4, steps=100))
    first = energy(problem.bodies, problem.gravity, problem.inertia).sum

    def push(state, dt):
        for body in state.bodies:
            body.particles.v[:] *= 1.1

    with pytest.raises(Unstable, match="energy exceeds") as fault:
        run(problem, push)
    assert fault.value.step == 20
    assert fault.value.energy > 2.0 * first
