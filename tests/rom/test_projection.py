"""From states of points back to latent coordinates, and the velocities these stand for."""

import numpy as np
import pytest
import rom_toys
from rom_toys import Bent, Watched
from scipy import linalg

from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.latent import initial, start_state, velocities
from mpm_ref.rom.projection import least_squares, line_search, project_position, project_velocity

R, N = 3, 50
STEPS = 0.04 * 0.5 ** np.arange(5)      # [s]


def curved(d, seed=0):
    return rom_toys.decoder(d, R, seed)


def linear(d):
    shots = rom_toys.snapshots(d, n=N)
    return modes(shots.X, *shots.flat(), R)


@pytest.fixture(params=[curved, linear], ids=["decoder", "modes"])
def map(request, d):
    return request.param(d)


@pytest.fixture
def X(d):
    """Points of `linear`."""
    return rom_toys.snapshots(d, n=N).X


def near(*shape):
    return np.random.default_rng(2).uniform(-1.0, 1.0, shape)


def path(t):
    """Latent coordinates along a smooth curve."""
    return np.array([0.7, 0.5, 0.6]) * np.sin(np.array([0.3, -1.0, 2.0]) + t)


def rates(a):
    """Orders of numbers that belong to `STEPS`."""
    return np.log2(np.divide(a[:-1], a[1:]))


# Velocity.

def test_velocities_of_the_manifold_are_recovered(map, X):
    vhat = near(R)
    fit = project_velocity(map.derivatives(X, path(0.0))[2], map.velocity(X, path(0.0), vhat))
    assert fit.y == pytest.approx(vhat, abs=1e-12)
    assert fit.residual <= 1e-15
    assert (fit.rank, fit.iterations) == (R, 1)


def test_least_squares_equal_those_of_scipy(d):
    G, v = near(N, d, R), near(d, N).T
    exact, squared, rank, _ = linalg.lstsq(G.reshape(-1, R), v.ravel())
    fit = project_velocity(G, v)
    assert fit.y == pytest.approx(exact, abs=1e-13)
    assert fit.residual == pytest.approx(np.sqrt(squared / N), rel=1e-13)
    assert fit.rank == rank == R


def test_a_sample_too_few_gives_the_solution_of_least_length(d):
    """LDM-X14: d < r equations."""
    G, v = near(1, d, 5), near(1, d)
    fit = project_velocity(G, v)
    assert fit.rank == d
    assert fit.residual <= 1e-15
    assert fit.y == pytest.approx(linalg.lstsq(G[0], v[0])[0], abs=1e-14)
    assert fit.y == pytest.approx(np.linalg.pinv(G[0]) @ v[0], abs=1e-14)


def test_equal_columns_share_what_they_explain(d):
    A = np.repeat(near(N * d, 1), 2, axis=1)
    w, rank = least_squares(A, 3.0 * A[:, 0])
    assert rank == 1
    assert w == pytest.approx([1.5, 1.5])


def test_a_map_that_does_not_move_has_rank_zero(d):
    fit = project_velocity(np.zeros((N, d, R)), near(N, d))
    assert fit.rank == 0
    assert not fit.y.any()


def test_small_singular_values_count_down_to_the_stated_share():
    """Far below the root of round-off, where normal equations see nothing."""
    U, V = (linalg.qr(near(n, 3) if n == N else near(n, n), mode="economic")[0] for n in (N, 3))
    for smallest, rank in ((1e-9, 3), (1e-11, 2)):
        A = U * [1.0, 0.5, smallest] @ V.T
        w, found = least_squares(A, U @ [1.0, 1.0, smallest])
        assert found == rank
        exact = V @ np.array([1.0, 2.0, 1.0 if rank == 3 else 0.0])
        assert w == pytest.approx(exact, abs=1e-5)


# Position.

def test_positions_of_the_manifold_are_recovered(map, X):
    """From a distance, in all their digits."""
    fit = project_position(map, X, map.place(X, path(0.0)), path(0.0) + 0.3 * near(R))
    assert fit.y == pytest.approx(path(0.0), abs=1e-12)
    assert fit.residual <= 1e-15
    assert fit.rank == R


