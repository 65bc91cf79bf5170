"""The tools of the verification runs: lattices, periodic space, strips, damping."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.core.state import NONE
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import LogNeoHookean, lame
from validation.verification.lattice import Periodic, body, lattice, strip, strip_stepper
from validation.verification.manufactured import put_on, step_count
from validation.verification.settle import Pace, settle

LAW = LogNeoHookean(*lame(1e4, 0.3))


def test_lattice_fills_the_box():
    X = lattice([-1.0, 0.0], [1.0, 0.5], 0.25)
    assert X.shape == (16, 2)
    np.testing.assert_allclose(X.mean(axis=0), [0.0, 0.25])
    np.testing.assert_allclose(np.abs(X).max(axis=0), [0.875, 0.375])
    assert body(X, 0.25, 10.0, LAW, "mls").particles.m.sum() == pytest.approx(10.0)


def test_body_does_not_share_its_places():
    X = lattice([0.0, 0.0], [1.0, 1.0], 0.5)
    block = body(X, 0.5, 1.0, LAW, "pic")
    block.particles.x[:] += 1.0
    assert X.max() == 0.75


def grid_of(m, v, origin):
    return SimpleNamespace(m=m, v=v, v_old=NONE, origin=np.array(origin), dx=1.0)


def test_fold_adds_masses_and_momenta(rng):
    m, v = rng.random((7, 5)), rng.standard_normal((7, 5, 2))
    m[0, 0] = 0.0
    grid = grid_of(m.copy(), v.copy(), (-2, 3))
    Periodic((4, 0)).apply(grid, 0.0, 0.1)
    for i in range(7):
        same = [k for k in range(7) if (k - i) % 4 == 0]
        np.testing.assert_allclose(grid.m[i], m[same].sum(axis=0))
        momentum = (m[..., None] * v)[same].sum(axis=0)
        np.testing.assert_allclose(grid.m[i][:, None] * grid.v[i], momentum, atol=1e-14)


def test_fold_leaves_empty_nodes_finite():
    grid = grid_of(np.zeros((3, 3)), np.full((3, 3, 2), 7.0), (0, 0))
    Periodic((2, 2)).apply(grid, 0.0, 0.1)
    assert not grid.v.any()


def test_periodic_body_does_not_know_where_it_is_cut(rng):
    """A periodic square, and the same one with its particles moved by whole periods, step alike."""
    n, x0 = 4, lattice([0.0, 0.0], [1.0, 1.0], 0.125)
    v0 = 0.1 * rng.standard_normal(x0.shape)
    results = []
    for shift in (0.0, rng.integers(-1, 2, x0.shape)):
        square = body(x0, 0.125, 1.0, LAW, "mls")
        q = square.particles
        q.x[:], q.v[:] = x0 + shift, v0
        advance = Stepper(Scheme(2, "mls"), 1.0 / n, 2, np.zeros(2), Periodic((n, n)))
        advance.start([square])
        for k in range(5):
            advance.step([square], k * 1e-3, 1e-3)
        results.append((q.x - shift, q.v.copy(), q.F.copy()))
    for a, b in zip(*results, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_strip_stays_one_dimensional():
    bar, X = strip(0.0, 4.0, 0.5, 1.0, LAW, ("mls", 2, 2))
    bar.particles.v[:, 0] = 0.1 * np.sin(X)
    advance = strip_stepper(0.5, ("mls", 2, 2))
    advance.start([bar])
    for k in range(5):
        advance.step([bar], k * 1e-3, 1e-3)
    assert np.abs(bar.particles.v[:, 0]).max() > 0.05
    assert np.abs(bar.particles.v[:, 1]).max() < 1e-14
    assert np.abs(bar.particles.F[:, 1, 1] - 1.0).max() < 1e-14


def test_settled_body_is_at_rest_and_carries_its_load():
    """Pressed at both ends by the force 1 N per metre, the middle has P = -1 Pa."""
    bar, X = strip(-2.0, 2.0, 0.5, 1.0, LAW, ("mls", 2, 2))
    load = np.zeros((len(X), 2))
    load[:, 0] = np.where(np.abs(X) > 1.5, -np.sign(X) / 0.5, 0.0)
    sound = np.sqrt((LAW.lam + 2 * LAW.mu) / 1.0)
    settle(bar, strip_stepper(0.5, ("mls", 2, 2)), load, Pace(np.pi * sound / 4.0, 0.2 / sound))
    middle = np.abs(X) < 0.5      # farther out the jump of the load shows
    assert np.abs(bar.particles.v).max() < 1e-6 * sound
    np.testing.assert_allclose(bar.particles.tau[middle, 0, 0], -1.0, rtol=1e-3)


def test_steps_meet_the_checks():
    assert step_count(1.0, 0.03) == 40
    assert step_count(1.0, 0.05) == 20


def test_bodies_start_on_the_motion_half_a_step_back():
    """A rigid turn at the rate 1: v of time -dt/2, and C its gradient."""
    X, dt = lattice([0.0, 0.0], [1.0, 1.0], 0.25), 0.02
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])

    def R(t):
        return np.cos(t) * np.eye(2) + np.sin(t) * turn

    motion = SimpleNamespace(
        position=lambda t: X @ R(t).T, velocity=lambda t: X @ (turn @ R(t)).T,
        gradient=lambda t: np.tile(R(t), (len(X), 1, 1)))
    q = body(X, 0.25, 1.0, LAW, "mls").particles
    put_on(q, motion, dt)
    np.testing.assert_allclose(q.v, X @ (turn @ R(-dt / 2)).T)
    np.testing.assert_allclose(q.C, np.tile(turn, (len(X), 1, 1)), atol=1e-4)
    np.testing.assert_allclose(q.F, np.tile(np.eye(2), (len(X), 1, 1)))
