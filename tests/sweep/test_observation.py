import numpy as np
import pytest
from sweep_scenes import BOUNCE, FLIGHT, observed_run, scene_of

from mpm_ref.core import kernel_cache
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


def test_memory_is_that_of_particles_and_of_the_grid_around_them():
    problem = build(scene_of(FLIGHT))
    x, dx = problem.bodies[0].particles.x, problem.dx
    particles = sum(a.nbytes for a in problem.bodies[0].particles)
    nodes = np.prod(np.ceil(np.ptp(x, axis=0) / dx) + problem.scheme.degree + 1)
    assert observation.nodes_around(problem) == nodes * 3 * 8     # a mass and two velocities each
    done = observe(observed_run(scene_of(FLIGHT)))
    assert done.cost.memory == particles + nodes * 3 * 8


@pytest.fixture
def clock(monkeypatch):
    """A `StepClock` whose times of steps are set by the function that is returned too."""
    now = [0.0]
    monkeypatch.setattr(observation.time, "process_time", lambda: now[0])
    monkeypatch.setattr(observation.time, "perf_counter", lambda: 2.0 * now[0])
    clock = observation.StepClock()

    def step(seconds, compiles=False):
        clock.start()
        if compiles:
            for note in kernel_cache.compilations:
                note()
        now[0] += seconds
        clock.stop()
    return clock, step


def test_steps_that_load_or_compile_count_as_usual_ones(clock):
    clock, step = clock
    step(50.0)
    step(30.0)
    assert clock.total() == (80.0, 160.0)       # a run of two steps has no usual one
    step(1.0)
    step(100.0, compiles=True)
    step(3.0)
    assert clock.total() == pytest.approx((5 * 2.0, 5 * 4.0))


@pytest.mark.parametrize("most_cpu", [0.0, np.inf])
def test_a_run_leaves_nothing_behind_that_watches_compilations(most_cpu):
    before = list(kernel_cache.compilations)
    observe(observed_run(scene_of(FLIGHT), most_cpu=most_cpu))
    assert kernel_cache.compilations == before


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