@pytest.mark.parametrize("seed", range(5))
def test_few_iterations_from_an_extrapolated_start(d, X, seed):
    """LDM-sec3.2.3-gn says 2 to 3; the last one here confirms that nothing changes."""
    map, dt = curved(d, seed), 0.05
    start = 2.0 * path(0.0) - path(-dt)
    fit = project_position(map, X, map.place(X, path(dt)), start)
    assert fit.iterations <= 4
    assert fit.y == pytest.approx(path(dt), abs=1e-12)
    assert abs(start - path(dt)).max() > 1e-4


def test_a_linear_map_needs_one_step(d, X):
    map = linear(d)
    fit = project_position(map, X, map.place(X, path(0.0)) + 0.01 * near(N, d), np.zeros(R))
    exact = linalg.lstsq(map.U.reshape(-1, R), (0.01 * near(N, d)).ravel())[0]
    assert fit.y == pytest.approx(path(0.0) + exact, abs=1e-12)
    assert fit.iterations <= 2


def test_off_the_manifold_the_error_is_normal_to_it(map, X, d):
    x = map.place(X, path(0.0)) + 0.01 * near(N, d)
    fit = project_position(map, X, x, path(0.0) + 0.1 * near(R))
    found, _, G = map.derivatives(X, fit.y)
    left = np.linalg.norm(found - x)
    slopes = np.einsum("nar,na->r", G, found - x) / (np.linalg.norm(G, axis=(0, 1)) * left)
    assert abs(slopes).max() < 1e-7
    assert fit.residual == pytest.approx(left / np.sqrt(N), rel=1e-12)


def test_one_sample_is_met_but_leaves_coordinates_open(d, X):
    map, xhat = rom_toys.decoder(d, 5), near(5)
    fit = project_position(map, X[:1], map.place(X[:1], xhat), 0.9 * xhat)
    assert fit.rank == d
    assert fit.residual <= 1e-15
    assert abs(fit.y - xhat).max() > 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_no_step_raises_the_error(d, X, seed):
    """Also far from where the map is known, towards positions that it cannot reach."""
    rng = np.random.default_rng(seed)
    map, x = Watched(curved(d, seed), []), X + 0.3 * rng.normal(size=X.shape)
    fit = project_position(map, X, x, rng.uniform(-20.0, 20.0, R))
    errors = np.array([np.sum((map.place(X, y) - x) ** 2) for y in (*map.seen, fit.y)])
    assert len(errors) > 3
    assert (errors[1:] <= errors[:-1]).all()


def test_steps_that_go_too_far_are_cut():
    X, map = np.zeros((4, 1)), Watched(Bent(), [])
    fit = project_position(map, X, X, np.array([3.0]))
    assert fit.y == pytest.approx([0.0], abs=1e-12)
    y, (_, _, G) = map.seen[0], Bent().derivatives(X, map.seen[0])
    assert abs(y - np.arctan(y) / G[0, 0]) > 3.0
    assert (np.abs(map.seen[1]) < 3.0).all()


def test_a_line_that_only_rises_is_left_at_its_start(d, X):
    map, y = linear(d), path(0.0)
    x = map.place(X, y)
    assert line_search(map, X, x, (y, np.ones(R)), 0.0, 1.0) == (None, 0.0)


@pytest.mark.parametrize("off", [0.0, 0.1], ids=["along the manifold", "off it"])
def test_linear_and_nonlinear_projection_differ_by_the_square_of_the_step(d, X, off):
    """LDM-eqA1. The steps are small: the second derivative of elu jumps at 0."""
    map, xhat = curved(d), path(0.0)
    v = map.velocity(X, xhat, near(R)) + off * near(N, d)
    x, _, G = map.derivatives(X, xhat)
    w = project_velocity(G, v).y
    apart = [np.linalg.norm(project_position(map, X, x + dt * v, xhat).y - xhat - dt * w)
             for dt in STEPS / 32]
    assert rates(apart) == pytest.approx(2.0, abs=0.02)


# The reduced state.

