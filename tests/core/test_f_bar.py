"""Averaged growth of volume: against the plain twin, and what the averages must keep."""

from types import SimpleNamespace

import numpy as np
import pytest
from clouds import DX, Case, cloud
from threads import by_threads

from mpm_ref.core.f_bar import NODES, averaged, cell_weights
from mpm_ref.core.grid import Storage
from mpm_ref.plain import f_bar as plain

DT = 0.01
ROUND_OFF = 5e-13       # of Lbar relative to L: round-off of I + dt L, over dt


@pytest.fixture
def points(d, rng):
    """Random particles in two or three dimensions, with a random velocity gradient."""
    q = cloud(Case("pic", 2, d), rng)
    q.L[:] = rng.normal(scale=5.0, size=q.L.shape)
    return q


def Lbar_of(q, dt=DT):
    return averaged(q, Storage(DX, NODES, q.x.shape[1]).cover([q.x]), dt)


def growth(L):
    return np.linalg.det(np.eye(L.shape[1]) + DT * L)


def mean(q, a):
    """Averages (N,) of positive numbers a (N,): those of a step in which volumes grow by them."""
    d = q.x.shape[1]
    L = (a ** (1.0 / d) - 1.0)[:, None, None] * np.eye(d) / DT
    return growth(Lbar_of(q._replace(L=L)))


def test_averages_equal_the_twin(points):
    q, wide = points, np.longdouble
    exact = plain.averaged(SimpleNamespace(x=q.x.astype(wide), L=q.L.astype(wide)),
                           q.V0.astype(wide), wide(DX), wide(DT))
    assert abs(Lbar_of(q) - exact).max() < ROUND_OFF * abs(exact).max()


def test_growth_alone_changes(points):
    """Gbar is G times a number, and the volumes differ from those before by more than a tenth."""
    G, Gbar = (np.eye(len(points.x[0])) + DT * L for L in (points.L, Lbar_of(points)))
    ratio = Gbar / G
    assert np.ptp(ratio.reshape(len(G), -1), axis=1).max() < 1e-9 * ratio.max()
    assert abs(growth(Lbar_of(points)) / growth(points.L) - 1.0).max() > 0.1


def test_uniform_gradients_stay(points, d, rng):
    """Shear, rotation and growth of a whole body, of any of its particles alone, and rest."""
    points.L[:] = rng.normal(size=(d, d))
    assert abs(Lbar_of(points) - points.L).max() < ROUND_OFF * abs(points.L).max()
    points.L[:] = 0.0
    assert abs(Lbar_of(points)).max() < ROUND_OFF


def test_the_volume_of_all_particles_stays(points):
    assert points.V0 @ growth(Lbar_of(points)) == pytest.approx(points.V0 @ growth(points.L),
                                                                rel=1e-13)


def test_averages_are_symmetric_and_contract(points, rng):
    """sum_p V0_p a_p mean(b)_p is symmetric and between 0 and that of a itself: averaged volumes
    have an energy, and no wave becomes faster, so that the bound of the time step stays.
    """
    V0, (a, b) = points.V0, rng.uniform(0.5, 2.0, (2, len(points.x)))
    assert (V0 * a) @ mean(points, b) == pytest.approx((V0 * b) @ mean(points, a), rel=1e-12)
    off = a - V0 @ a / V0.sum()             # averages are linear, and keep constants
    averages = mean(points, 2.0 + 0.5 * off) - 2.0
    assert 0.0 < (V0 * 0.5 * off) @ averages < 0.9 * (V0 @ (0.5 * off) ** 2)


def test_weights_add_up_and_average_alternating_fields_out(rng):
    """sum_c w_c = 1, sum_c w_c x_c = x, sum_c (-1)^c w_c = 0: a checkerboard vanishes."""
    s = 1.0 + rng.random(2)
    for s_a, w in zip(s, cell_weights(tuple(s))):
        assert sum(w) == pytest.approx(1.0)
        assert np.dot(w, (0.5, 1.5, 2.5)) == pytest.approx(s_a)
        assert np.dot(w, (1.0, -1.0, 1.0)) == pytest.approx(0.0, abs=1e-15)


def test_averages_turn_with_the_body(points, d):
    """A quarter turn of body and grid turns the averaged gradient."""
    Q = np.eye(d)
    Q[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    turned = points._replace(x=points.x @ Q.T, L=Q @ points.L @ Q.T)
    assert abs(Lbar_of(turned) - Q @ Lbar_of(points) @ Q.T).max() < 1e-10


def test_particles_on_the_borders_of_cells(points):
    """A cell next to them may have the weight 0 of all particles, hence no mean."""
    points.x[:] = DX * np.round(points.x / DX)
    points.x[:, 0] = DX * 3
    assert np.isfinite(Lbar_of(points)).all()


def test_a_step_that_turns_matter_inside_out_stays(points):
    points.L[3] = np.diag([-1.5 / DT] + [0.0] * (points.x.shape[1] - 1))
    assert Lbar_of(points)[3] == pytest.approx(points.L[3], abs=1e-9)


def test_any_number_of_threads_gives_the_same_bits(points):
    one, two = by_threads(lambda: Lbar_of(points).tobytes())
    assert one == two
