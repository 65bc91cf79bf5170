"""Manifolds bent over modes, and modes in another norm."""

import numpy as np
import pytest
import rom_toys

from mpm_ref.rom.fields.pod import basis, modes
from mpm_ref.rom.fields.polynomial_manifold import curved, monomials, slopes

N, S, R = 30, 60, 5     # points, snapshots, modes


@pytest.fixture
def bent(d, rng):
    """X, x (s, n, d) and F of snapshots that hold two coordinates and their products alone."""
    X, q = rom_toys.cloud(d, N), rng.normal(size=(S, 2))
    a = np.column_stack([q, 0.3 * q[:, 0] ** 2, 0.2 * q[:, 0] * q[:, 1], 0.1 * q[:, 1] ** 2])
    U, slope = rng.normal(size=(R, N, d)), rng.normal(size=(R, N, d, d))
    return X, X + np.tensordot(a, U, 1), np.eye(d) + np.tensordot(a, slope, 1), a


def with_known(bent, r):
    """A `Curved` map whose leading coordinates are those that the others follow from."""
    X, x, F, a = bent
    known = basis(X, x, F, R)
    mix = np.linalg.lstsq(known.xhat, a)[0]             # a = xhat mix
    U = np.einsum("ij,naj->nai", np.linalg.inv(mix), known.modes.U)
    slope = np.einsum("ij,nabj->nabi", np.linalg.inv(mix), known.modes.slope)
    return curved(known._replace(modes=known.modes._replace(U=U, slope=slope), xhat=a), r, 2)


def test_coordinates_that_follow_from_others_are_found(bent):
    X, x, F, a = bent
    map = with_known(bent, 2)
    for q, x_s, F_s in zip(a[:, :2], x, F):
        found, F_found, _ = map.derivatives(X, q)
        assert found == pytest.approx(x_s, abs=2e-5)    # the ridge is 1e-6
        assert F_found == pytest.approx(F_s, abs=2e-5)


def test_bending_leaves_less_than_the_same_modes_straight(bent):
    X, x, F, _ = bent
    known = basis(X, x, F, R)
    map, straight = curved(known, 2, 3), modes(X, x, F, 2)
    def left(m):
        return np.linalg.norm([m.place(X, y) - x_s for y, x_s in zip(known.xhat[:, :2], x)])

    assert left(map) < 0.9 * left(straight)


def test_derivatives_are_those_of_place(bent, rng):
    """Taylor: the error of first order falls with the square of the step."""
    X, x, F, _ = bent
    map, y, u = curved(basis(X, x, F, R), 2, 3), rng.normal(size=2), rng.normal(size=2)
    at, _, G = map.derivatives(X, y)
    assert np.array_equal(at, map.place(X, y))
    assert map.velocity(X, y, u) == pytest.approx(G @ u, abs=1e-12)
    off = [np.linalg.norm(map.place(X, y + h * u) - at - h * (G @ u)) for h in (1e-2, 1e-3)]
    assert off[1] == pytest.approx(off[0] / 100.0, rel=0.1)


def test_F_follows_the_same_coordinates(bent, rng):
    X, x, F, _ = bent
    map, y = curved(basis(X, x, F, R), 2, 2), rng.normal(size=2)
    _, F_found, _ = map.derivatives(X, y)
    assert np.array_equal(F_found, map.modes.derivatives(X, map.all(y))[1])


def test_rest_is_zero(bent, d):
    X, x, F, _ = bent
    assert np.array_equal(curved(basis(X, x, F, R), 2, 3).place(X, np.zeros(2)), X)


def test_slopes_of_monomials(rng):
    powers, y = np.array([[2, 0], [1, 1], [0, 3]]), np.array([0.0, 0.7])
    assert monomials(y, powers) == pytest.approx([0.0, 0.0, 0.7**3])
    assert slopes(y, powers) == pytest.approx(np.array([[0.0, 0.0], [0.7, 0.0], [0.0, 3 * 0.49]]))


@pytest.mark.parametrize(("r", "degree", "said"), [
    (0, 2, "r = 0"), (R, 2, "r = 5"), (2, 1, "degree = 1"),
    (2, 10, "63 monomials of 2 coordinates, but 60 snapshots"),
])
def test_what_leaves_nothing_to_follow_is_refused(bent, r, degree, said):
    X, x, F, _ = bent
    with pytest.raises(ValueError, match=said):
        curved(basis(X, x, F, R), r, degree)


def test_a_norm_with_F_leaves_less_of_F_and_more_of_x(bent, rng):
    X, x, F, _ = bent
    x, F = x + rng.normal(size=x.shape), F + rng.normal(size=F.shape)
    def left(known):
        rows = np.hstack([(x - X).reshape(S, -1), (F - np.eye(X.shape[1])).reshape(S, -1)])
        U = np.vstack([known.modes.U.reshape(-1, 3), known.modes.slope.reshape(-1, 3)])
        off = rows - known.xhat @ U.T
        return np.linalg.norm(off[:, :x[0].size]), np.linalg.norm(off[:, x[0].size:])

    (x_0, F_0), (x_1, F_1) = left(basis(X, x, F, 3)), left(basis(X, x, F, 3, lam_F=10.0))
    assert x_1 > x_0
    assert F_1 < F_0


def test_a_snapshot_that_weighs_most_is_met_best(bent, rng):
    X, x, F, _ = bent
    x = x + rng.normal(size=x.shape)
    w = np.ones(S)
    w[7] = 100.0
    def off(known):
        return np.linalg.norm(X + known.modes.U @ known.xhat[7] - x[7])

    assert off(basis(X, x, F, 3, weights=w)) < 0.05 * off(basis(X, x, F, 3))


def test_a_bend_follows_the_snapshots_that_weigh_most(bent, rng):
    """Half of the snapshots have other products; weights choose whose bend is met."""
    known = basis(*bent[:3], R)
    xhat = known.xhat.copy()
    xhat[::2, 2:] = np.column_stack([3.0 * xhat[::2, 0] ** 2, xhat[::2, 1] ** 2, xhat[::2, 0] ** 2])
    w = np.where(np.arange(S) % 2, 1e-4, 1.0)
    map = curved(known._replace(xhat=xhat), 2, 2, w)
    found = np.array([map.all(y) for y in xhat[::2, :2]])
    assert found == pytest.approx(xhat[::2], abs=1e-3 * abs(xhat).max())
