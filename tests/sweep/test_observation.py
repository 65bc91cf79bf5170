import numpy as np
import pytest
from sweep_scenes import BOUNCE, FLIGHT, observed_run, scene_of

from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate
from mpm_ref.sweep import observation
from mpm_ref.sweep.observation import REFUSED, STOPPED, UNSTABLE, observe
from mpm_ref.sweep.probes import initial_order


def test_free_flight_follows_the_parabola():
    run = observed_run(loads("dt = 0.0005" + FLIGHT), ("positions", "centroid"), n=7)
    done, t = observe(run), np.array(run.times)[:, None]
    assert done.finished
    start = np.concatenate([X for _, X in run.probes])
    exact = start[None] + (t * [1.0, 0.5] - 0.5 * t**2 * [0.0, 9.8])[:, None]
    # symplectic Euler falls by g t dt / 2 further
    assert done.values["positions"] == pytest.approx(exact.reshape(len(t), -1), abs=6e-4)
    assert done.until == pytest.approx(0.2)


def test_observing_does_not_change_the_run():
    scene = scene_of(BOUNCE)
    last = observe(observed_run(scene, ("centroid", "impulse:floor"))).values["centroid"][-1]
    problem = build(scene)
    for _ in simulate(problem):
        pass
    x, m = initial_order(problem.bodies[0]), problem.bodies[0].particles.m
    assert last == pytest.approx(m @ x / m.sum(), abs=1e-15)


def test_between_steps_values_are_interpolated():
    scene = loads("dt = 0.004" + FLIGHT)
    coarse = observe(observed_run(scene, ("centroid",), n=8)).values["centroid"]
    steps = observe(observed_run(scene, ("centroid",), n=51)).values["centroid"]
    t = np.linspace(0.0, 0.2, 8)
    for axis in range(2):
        assert coarse[:, axis] == pytest.approx(
            np.interp(t, np.linspace(0.0, 0.2, 51), steps[:, axis]), abs=1e-13)


def test_cost_counts_steps_particles_and_time():
    done = observe(observed_run(loads("dt = 0.002" + FLIGHT)))
    assert done.cost.steps == 100
    assert done.cost.particles == len(build(scene_of(FLIGHT)).bodies[0].id)
    assert 0.0 < done.cost.cpu < 60.0
    assert done.cost.memory > 8 * 100


def test_a_run_past_its_cpu_time_is_stopped():
    done = observe(observed_run(scene_of(FLIGHT), most_cpu=0.0))
    assert (done.outcome, done.finished) == (STOPPED, False)
    assert np.isfinite(done.values["positions"][0]).all()
    assert np.isnan(done.values["positions"][-1]).all()


def test_an_unstable_run_says_where():
    done = observe(observed_run(loads('dt = 0.05\nunstable = "allow"' + BOUNCE)))
    assert done.outcome == UNSTABLE
    assert "unstable at step" in done.message


def test_a_step_past_its_bound_is_refused():
    done = observe(observed_run(loads("dt = 0.05" + BOUNCE)))
    assert done.outcome == REFUSED
    assert "past the stable time step" in done.message


def test_a_seed_perturbs_positions_by_round_off():
    a = observe(observed_run(scene_of(BOUNCE))).values["positions"]
    b = observe(observed_run(scene_of(BOUNCE), seed=1)).values["positions"]
    c = observe(observed_run(scene_of(BOUNCE), seed=1)).values["positions"]
    assert (b == c).all()
    assert 0.0 < np.abs(a - b)[0].max() < 1e-10
    assert np.abs(a - b).max() < 1e-3       # a count of steps may differ by one


def test_a_stop_ends_the_run(monkeypatch):
    monkeypatch.setattr(observation, "stop_asked", lambda: True)
    with pytest.raises(KeyboardInterrupt):
        observe(observed_run(scene_of(FLIGHT)))
