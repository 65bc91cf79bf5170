"""Linear maps, and snapshots: what modes reproduce at and between the points of their data."""

import numpy as np
import pytest
import rom_toys
import threadpoolctl

from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.snapshots import decoder_units, displacement_error, position_error

ROUND_OFF = 4e-14       # of the largest entry; seen: 3.8e-15
S, N = 6, 40            # snapshots, points


@pytest.fixture
def rough(d, rng):
    """X, x (s, n, d) and F (s, n, d, d) without any order in them."""
    X = rom_toys.cloud(d, N)
    return X, X + 0.1 * rng.normal(size=(S, N, d)), np.eye(d) + 0.1 * rng.normal(size=(S, N, d, d))


@pytest.fixture
def flat(d, rng):
    """X, x and F of affine deformations x = A X + b."""
    X, A = rom_toys.cloud(d, N), np.eye(d) + 0.2 * rng.normal(size=(S, d, d))
    x = np.einsum("sab,nb->sna", A, X) + 0.1 * rng.normal(size=(S, 1, d))
    return X, x, np.repeat(A[:, None], N, axis=1)


def coordinates(map, x):
    """Latent coordinates (s, r) nearest to snapshots x (s, n, d)."""
    A, b = map.U.reshape(-1, map.r), (x - map.X).reshape(len(x), -1)
    return np.linalg.lstsq(A, b.T)[0].T


def close(a, b, tol=ROUND_OFF):
    return abs(a - b).max() <= tol * abs(b).max()


def test_as_many_modes_as_snapshots_meet_them_all(rough):
    X, x, F = rough
    map = modes(X, x, F, S)
    for xhat, x_s, F_s in zip(coordinates(map, x), x, F):
        found, F_found, _ = map.derivatives(X, xhat)
        assert np.array_equal(found, map.place(X, xhat))
        assert close(found, x_s)
        assert close(F_found, F_s)


@pytest.mark.parametrize("r", [1, 3, 5])
def test_fewer_modes_leave_the_discarded_singular_values(rough, r):
    X, x, F = rough
    sigma = np.linalg.svd((x - X).reshape(S, -1), compute_uv=False)
    map = modes(X, x, F, r)
    left = [map.place(X, xhat) - x_s for xhat, x_s in zip(coordinates(map, x), x)]
    assert np.linalg.norm(left) == pytest.approx(np.sqrt(np.sum(sigma[r:] ** 2)), rel=1e-12)


def test_coordinates_are_uncorrelated_with_a_root_mean_square_of_one(rough):
    X, x, F = rough
    xhat = coordinates(modes(X, x, F, 4), x)
    assert xhat.T @ xhat / S == pytest.approx(np.eye(4), abs=ROUND_OFF)


def test_rest_is_zero(rough, d):
    X, x, F = rough
    map = modes(X, x, F, 3)
    found, F_found, _ = map.derivatives(X, np.zeros(3))
    assert np.array_equal(found, X)
    assert np.array_equal(F_found, np.tile(np.eye(d), (N, 1, 1)))
    assert not map.velocity(X, np.ones(3), np.zeros(3)).any()


def test_velocity_is_the_modes_times_the_rates(rough, rng):
    X, x, F = rough
    map, vhat = modes(X, x, F, 3), rng.normal(size=3)
    for at in (X, X + 0.01):
        U = map.derivatives(at, np.ones(3))[2]
        assert close(map.velocity(at, np.ones(3), vhat), np.einsum("nar,r->na", U, vhat))
        assert close(map.place(at, vhat), at + np.einsum("nar,r->na", U, vhat))


def test_F_is_the_gradient_of_affine_motions(flat, rng):
    """At and between the points, for coordinates that no snapshot has."""
    X, x, F = flat
    map, d = modes(X, x, F, 4), X.shape[1]
    xhat = rng.normal(size=4)
    inside = rom_toys.cloud(d, 25, seed=1)
    here = np.hstack([X, np.ones((N, 1))])
    A = np.linalg.lstsq(here, map.place(X, xhat))[0]
    for at in (X, inside):
        found, F_found, _ = map.derivatives(at, xhat)
        assert close(found, np.hstack([at, np.ones((len(at), 1))]) @ A)
        assert close(F_found, np.tile(A[:d].T, (len(at), 1, 1)))


def test_only_points_off_the_data_are_fitted(rough):
    X, x, F = rough
    map, xhat = modes(X, x, F, 3), np.ones(3)
    there, near, off = (map.place(X + step, xhat) - X for step in (0.0, 1e-12, 1e-6))
    assert close(near, there, 1e-10)
    assert abs(off - there).max() > 0.1 * abs(there).max()


def test_points_of_the_data_are_known_in_any_order(rough, rng):
    X, x, F = rough
    map, xhat = modes(X, x, F, 3), rng.normal(size=3)
    some = rng.permutation(N)[:7]
    for whole, part in zip(map.derivatives(X, xhat), map.derivatives(X[some], xhat)):
        assert np.array_equal(whole[some], part)


@pytest.mark.parametrize("r", [0, -1, S + 1])
def test_more_modes_than_snapshots_are_refused(rough, r):
    with pytest.raises(ValueError, match=rf"r = {r}: expected 1 \.\. 6 modes of 6 snapshots$"):
        modes(*rough, r)


