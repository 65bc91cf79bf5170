"""Walls counted in nodes, NCLaw's exactly, and the clamp of the particles."""

import numpy as np
import pytest
from grids import DX, applied, grid_of, positions, random_grid

from mpm_ref.core.boundary import BoxWalls, Collider, nclaw_walls
from mpm_ref.core.levelset import half_space


def nclaw_by_hand(v, index, G, bound, noslip):
    """The walls of NCLAW-sim at one node, axis by axis, as its release applies them."""
    v = v.copy()
    for towards in (-1.0, 1.0):
        for a in range(len(v)):
            wall = index[a] < bound if towards < 0 else index[a] > G - bound
            if wall and towards * v[a] > 0.0:
                v[slice(None) if noslip else a] = 0.0
    return v


@pytest.mark.parametrize("kind", ["separate", "noslip"])
def test_nclaw_walls_are_exact(kind, rng):
    """All 20^3 nodes, to the last bit, also on a window of the grid."""
    v = rng.normal(size=(20, 20, 20, 3))
    v[rng.random(v.shape) < 0.1] *= 1e-12          # small approaches are stopped too
    expected = np.array([nclaw_by_hand(v[i], i, 20, 3, kind == "noslip")
                         for i in np.ndindex(20, 20, 20)]).reshape(v.shape)
    walls = nclaw_walls(20, 3, kind=kind)
    assert (applied(grid_of(v, dx=1 / 20), walls=walls)[1] == expected).all()
    part = grid_of(v[2:, 2:, 2:], origin=2, dx=1 / 20)
    assert (applied(part, walls=walls)[1] == expected[2:, 2:, 2:]).all()
    assert np.count_nonzero(expected == 0.0) > 1000


def test_walls_on_some_axes_only():
    v, u, J = applied(grid_of(np.ones((5, 5, 2)), origin=-2),
                      walls=BoxWalls((None, -1), (1, None), "sticky"))
    held = np.zeros((5, 5), dtype=bool)
    held[4:], held[:, :1] = True, True
    assert (u == np.where(held[..., None], 0.0, v)).all()
    assert J.shape == (4, 2)
    assert (J[[0, 3]] == 0.0).all()
    assert J[1, 0] == J[2, 0] == -4.5          # four nodes each, and the one they share


def test_a_window_of_the_grid_between_or_in_the_walls():
    walls = nclaw_walls(9, 3, 2)
    for origin, sign, held in ((3, -1, False), (5, 1, False), (7, 1, True), (-5, -1, True)):
        v, u, _ = applied(grid_of(np.full((2, 2, 2), sign), origin), walls=walls)
        assert (u == (0.0 if held else v)).all()


def test_walls_and_colliders_together(d, rng):
    """An incline that runs into a wall: both hold at the nodes they share."""
    n = np.ones(d) / np.sqrt(d)
    grid = random_grid(rng, d)
    _, u, _ = applied(grid, Collider(half_space(np.zeros(d), n), "separate"),
                      walls=BoxWalls(d * (-1,), d * (None,)))
    x = positions(grid)
    on_incline = (x @ n <= 1e-9) & (grid.m > 0.0)
    assert (u[on_incline] @ n > -1e-12).all()
    for a in range(d):
        assert (u[(x[..., a] < -1.5 * DX) & (grid.m > 0.0)][:, a] >= -1e-12).all()


@pytest.mark.parametrize(("make", "said"), [
    (lambda: BoxWalls((0.5, 0), (1, 1)), "expected a node index or None for each axis"),
    (lambda: BoxWalls((0, 0), (1, 1, 1)), "expected a node index or None for each axis"),
    (lambda: applied(grid_of(np.ones((2, 2, 2))), walls=nclaw_walls(20, 3)), "expected 2 limits"),
])
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
