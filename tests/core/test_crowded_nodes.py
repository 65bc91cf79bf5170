"""Contact at nodes that three fields or more share."""

from itertools import combinations, permutations

import numpy as np
import pytest
from threads import by_threads

from mpm_ref.core.body_contact import VolumeShare
from mpm_ref.core.crowded_nodes import (
    FieldRules,
    crowd_solution,
    meetings,
    settle_crowd,
    sweep,
)
from mpm_ref.core.state import NONE, Grid

DT, DX = 0.01, 0.1
NODES = 400


def nodes_of(m, v, v_old=NONE):
    """Grids of K nodes in a line, one for each of F fields: m (F, K), v (F, K, d)."""
    F, K, d = v.shape
    shape = K, *(d - 1) * [1]
    carry = v_old if v_old.ndim == 1 else v_old.reshape(F, *shape, d)
    return [Grid(m[f].reshape(shape).copy(), v[f].reshape(*shape, d).copy(), NONE,
                 carry if carry.ndim == 1 else carry[f].copy(), np.zeros(d, np.int64), DX)
            for f in range(F)]


def shares_of(phi, G):
    """{field: VolumeShare} of phi (F, K) and G (F, K, d)."""
    F, K, d = G.shape
    slot = np.arange(K).reshape(K, *(d - 1) * [1])
    return {f: VolumeShare(slot, phi[f], G[f]) for f in range(F)}


def rules(F, glued=(), mu=0.0):
    """Rules of F fields that touch with a friction, but for the glued pairs."""
    stuck = np.eye(F, dtype=np.bool_)
    for a, b in glued:
        stuck[a, b] = stuck[b, a] = True
    return FieldRules(stuck, np.full((F, F), mu))


def crowd_of_all(grids):
    pairs, crowd = meetings(grids)
    assert not pairs
    return crowd


def settled(m, v, shares, rules):
    """Velocities (F, K, d) after contact."""
    grids = nodes_of(m, v)
    settle_crowd(grids, crowd_of_all(grids), shares, rules, DT)
    return np.stack([g.v.reshape(v.shape[1:]) for g in grids])


def in_line(speeds, masses=(1.0, 1.0, 1.0)):
    """m, v and shares of three bodies at one node that fill all space, in a line along x."""
    v = np.zeros((3, 1, 2))
    v[:, 0, 0] = speeds
    G = np.zeros((3, 1, 2))
    G[:, 0, 0] = -5.0, 0.0, 5.0
    return np.array(masses)[:, None], v, shares_of(np.full((3, 1), 1.0 / 3.0), G)


def random_nodes(rng, F=3, d=2, spread=1.0):
    """m, v and shares at many nodes; half of them are full, the others have a gap."""
    m = 10.0 ** rng.uniform(-spread, spread, (F, NODES))
    v = rng.normal(size=(F, NODES, d))
    G = rng.normal(size=(F, NODES, d)) / DX
    phi = rng.uniform(0.2, 0.4, (F, NODES))
    phi *= np.where(rng.random(NODES) < 0.5, 1.0, 1.0 - 0.1 * rng.random(NODES)) / phi.sum(axis=0)
    return m, v, shares_of(phi, G)


# which nodes

def test_nodes_of_two_fields_are_no_crowd():
    m = np.zeros((3, 6))
    m[0, :5], m[1, 1:], m[2, 2:4] = 1.0, 1.0, 1.0
    grids = nodes_of(m, np.zeros((3, 6, 2)))
    pairs, crowd = meetings(grids)
    assert list(pairs) == [(0, 1)]
    assert (pairs[0, 1].first == [1, 4]).all()
    assert (pairs[0, 1].second == [1, 4]).all()
    assert (crowd.start == [0, 3, 6]).all()
    assert (crowd.field == [0, 1, 2, 0, 1, 2]).all()
    assert (crowd.node == [2, 2, 2, 3, 3, 3]).all()


def test_without_a_third_field_no_node_is_crowded():
    grids = nodes_of(np.ones((2, 6)), np.zeros((2, 6, 2)))
    pairs, crowd = meetings(grids)
    assert len(pairs[0, 1].first) == 6
    assert (len(crowd.node), list(crowd.start)) == (0, [0])


# glue

