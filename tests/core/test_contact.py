"""The condition at one node: projections on several planes, friction, and which condition wins."""

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import nnls

from mpm_ref.core.contact import (
    NOSLIP,
    PRESCRIBED,
    SEPARATE,
    SLIP,
    STICKY,
    Contacts,
    approach,
    meet,
)


def solved(v, n, kind, mu=0.0, moving=None):
    """New velocity of a node, and what each collider changed; colliders at rest unless moving."""
    n = np.array(n, dtype=float)
    n /= np.linalg.norm(n, axis=1)[:, None]
    K = len(n)
    w = np.zeros_like(n) if moving is None else np.array(moving, dtype=float)
    contacts = Contacts(np.zeros(K, dtype=np.int64), np.arange(K), n, w, np.zeros_like(n),
                        np.broadcast_to(kind, K).astype(np.int64),
                        np.broadcast_to(mu, K).astype(float))
    u = np.array(meet(contacts, (0, K), tuple(map(float, v))))
    return u, contacts


def nearest_by_duality(v, n, b, equal):
    """argmin |u - v| over n_k . u >= b_k, with equality where told: Lawson and Hanson's reduction
    of least distance programming to non-negative least squares."""
    G = np.concatenate((n, -n[equal]))
    h = np.concatenate((b, -b[equal])) - G @ v
    E, f = np.vstack((G.T, h)), np.zeros(len(v) + 1)
    f[-1] = 1.0
    y, _ = nnls(E, f)
    r = E @ y - f
    return v - r[:-1] / r[-1]


# one collider

@pytest.mark.parametrize(("kind", "v", "u"), [
    (STICKY, (3, 4), (0, 0)), (STICKY, (3, -4), (0, 0)), (PRESCRIBED, (3, -4), (0, 0)),
    (SLIP, (3, 4), (3, 0)), (SLIP, (3, -4), (3, 0)),
    (SEPARATE, (3, 4), (3, 4)), (SEPARATE, (3, -4), (3, 0)),
    (NOSLIP, (3, 4), (3, 4)), (NOSLIP, (3, -4), (0, 0)), (NOSLIP, (3, 0), (3, 0)),
])
def test_one_collider(kind, v, u):
    """A floor; then the same seen from a frame that moves."""
    found, contacts = solved(v, [(0, 1)], kind)
    assert (found == u).all()
    assert (contacts.dv[0] == np.subtract(u, v)).all()
    w = np.array([10.0, 7.0])
    found, _ = solved(v + w, [(0, 1)], kind, moving=[w])
    assert found == pytest.approx(u + w, abs=1e-14)


@pytest.mark.parametrize(("kind", "mu", "v", "u"), [
    (SEPARATE, 0.5, (3, -4), (1, 0)),          # 3 - 0.5 * 4
    (SEPARATE, 0.5, (-3, -4), (-1, 0)),
    (SEPARATE, 0.75, (3, -4), (0, 0)),         # sticks: mu |v_n| = |v_t|
    (SEPARATE, 2.0, (3, -4), (0, 0)),
    (SEPARATE, 0.5, (3, 4), (3, 4)),           # leaves
    (SLIP, 0.5, (3, 4), (1, 0)),               # held back, and rubs
    (SLIP, 0.25, (3, -4), (2, 0)),
])
def test_coulomb_friction(kind, mu, v, u):
    found, contacts = solved(v, [(0, 1)], kind, mu)
    assert found == pytest.approx(u, abs=1e-15)
    assert contacts.dv[0] == pytest.approx(np.subtract(u, v), abs=1e-15)


def test_coulomb_friction_on_an_incline_and_in_space(rng):
    """Against the formula v_t max(0, 1 - mu |v_n| / |v_t|) of relative velocities."""
    for _ in range(50):
        n, w, v = rng.normal(size=(3, 3))
        n /= np.linalg.norm(n)
        mu = rng.uniform(0.0, 2.0)
        a = n @ (v - w)
        t = v - w - a * n
        u = w + t * max(0.0, 1.0 - mu * abs(a) / np.linalg.norm(t)) if a < 0.0 else v
        assert solved(v, [n], SEPARATE, mu, [w])[0] == pytest.approx(u, abs=1e-14)


