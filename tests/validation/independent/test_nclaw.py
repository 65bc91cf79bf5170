"""Second implementations of NCLaw's laws: agreement with the package, and facts of their own."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.independent import graph_step, learned_law, learned_run, loss_gradient
from validation.independent.agreement_nclaw import (
    CHECKS,
    LAWS,
    WEIGHTS,
    WEIGHTS_BOUND,
    loss_gradient_agreement,
    stored,
    two_clouds,
)

TURN = Rotation.from_rotvec([0.3, -1.1, 0.8]).as_matrix()
GRID = learned_run.WalledGrid(0.05, 5e-4, np.zeros(3), 1e-30, (-99, 99), (-9.0, 9.0))


@pytest.mark.parametrize("name", CHECKS)
def test_the_package_agrees(name):
    agreement, bound, _, _ = CHECKS[name]
    assert agreement() <= bound


@pytest.mark.usefixtures("one_torch_thread")
def test_the_package_agrees_on_gradients_by_weights():
    assert loss_gradient_agreement() <= WEIGHTS_BOUND


# Facts that neither code has written.

def strained(n=20):
    """Deformation gradients (n, 3, 3), some inverted."""
    return np.eye(3) + 0.5 * np.random.default_rng(0).normal(size=(n, 3, 3))


@pytest.mark.parametrize("name", LAWS)
def test_laws_turn_with_the_body(name):
    """NCLAW-eq31 to NCLAW-eq37."""
    F, (elastic, plastic) = strained(), stored(name)
    turned = TURN @ learned_law.stress(elastic, F) @ TURN.T
    assert (np.linalg.det(F) < 0.0).any()
    assert learned_law.stress(elastic, TURN @ F) == pytest.approx(turned, rel=1e-9, abs=1e-5)
    assert learned_law.returned(plastic, TURN @ F) == pytest.approx(
        TURN @ learned_law.returned(plastic, F), abs=1e-11)


@pytest.mark.parametrize("name", LAWS)
def test_laws_are_at_rest_without_strain(name):
    elastic, plastic = stored(name)
    assert np.abs(learned_law.stress(elastic, TURN[None])).max() < 1e-8
    assert learned_law.returned(plastic, TURN[None])[0] == pytest.approx(TURN, abs=1e-14)


def test_stretches_and_rotations_are_those_of_F():
    F = strained()
    s, R = learned_law.stretches(F)
    S = R.mT @ F
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert S == pytest.approx(S.mT, abs=1e-12)
    assert np.linalg.eigvalsh(S)[:, ::-1] == pytest.approx(s, abs=1e-12)


def cloud(n=30):
    """A state x, v, C, F of particles in the middle of the box, and their m and V0."""
    rng = np.random.default_rng(0)
    V0 = rng.uniform(1e-5, 2e-5, n)
    return (0.5 + 0.1 * rng.random((n, 3)), rng.normal(size=(n, 3)),
            5.0 * rng.normal(size=(n, 3, 3)), strained(n)), (1e3 * V0, V0)


def test_a_run_keeps_momentum():
    """Any stress, away from walls."""
    (x, v, C, F), (m, V0) = cloud()
    laws = (lambda F: 1e4 * (F - np.eye(3)), lambda F: F)
    states = learned_run.run(laws, (x, v, C, F), (m, V0), GRID, 5)
    assert np.abs(states[-1][1] - v).max() > 0.1
    for _, v_n, _, _ in states:
        assert m @ v_n == pytest.approx(m @ v, rel=1e-11)
    assert m @ (states[-1][0] - x) == pytest.approx(5 * GRID.dt * (m @ v), rel=1e-10)


def test_a_run_keeps_an_affine_motion():
    (x, _, _, F), sizes = cloud()
    L = np.random.default_rng(1).normal(size=(3, 3))
    laws = (lambda F: 0.0 * F, lambda F: F)
    state = x, x @ L.T, np.tile(L, (len(x), 1, 1)), F
    x_1, v, C, F_1 = learned_run.step(laws, state, sizes, GRID)
    assert v == pytest.approx(state[1], abs=1e-12)
    assert C == pytest.approx(state[2], abs=1e-11)
    assert x_1 == pytest.approx(x + GRID.dt * v, abs=1e-14)
    assert F_1 == pytest.approx(F + GRID.dt * L @ F, abs=1e-13)


def test_walls_stop_what_moves_into_them():
    """All nodes below index 20 are in the wall: nothing moves towards lower coordinates."""
    (x, v, C, F), sizes = cloud()
    laws = (lambda F: 0.0 * F, lambda F: F)
    _, v_1, _, _ = learned_run.step(laws, (x, v, C, F), sizes, GRID._replace(walls=(20, 99)))
    assert v_1.min() == 0.0
    assert v_1.max() > 0.1


def test_the_gradient_is_that_of_a_known_loss():
    """Positions x_n = n w: L = sum over n of the mean of (n w - t)^2."""
    w, target = np.array([0.3, -1.2, 0.8, 2.0, 0.1, 0.4]), np.full((4, 2, 3), 0.7)
    n = np.arange(1, 5)[:, None]
    slope = (2.0 * n * (n * w - 0.7) / 6).sum(axis=0)
    ours = loss_gradient.gradient(lambda w: n[:, :, None] * w.reshape(1, 2, 3), w, target,
                                  [4, 0, 2])
    assert ours == pytest.approx(slope[[4, 0, 2]], rel=1e-14)


@pytest.fixture(scope="module")
def graph():
    """The weights of the graph network of water; frames of two clouds of 50 points; walls."""
    x, v, walls = two_clouds()
    with np.load(WEIGHTS / "water-gnn.npz") as arrays:
        return dict(arrays), graph_step.straight_flight(x, v, 2.5e-3), walls


def test_a_shift_of_points_and_walls_changes_no_acceleration(graph):
    arrays, frames, walls = graph
    a = graph_step.accelerations(arrays, frames, walls)
    assert np.abs(a).max() > 1e-5
    assert graph_step.accelerations(arrays, frames + 0.25, walls + 0.25) == pytest.approx(
        a, abs=1e-12)


def test_the_order_of_points_does_not_matter(graph):
    arrays, frames, walls = graph
    order = np.random.default_rng(1).permutation(100)
    a = graph_step.accelerations(arrays, frames, walls)
    assert graph_step.accelerations(arrays, frames[:, order], walls) == pytest.approx(
        a[order], abs=1e-15)


def test_clouds_that_are_far_from_each_other_do_not_interact(graph):
    arrays, frames, walls = graph
    both = graph_step.accelerations(arrays, frames, walls)
    assert both[:50] == pytest.approx(
        graph_step.accelerations(arrays, frames[:, :50], walls), abs=1e-15)