def test_three_glued_fields_get_their_joint_mean():
    m, v, _ = in_line((3.0, 0.0, 0.0))
    u = settled(m, v, {}, rules(3, [(0, 1), (1, 2), (0, 2)]))
    assert u[:, 0, 0] == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_glue_passes_on(order):
    """Of two fields that touch each other, but are glued to a third one."""
    m, v, shares = in_line((3.0, 0.0, -1.0), (1.0, 2.0, 4.0))
    a, b, c = order
    u = settled(m, v, shares, rules(3, [(a, b), (b, c)]))
    assert u[:, 0, 0] == pytest.approx(-1.0 / 7.0, abs=1e-15)


def test_glued_fields_touch_a_third_one_as_one(rng):
    m, v, shares = random_nodes(rng)
    stuck = rules(3, [(0, 2)], 0.3)
    u = settled(m, v, shares, stuck)
    assert u[0] == pytest.approx(u[2], abs=1e-14)
    assert not u[0] == pytest.approx(u[1], abs=0.1)
    total = m[:, :, None]
    assert (total * u).sum(axis=0) == pytest.approx((total * v).sum(axis=0), abs=1e-13)


def test_velocities_before_forces_are_glued_alone(rng):
    m, v, shares = random_nodes(rng)
    v_old = rng.normal(size=v.shape)
    grids = nodes_of(m, v, v_old)
    settle_crowd(grids, crowd_of_all(grids), shares, rules(3, [(0, 1)]), DT)
    u_old = np.stack([g.v_old.reshape(v.shape[1:]) for g in grids])
    mean = (m[0, :, None] * v_old[0] + m[1, :, None] * v_old[1]) / (m[0] + m[1])[:, None]
    assert u_old[:2] == pytest.approx(np.stack([mean, mean]), abs=1e-14)
    assert (u_old[2] == v_old[2]).all()


# pairs that touch

@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_no_pair_closes_whatever_the_order(order):
    """Of fields at speeds 1, 0 and -1 in a row; one pass leaves the first pair closing."""
    m, v, shares = in_line((1.0, 0.0, -1.0))
    shares = {k: shares[f] for k, f in enumerate(order)}
    u = settled(m, v[list(order)], shares, rules(3))
    assert u == pytest.approx(0.0, abs=1e-12)


def solution(m, v, shares, rules):
    """`CrowdState` and `CrowdPairs` after contact, and which nodes are (K,): those at which another
    sweep would change nothing.
    """
    grids, like = nodes_of(m, v), tuple(range(v.shape[2]))
    crowd = crowd_of_all(grids)
    state, pairs = crowd_solution(grids, crowd, shares, rules, DT)
    changes = [sweep(state, pairs, (pairs.start[k], pairs.start[k + 1]), DT, like)[0]
               for k in range(v.shape[1])]
    return state, pairs, np.array(changes) < 1e-11


@pytest.mark.parametrize("F", [3, 4])
def test_without_friction_the_energy_is_least(d, F, rng):
    """Of all velocities at which no gap closes too far, by enumeration of the closed gaps."""
    m, v, shares = random_nodes(rng, F, d)
    state, _, ready = solution(m, v, shares, rules(F))
    u = state.u.reshape(NODES, F, d).transpose(1, 0, 2)
    assert ready.mean() > 0.95
    for k in np.flatnonzero(ready)[::8]:
        expected = nearest(m[:, k], v[:, k], [(shares[f].phi[k], shares[f].G[k])
                                              for f in range(F)])
        assert u[:, k] == pytest.approx(expected, abs=1e-9)