@pytest.mark.parametrize("mu", [0.0, 0.2, np.tan(0.4), 1.0])
def test_acceleration_down_an_incline(mu):
    """g (sin - mu cos) at 0.4 rad, or rest; the node starts from rest and gains g dt each step."""
    g, dt, angle = 9.81, 0.01, 0.4
    n, down = (np.sin(angle), np.cos(angle)), np.array((np.cos(angle), -np.sin(angle)))
    u = np.zeros(2)
    for _ in range(100):
        u, _ = solved(u + (0.0, -g * dt), [n], SEPARATE, mu)
    expected = max(g * (np.sin(angle) - mu * np.cos(angle)), 0.0)
    assert u == pytest.approx(expected * 100 * dt * down, abs=1e-13)


# several colliders

def test_nearest_velocity_for_any_planes(d, rng):
    """Two to five planes at random angles that move together, slip and separate mixed."""
    loaded = set()
    for _ in range(300):
        K = rng.integers(2, 6)
        n, w, v = rng.normal(size=(K, d)), rng.normal(size=d), rng.normal(size=d)
        equal = (np.arange(K) < 1) & (rng.random() < 0.5)
        u, contacts = solved(v, n, np.where(equal, SLIP, SEPARATE), moving=K * [w])
        n = contacts.n
        assert u == pytest.approx(nearest_by_duality(v, n, n @ w, equal), abs=1e-9)
        assert (n @ (u - w) > -1e-9).all()
        assert np.linalg.norm(u - w) <= np.linalg.norm(v - w) * (1 + 1e-12)
        assert contacts.dv.sum(axis=0) == pytest.approx(u - v, abs=1e-9)
        loaded.add(np.any(contacts.dv != 0.0, axis=1).sum())
    assert loaded == set(range(d + 1))


def test_planes_that_move_apart_from_each_other(rng):
    """Two slip planes with velocities of their own: both are met."""
    for _ in range(50):
        n, w, v = rng.normal(size=(2, 3)), rng.normal(size=(2, 3)), rng.normal(size=3)
        u, contacts = solved(v, n, SLIP, moving=w)
        n = contacts.n
        if abs(n[0] @ n[1]) < 0.9:                   # else it may be squeezed
            assert (n * (u - w)).sum(axis=1) == pytest.approx(0.0, abs=1e-12)
            assert u - v == pytest.approx(n.T @ np.linalg.lstsq(n.T, u - v)[0], abs=1e-12)


def test_order_does_not_matter(d, rng):
    """Kinds, friction and planes are permuted together."""
    for _ in range(20):
        n, v, w = rng.normal(size=(4, d)), rng.normal(size=d), rng.normal(size=d)
        kind, mu = np.array([SLIP, SEPARATE, SEPARATE, NOSLIP]), np.array([0.0, 0.3, 0.1, 0.0])
        found = []
        for order in permutations(range(4)):
            k = list(order)
            found.append(solved(v, n[k], kind[k], mu[k], 4 * [w])[0])
        assert np.ptp(found, axis=0).max() < 1e-12


def test_three_independent_planes_leave_no_freedom():
    """Slip planes at odd angles hold a node in space, two do in the plane."""
    u, _ = solved((1, 2, 3), [(1, 0, 0), (1, 1, 0), (1, 1, 1)], SLIP)
    assert abs(u).max() < 1e-15
    u, _ = solved((1, 2), [(1, 0), (1, 0.01)], SLIP)
    assert abs(u).max() < 1e-13


def test_a_plane_that_follows_from_others_takes_nothing():
    """The same floor twice; three slip planes through one line; four walls of one edge."""
    assert (solved((3, -4), [(0, 1), (0, 1)], SLIP)[0] == (3, 0)).all()
    assert (solved((3, -4), [(0, 1), (1e-17, 1)], SEPARATE)[0] == (3, 0)).all()
    line = [(1, 0, 0), (np.cos(1), np.sin(1), 0), (np.cos(2), np.sin(2), 0)]
    assert solved((1, 2, 3), line, SLIP)[0] == pytest.approx((0, 0, 3), abs=1e-15)
    assert solved((1, 2, 0), line, SLIP)[0] == pytest.approx((0, 0, 0), abs=1e-15)
    corner = [(1, 0, 0), (0, 1, 0), (1, 1, 0), (1, 2, 0)]
    assert solved((-1, -2, 3), corner, SEPARATE)[0] == pytest.approx((0, 0, 3), abs=1e-15)


