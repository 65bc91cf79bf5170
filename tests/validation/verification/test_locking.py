"""The references of verification.locking, and that its measures see what they are for."""

import numpy as np
import pytest

from mpm_ref.materials import lame
from validation.verification import locking
from validation.verification.locking import E, alternating, at_rest, between_walls
from validation.verification.mixed_elements import mapped_square, solve


def square(s, t):
    return s, t


@pytest.mark.parametrize("nu", [0.3, 0.4999])
def test_mixed_elements_give_a_column_under_its_weight(nu):
    """u_y = -b (y - y^2/2)/(lam + 2 mu) and p = lam b (1 - y)/(lam + 2 mu): both in the spaces."""
    mu, lam = lame(E, nu)
    found = solve(mapped_square(square, 2), (mu, lam), between_walls,
                  lambda x: np.stack([0.0 * x[..., 0], -3.0 + 0.0 * x[..., 0]], axis=-1))
    y = found.mesh.X[:, 1]
    exact = -3.0 * (y - 0.5 * y**2) / (lam + 2.0 * mu)
    assert abs(found.u[:, 1] - exact).max() < 1e-9 * abs(exact).max()
    assert abs(found.u[:, 0]).max() < 1e-9 * abs(exact).max()
    p = 3.0 * lam / (lam + 2.0 * mu) * np.array([1.0, 0.5, 0.0])
    assert abs(found.p - p).max() < 1e-6
    assert found.displacement == pytest.approx(-3.0 / 3.0 / (lam + 2.0 * mu))


def test_rayleighs_quotient_is_above_the_lowest_frequency():
    """Of the column: sqrt((lam + 2 mu)/rho) pi/2; the deflection is nearly the mode."""
    mu, lam = lame(E, 0.3)
    found = solve(mapped_square(square, 4), (mu, lam), between_walls,
                  lambda x: np.stack([0.0 * x[..., 0], -1.0 + 0.0 * x[..., 0]], axis=-1))
    assert found.frequency(1e3) == pytest.approx(np.sqrt((lam + 2.0 * mu) / 1e3) * np.pi / 2.0,
                                                 rel=0.01)


@pytest.mark.parametrize("nu", [0.3, 0.4999])
def test_references_have_converged(monkeypatch, nu):
    coarse = {kind: locking.BODIES[kind](nu, 12, 2).exact for kind in ("membrane", "block")}
    monkeypatch.setattr(locking, "ELEMENTS", 2 * locking.ELEMENTS)
    for kind, exact in coarse.items():
        assert locking.BODIES[kind](nu, 12, 2).exact == pytest.approx(exact, rel=1e-3)


def test_cooks_membrane_is_that_of_the_literature():
    """Area 1440 m^2, and nearly the same force over the edge for any sampling."""
    for cells, per in ((12, 2), (24, 2)):
        loaded = locking.membrane(0.3, cells, per)
        area = (loaded.dx / per) ** 2
        behind = loaded.X[:, 0] > -locking.DEPTH * loaded.dx
        assert behind.sum() * area == pytest.approx(1440.0, rel=0.02)
        assert loaded.force[:, 1].sum() * area == pytest.approx(1e-4 * E)


def test_checkerboards_are_seen_and_slopes_are_not(rng):
    cells = 8
    i, j = np.meshgrid(range(2 * cells), range(2 * cells), indexing="ij")
    board = (-1.0) ** (i // 2 + j // 2)
    assert alternating(board.ravel(), cells) == pytest.approx(1.0)
    assert alternating((2.0 * i - j).ravel(), cells) == pytest.approx(0.0, abs=1e-12)
    rows = (-1.0) ** (j // 2)
    assert alternating(rows.ravel(), cells) == pytest.approx(np.sqrt(0.5))


def test_averaged_volumes_free_a_bent_bar():
    """Three cells over its height: without them it bends by less than a third."""
    locked, free = (at_rest(("bar", 3), 0.4999, ("mls", 2, 2), f_bar).ratio
                    for f_bar in (False, True))
    assert locked < 1.0 / 3.0
    assert free == pytest.approx(1.0, abs=0.05)