def test_the_start_is_recovered_with_its_velocities(map, X):
    vhat = near(R)
    x, v = map.place(X, path(0.0)), map.velocity(X, path(0.0), vhat)
    start = initial(map, X, x, v, xhat=path(0.2))
    assert start.xhat == pytest.approx(path(0.0), abs=1e-12)
    assert start.vhat == pytest.approx(vhat, abs=1e-11)
    assert start.before is None
    assert start.fitted_at is start.xhat


def test_without_more_said_a_body_starts_at_rest(d, X):
    start = initial(linear(d), X)
    assert abs(start.xhat).max() <= 1e-14
    assert not start.vhat.any()
    map, _ = rom_toys.affine(d)
    assert initial(map, X).xhat == pytest.approx(map.rest, abs=1e-14)


def test_states_share_no_memory():
    xhat, vhat = np.zeros(R), np.ones(R)
    start = start_state(xhat, vhat)
    xhat += 1.0
    vhat += 1.0
    start.xhat[0] = 5.0
    assert start.xhat.tolist() == [5.0, 0.0, 0.0]
    assert np.array_equal(start.vhat, np.ones(R))


def after(dt, xhat=None):
    """The state after a step of length dt, by the linear projection unless told."""
    start = start_state(path(0.0))
    return start.advance(start.xhat + dt * near(R) if xhat is None else xhat, near(R))


def speeds(map, latent, X, dt):
    """{name: v (n, d)} of all choices."""
    at = evaluate(map, X, latent.xhat)
    return {name: v(at) for name, v in velocities(map, latent, dt, X).items()}


def test_points_are_where_the_latent_coordinates_say(map, X):
    latent = after(0.1)
    at = evaluate(map, X, latent.xhat)
    v = velocities(map, latent, 0.1, X)["previous"](at)
    x, F, G = map.derivatives(X, latent.xhat)
    assert all(np.array_equal(a, b) for a, b in zip(at, (X, x, F, G), strict=True))
    assert v == pytest.approx(map.velocity(X, path(0.0), near(R)), abs=1e-15)


def test_velocities_agree_on_a_linear_map(d, X):
    for found in speeds(linear(d), after(0.1), X, 0.1).values():
        assert found == pytest.approx(linear(d).velocity(X, path(0.0), near(R)), abs=1e-14)


def test_velocities_agree_before_the_first_step(map, X):
    for found in speeds(map, start_state(path(0.0), near(R)), X, 0.1).values():
        assert found == pytest.approx(map.velocity(X, path(0.0), near(R)), abs=1e-14)


def bend(map, X):
    """g''(vhat, vhat), by a central difference."""
    a, b = (map.velocity(X, path(0.0) + h * near(R), near(R)) for h in (1e-5, -1e-5))
    return (a - b) / 2e-5


def excess(map, X, choice, dt, xhat=None):
    """What a choice adds to the velocity that was fitted, over the step: an acceleration."""
    found = speeds(map, after(dt, xhat), X, dt)
    return (found[choice] - found["previous"]) / dt


@pytest.mark.parametrize(("choice", "share"), [("latest", 1.0), ("difference", 0.5)])
def test_velocities_of_coordinates_that_moved_linearly_add_an_acceleration(d, X, choice, share):
    """g''(vhat, vhat) where dg/dxhat is taken anew, half of it by differences: the velocity is off
    in the first order of dt, the acceleration in its zeroth.
    """
    map = curved(d)
    added = np.array([excess(map, X, choice, dt) for dt in STEPS / 32])
    sizes = np.linalg.norm(added, axis=(1, 2))
    assert rates(sizes) == pytest.approx(0.0, abs=0.01)
    assert np.linalg.norm(added[-1] - share * bend(map, X)) < 0.01 * sizes[-1]


def test_difference_after_a_nonlinear_projection_adds_nothing_along_the_manifold(d, X):
    map, dt = curved(d), STEPS[0]
    x, _, G = map.derivatives(X, path(0.0))
    xhat = project_position(map, X, x + dt * G @ near(R), path(0.0)).y
    G_new = map.derivatives(X, xhat)[2]
    seen = {choice: abs(project_velocity(G_new, excess(map, X, choice, dt, xhat)).y).max()
            for choice in ("latest", "difference", "transported")}
    assert seen["latest"] > 0.1
    assert seen["difference"] < 1e-6
    assert seen["transported"] < 1e-12