def test_a_wedge_of_planes_pushes_to_one_of_them():
    """Between x >= 0 and x + y >= 0 only the nearer plane bears load where that is enough."""
    u, contacts = solved((-1, 3), [(1, 0), (1, 1)], SEPARATE)
    assert (u == (0, 3)).all()
    assert not contacts.dv[1].any()


def test_friction_in_an_edge():
    """Two planes at right angles: loads 1 and 2 shorten sliding along the edge by 0.1 + 0.2 * 2."""
    u, contacts = solved((-1, -2, 3), [(1, 0, 0), (0, 1, 0)], SEPARATE, (0.1, 0.2))
    assert u == pytest.approx((0, 0, 2.5), abs=1e-15)
    assert contacts.dv == pytest.approx(np.array([(1, 0, -0.1), (0, 2, -0.4)]), abs=1e-15)


def test_friction_in_an_edge_of_sixty_degrees():
    """u - v = l1 n1 + l2 n2 with n1 . n2 = 1/2, by hand: v = -(n1 + n2) has l1 = l2 = 1."""
    n = np.array([(1, 0, 0), (0.5, np.sqrt(0.75), 0)])
    u, contacts = solved(-n[0] - n[1] + (0, 0, 1), n, SEPARATE, (0.3, 0.1))
    assert u == pytest.approx((0, 0, 0.6), abs=1e-15)
    assert contacts.dv[:, 2] == pytest.approx((-0.3, -0.1), abs=1e-15)


def test_friction_keeps_to_planes_that_move_differently():
    """It acts along the edge, whatever the velocities of the planes across it."""
    n, w = [(1, 0, 0), (0, 1, 0)], [(1, 5, 2), (-7, 3, 2)]
    u, _ = solved((0, 0, 4), n, SEPARATE, (0.2, 0.1), w)
    assert u == pytest.approx((1, 3, 4 - 0.2 * 1 - 0.1 * 3), abs=1e-15)


def test_the_larger_friction_bears_what_two_equal_planes_could():
    u, _ = solved((3, -4), [(0, 1), (0, 1)], SEPARATE, (0.5, 0.25))
    assert u == pytest.approx((1, 0), abs=1e-15)


# who wins

def test_sticky_wins_over_planes_and_prescribed_over_all():
    w = [(0, 0), (1, 2), (5, 5)]
    kinds = np.array([SLIP, STICKY, PRESCRIBED])
    assert (solved((3, 4), [(1, 0), (0, 1)], kinds[:2], moving=w[:2])[0] == (1, 2)).all()
    u, contacts = solved((3, 4), [(1, 0), (0, 1), (0, 1)], kinds, moving=w)
    assert (u == (5, 5)).all()
    assert (contacts.dv == [(0, 0), (0, 0), (2, 1)]).all()


def test_sticky_colliders_that_disagree_share():
    u, contacts = solved((0, 0), [(1, 0), (0, 1)], STICKY, moving=[(1, 0), (0, 3)])
    assert (u == (0.5, 1.5)).all()
    assert (contacts.dv == [(0.5, 0), (0, 1.5)]).all()


def test_a_squeezed_node_moves_with_the_mean():
    """Between plates that close in, and in a closing gap so narrow that it would shoot out."""
    plates = [(0, 1), (0, -1)]
    assert (solved((3, 0), plates, SEPARATE, moving=[(0, 1), (0, -2)])[0] == (0, -0.5)).all()
    narrow = [(0, 1), (1e-3, -1)]
    assert (solved((0, 0), narrow, SEPARATE, moving=[(0, 1), (0, -1)])[0] == (0, 0)).all()
    wide = [(0, 1), (1, -1)]
    u, _ = solved((0, 0), wide, SEPARATE, moving=[(0, 1), (0, -1)])
    assert u == pytest.approx((2, 1))


def test_nan_stays_visible():
    assert np.isnan(solved((np.nan, 0), [(0, 1), (1, 1)], SEPARATE, 0.1)[0]).any()
    assert np.isnan(solved((np.nan, 0), [(0, 1)], SLIP)[0]).any()


def test_approach_is_relative():
    _, contacts = solved((0, 0), [(0, 2)], SEPARATE, moving=[(5, 1)])
    assert approach(contacts, 0, (9.0, -2.0)) == -3.0
