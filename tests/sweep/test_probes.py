import numpy as np
import pytest
from sweep_scenes import BOUNCE, scene_of

from mpm_ref.scene import build
from mpm_ref.sweep.probes import choose_probes, initial_order, interpolation
from mpm_ref.sweep.setting import scene_at, setting


@pytest.mark.parametrize("d", [2, 3])
def test_linear_functions_are_reproduced(d):
    rng = np.random.default_rng(3)
    x, X = rng.uniform(size=(400, d)), rng.uniform(size=(50, d))
    A, b = rng.normal(size=(d, d)), rng.normal(size=d)
    assert interpolation(x, X) @ (x @ A + b) == pytest.approx(X @ A + b, abs=1e-11)


@pytest.mark.parametrize("d", [2, 3])
def test_error_is_of_second_order(d):
    X = np.random.default_rng(4).uniform(0.3, 0.7, size=(40, d))

    def error(n):
        axis = (np.arange(n) + 0.5) / n
        x = np.stack(np.meshgrid(*d * [axis], indexing="ij"), axis=-1).reshape(-1, d)
        return np.abs(interpolation(x, X) @ np.sin(3.0 * x[:, 0]) - np.sin(3.0 * X[:, 0])).max()

    assert np.log2(error(8) / error(16)) > 1.6


def test_a_row_of_points_is_fitted_with_the_least_norm():
    x = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    weights = interpolation(x, np.array([[0.5, 0.0]])).toarray()[0]
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ x[:, 0] == pytest.approx(0.5)


def test_probes_are_particles_at_the_start_and_shared_by_all_bodies():
    bodies = build(scene_of(BOUNCE)).bodies
    probe, = choose_probes(bodies, most=10)
    start = {tuple(x) for x in initial_order(bodies[0])}
    assert probe.body == "block"
    assert len(probe.X) == 10
    assert {tuple(X) for X in probe.X} <= start


def test_probes_keep_their_place_when_particles_are_sorted():
    problem = build(scene_at(scene_of(BOUNCE), setting(dx=0.5)))
    body = problem.bodies[0]
    X = choose_probes(problem.bodies)[0].X
    weights = interpolation(initial_order(body), X)
    problem.stepper().sort(problem.bodies)
    assert (np.diff(body.id) != 1).any()
    assert weights @ initial_order(body) == pytest.approx(X, abs=1e-12)