def nearest(m, v, shares):
    """The velocities (F, d) of one node, nearest to v in the metric of the masses m (F,)."""
    empty, rows, limits = 1.0 - sum(phi for phi, _ in shares), [], []
    for a, b in combinations(range(len(m)), 2):
        n = shares[b][1] - shares[a][1]
        slope = np.linalg.norm(n)
        row = np.zeros(v.shape)
        row[a], row[b] = n / slope, -n / slope
        rows.append(row.ravel())
        limits.append(2.0 * max(empty, 0.0) / slope / DT)
    A, limits, share = np.array(rows), np.array(limits), np.repeat(1.0 / m, v.shape[1])
    for count in range(len(limits) + 1):
        for closed in map(list, combinations(range(len(limits)), count)):
            B = A[closed]
            load = np.linalg.lstsq((B * share) @ B.T, B @ v.ravel() - limits[closed], rcond=None)[0]
            u = v.ravel() - share * (B.T @ load)
            if (load >= -1e-12).all() and (A @ u <= limits + 1e-9).all():
                return u.reshape(v.shape)
    raise AssertionError("no set of closed gaps suits")


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0, 10.0])
@pytest.mark.parametrize("F", [3, 5])
def test_the_laws_of_signorini_and_coulomb_hold(d, F, mu, rng):
    """But where sweeps go in circles, as a friction of 10 and five fields let some."""
    m, v, shares = random_nodes(rng, F, d)
    state, pairs, ready = solution(m, v, shares, rules(F, mu=mu))
    assert ready.mean() > (0.95 if mu < 10.0 else 0.85)
    w = state.u[pairs.first] - state.u[pairs.second]
    closing, load = ((pairs.n * a).sum(axis=1) for a in (w, pairs.l))
    sliding, t = w - closing[:, None] * pairs.n, pairs.l - load[:, None] * pairs.n
    size, most = np.linalg.norm(t, axis=1), pairs.mu * load
    slack = np.maximum(pairs.gap, 0.0) / DT - closing
    slips = np.linalg.norm(sliding, axis=1) > 1e-6
    errors = [np.maximum(-slack, 0.0), np.maximum(-load, 0.0), load * slack,
              np.maximum(size - most, 0.0), np.where(slips, most - size, 0.0),
              np.where(slips, size * np.linalg.norm(sliding, axis=1) - (t * sliding).sum(axis=1),
                       0.0)]
    of_ready = np.repeat(ready, np.diff(pairs.start))
    for error in errors:
        assert error[of_ready] == pytest.approx(0.0, abs=1e-9)
    assert 0 < (load > 0.0).sum() < len(load)
    assert (pairs.mu == mu).mean() > 0.99


@pytest.mark.parametrize("mu", [0.0, 0.3, 10.0])
@pytest.mark.parametrize("spread", [1.0, 6.0])
def test_momentum_is_exact_and_no_node_gains_energy(d, mu, spread, rng):
    """Also where masses differ so much that sweeps end before they converge."""
    m, v, shares = random_nodes(rng, 4, d, spread)
    u, m = settled(m, v, shares, rules(4, mu=mu)), m[:, :, None]
    p = np.abs(m * v).sum(axis=0)
    assert ((m * (u - v)).sum(axis=0) / p) == pytest.approx(0.0, abs=1e-13)
    before, after = ((m * w**2).sum(axis=(0, 2)) for w in (v, u))
    assert (after <= before * (1.0 + 1e-10)).all()
    assert (after < 0.99 * before).mean() > 0.2


def test_nodes_that_would_gain_energy_have_no_friction():
    """Of many that circle with a friction of 10, a few; these have the solution without."""
    drawn = random_nodes(np.random.default_rng(1), 6, 3)
    state, pairs, _ = solution(*drawn, rules(6, mu=10.0))
    other, _, ready = solution(*drawn, rules(6))
    guarded = (pairs.mu == 0.0).reshape(NODES, -1).all(axis=1) & ready
    assert 0 < guarded.sum() < 0.02 * NODES
    u, expected = (s.u.reshape(NODES, 6, 3)[guarded] for s in (state, other))
    assert u == pytest.approx(expected, abs=1e-8)


def test_without_friction_each_sweep_lowers_the_energy(rng):
    """From before contact on, however far from convergence; so a guarded node cannot gain any."""
    m, v, shares = random_nodes(rng, 5, 2, 3.0)
    state, pairs, _ = solution(m, v, shares, rules(5))
    state.u[:], pairs.l[:] = state.v, 0.0
    m = np.repeat(1.0, 2) * state.M[:, None]
    start = before = (m * state.v**2).reshape(NODES, -1).sum(axis=1)
    for _ in range(20):
        for k in range(NODES):
            sweep(state, pairs, (pairs.start[k], pairs.start[k + 1]), DT, (0, 1))
        load = (pairs.n * pairs.l).sum(axis=1) * np.maximum(pairs.gap, 0.0) / DT
        after = (m * state.u**2).reshape(NODES, -1).sum(axis=1)
        lower = after + 2.0 * load.reshape(NODES, -1).sum(axis=1)
        assert (lower <= before * (1.0 + 1e-12)).all()
        assert (after <= start * (1.0 + 1e-12)).all()
        before = lower
    assert (after < 0.9 * start).mean() > 0.2


def test_one_and_two_threads_give_the_same_bits(rng):
    m, v, shares = random_nodes(rng, 4, 3)
    one, two = by_threads(lambda: settled(m, v, shares, rules(4, mu=0.3)).tobytes())
    assert one == two