def test_more_modes_than_displacements_are_refused(rough, d):
    X, x, F = rough
    with pytest.raises(ValueError, match=rf"r = 4: expected 1 \.\. {d} modes"):
        modes(X[:1], x[:, :1], F[:, :1], 4)


def test_snapshots_at_rest_have_no_modes(rough):
    X, _, F = rough
    with pytest.raises(ValueError, match="r = 1: the snapshots hold only 0 modes"):
        modes(X, np.tile(X, (S, 1, 1)), F, 1)


@pytest.mark.parametrize("small", [500, 2], ids=("all values", "Lanczos"))
@pytest.mark.parametrize(("least", "held"), [(0.0, 2), (1e-12, 2), (1e-8, 3)])
def test_modes_of_round_off_are_refused(d, rng, monkeypatch, small, least, held):
    """Three shapes in eight snapshots, the third of a size that is round-off or is not."""
    monkeypatch.setattr("mpm_ref.rom.fields.pod.SMALL", small)
    X, size = rom_toys.cloud(d, N), np.array([1.0, 0.1, least])
    x = X + np.tensordot(size * rng.normal(size=(8, 3)), rng.normal(size=(3, N, d)), 1)
    F = np.tile(np.eye(d), (8, N, 1, 1))
    assert modes(X, x, F, held).r == held
    with pytest.raises(ValueError, match=rf"r = 5: the snapshots hold only {held} modes"):
        modes(X, x, F, 5)


def test_sizes_of_a_map(rough, d):
    map = modes(*rough, 4)
    assert (map.dim, map.r) == (d, 4)
    assert [a.shape for a in map.derivatives(rom_toys.cloud(d, 5), np.ones(4))] == [
        (5, d), (5, d, d), (5, d, 4)]


# Affine maps.

def test_affine_map_has_the_derivatives_of_its_values(d, rng):
    map, xhat = rom_toys.affine(d)
    X, vhat = rom_toys.cloud(d, N), rng.normal(size=map.r)
    x, F, G = map.derivatives(X, xhat)
    assert np.array_equal(x, map.place(X, xhat))
    assert close(F, np.stack([map.place(X + e, xhat) - x for e in np.eye(d)], -1))
    assert np.array_equal(G, np.stack([map.place(X, e) for e in np.eye(map.r)], -1))
    assert close(map.velocity(X, xhat, vhat), G @ vhat)
    assert np.array_equal(map.place(X, map.rest), X)


# Snapshots.

def test_units_are_those_of_displacements(d):
    shots = rom_toys.snapshots(d)
    u = (shots.x - shots.X).reshape(-1, d)
    found = decoder_units(shots)
    for a, b in zip(found, (shots.X.min(0), np.ptp(shots.X, 0), u.mean(0), u.std(0)), strict=True):
        assert a == pytest.approx(b, rel=1e-13)
    shots.x[..., 0] = shots.X[:, 0]
    assert decoder_units(shots).std[0] == decoder_units(shots).std[1:].max()
    assert decoder_units(shots).std[1:] == pytest.approx(u.std(0)[1:], rel=1e-13)
    shots.x[:] = shots.X
    assert (decoder_units(shots).std == 1.0).all()


def test_some_runs_of_snapshots(d):
    shots = rom_toys.snapshots(d)
    some = shots.select([2, 0])
    for name in ("mu", "x", "F", "v"):
        assert np.array_equal(getattr(some, name), getattr(shots, name)[[2, 0]])
    x, F = some.flat()
    assert np.array_equal(x[5], shots.x[0, 0])
    assert np.array_equal(F[4], shots.F[2, 4])


def test_errors_and_the_origin(d, rng):
    """LDM-err depends on where the origin is, the error over displacements does not."""
    shots = rom_toys.snapshots(d)
    X, x = shots.X, shots.x
    off, far = x + 0.01 * rng.normal(size=x.shape), 10.0
    size = np.linalg.norm(off - x)
    assert position_error(x, x) == displacement_error(x, x, X) == 0.0
    assert position_error(off, x) == pytest.approx(size / np.linalg.norm(x))
    assert displacement_error(off, x, X) == pytest.approx(size / np.linalg.norm(x - X))
    assert position_error(off + far, x + far) < 0.2 * position_error(off, x)
    assert position_error(off + far, x + far, far) == pytest.approx(position_error(off, x))
    assert displacement_error(off + far, x + far, X + far) == pytest.approx(
        displacement_error(off, x, X))


@pytest.mark.parametrize("count", [40, 700], ids=("all", "Lanczos"))
def test_modes_are_the_same_bits_for_any_number_of_threads(count):
    rng = np.random.default_rng(4)
    X = rom_toys.cloud(3, 300)
    amplitudes, shapes = rng.normal(size=(count, 12)), rng.normal(size=(12, 300, 3))
    x = X + 1e-2 * np.tensordot(amplitudes, shapes, axes=1)
    F = np.eye(3) + 1e-2 * rng.normal(size=(count, 300, 3, 3))
    found = []
    for threads in (1, 2):
        with threadpoolctl.threadpool_limits(threads):
            found.append(modes(X, x, F, 6))
    assert np.array_equal(found[0].U, found[1].U)
    assert np.array_equal(found[0].slope, found[1].slope)
