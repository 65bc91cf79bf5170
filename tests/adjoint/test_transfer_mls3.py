"""The fast adjoint of the transfer, MLS form, quadratic splines, 3D: the sums of the plain one."""

import numpy as np
import pytest

from mpm_ref.core.adjoint.transfer import Advection, MlsForm, gather_bars, scatter_bars
from mpm_ref.core.adjoint.transfer_mls3 import gather_bars_mls3, scatter_bars_mls3
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.state import NO_HISTORY, NONE, Grid, Particles
from mpm_ref.core.stencil import inverse_inertia

QUADRATIC, DX, DT, N, NODES = STENCILS[2], 0.05, 1e-2, 40, 9
ORIGIN = np.array((3, -5, 7))


def random_grid(rng):
    """Nodes of random masses and velocities."""
    shape = (NODES, NODES, NODES)
    return Grid(rng.normal(size=shape), rng.normal(size=(*shape, 3)), NONE, NONE, ORIGIN, DX)


def random_particles(rng, fluid, forced):
    """Particles anywhere among the nodes, the first one on a node."""
    x = (ORIGIN + 1.5 + rng.random((N, 3)) * (NODES - 4)) * DX
    x[0] = (ORIGIN + 3) * DX
    tau = rng.normal(size=(N,) if fluid else (N, 3, 3))
    b = rng.normal(size=(N, 3)) if forced else NONE
    return Particles(x, rng.normal(size=(N, 3)), rng.normal(size=(N, 3, 3)), NONE, NONE, tau,
                     rng.random(N), rng.random(N), NO_HISTORY, b)


def bars_of(particles, rng):
    """Bars that are there before."""
    return Particles(*(rng.normal(size=a.shape) for a in particles))


def twice(particles):
    return [Particles(*(a.copy() for a in particles)) for _ in range(2)]


def assert_same(found, expected):
    for name, a, b in zip(type(found)._fields, found, expected, strict=True):
        if np.size(a):
            assert np.abs(a - b).max() <= 1e-14 * np.abs(b).max(), name


@pytest.mark.parametrize("forced", [False, True], ids=["free", "forced"])
@pytest.mark.parametrize("fluid", [False, True], ids=["solid", "fluid"])
def test_bars_of_particles_are_those_of_the_plain_adjoint(fluid, forced):
    rng = np.random.default_rng(0)
    particles, nodes = random_particles(rng, fluid, forced), random_grid(rng)
    found, expected = twice(bars_of(particles, rng))
    gather_bars_mls3(particles, nodes, found, QUADRATIC, DT, (0, N))
    form = MlsForm(DT, inverse_inertia(DX, QUADRATIC))
    gather_bars(particles, nodes, expected, QUADRATIC, form, (0, N))
    assert_same(found, expected)


def test_bars_of_nodes_are_those_of_the_plain_adjoint():
    rng = np.random.default_rng(1)
    particles, grid = random_particles(rng, False, False), random_grid(rng)
    moved = Advection(particles.x, rng.normal(size=(N, 3)), NONE)
    bars = bars_of(particles, rng)
    bars.v[:] = 0.0                                     # what FLIP alone has
    found, expected = twice(bars)
    nodes = [Grid(np.zeros_like(grid.m), np.zeros_like(grid.v), NONE, NONE, ORIGIN, DX)
             for _ in range(2)]
    scatter_bars_mls3(moved, grid, found, nodes[0], QUADRATIC, np.arange(N))
    scatter_bars(moved, grid, expected, nodes[1], QUADRATIC, np.arange(N))
    assert_same(found, expected)
    assert np.abs(nodes[0].v - nodes[1].v).max() <= 1e-14 * np.abs(nodes[1].v).max()
