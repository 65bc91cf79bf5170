"""Adjoints of p2g, g2p and damping, against the primal kernels."""

import numpy as np
import pytest
from adjoints import (
    DT,
    DX,
    direction,
    g2p_bars,
    g2p_loss,
    how_of,
    inputs_of,
    inside_cells,
    like_grid,
    p2g_bars,
    p2g_loss,
    pairing,
    rate,
    shifted,
    zeros,
)
from clouds import Case, cloud, scattered
from problems import run_python
from threads import MOST, by_threads
from variants import slow_but

from mpm_ref.core.adjoint.records import packed_velocities
from mpm_ref.core.adjoint.shape_gradient import curvatures
from mpm_ref.core.adjoint.transfer import velocity_gradients
from mpm_ref.core.spline import STENCILS, slopes
from mpm_ref.core.transfer import rpic

# What is compiled costs seconds; every transfer and degree runs without compilation below.
CASES = (Case("flip", 3, 2, body_force=True), Case("mls", 2, 3), Case("flip", 2, 2, gimp=2.0),
         Case("apic", 2, 2, body_force=True, relaxed=True), Case("mls", 3, 3, relaxed=True))

EVERYTHING = """
import json
from clouds import EVERY
from tests.adjoint.test_transfer import orders
print(json.dumps({case.name: orders(case, n=6) for case in EVERY}))
"""

KINKS = """
import json
from clouds import EVERY
from tests.adjoint.test_transfer import off_above
print(json.dumps({case.name: off_above(case) for case in EVERY}))
"""


@pytest.fixture(params=CASES, ids=lambda case: case.name)
def case(request):
    return request.param


def p2g_order(case, n):
    """Observed order of the remainder in all inputs of p2g."""
    rng = np.random.default_rng(3)
    q = inside_cells(case, rng, n)
    nodes, dq = like_grid(scattered(case, q, DT), rng), direction(q, rng, inputs_of(case))
    slope = pairing(p2g_bars(case, q, nodes), dq)
    return rate(lambda h: p2g_loss(case, shifted(q, dq, h), nodes), slope)


def g2p_order(case, n):
    """The same of g2p, in x, v, with relaxation C, and the grid's velocities."""
    rng = np.random.default_rng(4)
    q = inside_cells(case, rng, n)
    grid = like_grid(scattered(case, q, DT), rng)
    before = ("x", "v", "C") if case.relaxed else ("x", "v")
    seeds, dq = direction(q, rng, ("x", "v", "C", "L")), direction(q, rng, before)
    by = like_grid(grid, rng)
    bars, nodes = g2p_bars(case, q, grid, seeds)

    def loss(h):
        new = grid._replace(v=grid.v + h * by.v, v_old=grid.v_old + h * by.v_old)
        return g2p_loss(case, shifted(q, dq, h), new, seeds)

    n = len(before)
    slope = pairing(bars[:n], dq[:n]) + pairing((nodes.v, nodes.v_old), (by.v, by.v_old))
    return rate(loss, slope)


def orders(case, n=40):
    """Both."""
    return [p2g_order(case, n), g2p_order(case, n)]


def test_remainder_is_of_second_order(case):
    assert orders(case) == pytest.approx([2.0, 2.0], abs=0.1)


def test_remainder_is_of_second_order_in_every_case():
    """All transfers, degrees and dimensions, as plain Python. A gradient that is wrong has 1."""
    found = run_python(EVERYTHING, NUMBA_DISABLE_JIT="1")
    assert len(found) == 64
    assert min(min(pair) for pair in found.values()) > 1.7


def test_linear_inputs_are_met_to_round_off(case):
    """p2g is linear in v, C, tau, b; g2p in the grid's velocities and in v, but for the spin of
    relaxation, a product of both.
    """
    rng = np.random.default_rng(5)
    q = cloud(case, rng)
    nodes = like_grid(scattered(case, q, DT), rng)
    dq = direction(q, rng, set(inputs_of(case)) - {"x", "m", "V0"})
    step = p2g_loss(case, shifted(q, dq, 1.0), nodes) - p2g_loss(case, q, nodes)
    assert step == pytest.approx(pairing(p2g_bars(case, q, nodes), dq), rel=1e-11)

    if case.relaxed:
        return
    still = q._replace(v=0.0 * q.v)
    seeds = direction(q, rng, ("v", "C", "L"))
    of_nodes = g2p_bars(case, still, nodes, seeds)[1]
    value = g2p_loss(case, still, nodes, seeds)
    fields = (of_nodes.v, of_nodes.v_old), (nodes.v, nodes.v_old)
    assert value == pytest.approx(pairing(*fields), rel=1e-11)


@pytest.mark.parametrize("name", ["x", "v", "tau", "m", "V0"])
def test_single_entries_of_a_particle_on_a_node(case, name):
    """Central differences of one particle; all are on nodes, where nothing has a kink."""
    rng = np.random.default_rng(6)
    q = cloud(case, rng, 40)
    q.x[:] = DX * np.rint(q.x / DX)
    nodes, h, p = like_grid(scattered(case, q, DT), rng), 2e-7, abs(q.x).max(axis=1).argmin()
    bar = getattr(p2g_bars(case, q, nodes), name)
    size = abs(bar).max()
    for k in np.ndindex(bar.shape[1:]):
        dq = zeros(q)
        getattr(dq, name)[(p, *k)] = 1.0
        slope = (p2g_loss(case, shifted(q, dq, h), nodes)
                 - p2g_loss(case, shifted(q, dq, -h), nodes)) / (2 * h)
        assert slope == pytest.approx(bar[(p, *k)], abs=1e-6 * size)


def off_above(case):
    """Relative error of one-sided differences of p2g where every particle's stencil changes, or
    its slopes have a kink.
    """
    rng, h = np.random.default_rng(8), 1e-7
    q = inside_cells(case, rng, 4)
    kink = min(case.kinks, default=0.0)
    q.x[:] = DX * (np.floor(q.x / DX) + 0.5 * (case.degree - 1) + kink + 1e-9)
    nodes, dq = like_grid(scattered(case, q, DT), rng), zeros(q)
    dq.x[:] = DX * rng.uniform(0.5, 1.0, q.x.shape)
    slope = pairing(p2g_bars(case, q, nodes), dq)
    rise = p2g_loss(case, shifted(q, dq, h), nodes) - p2g_loss(case, q, nodes)
    return abs(rise / h - slope) / abs(slope)


def test_derivative_at_kinks_is_that_from_above():
    """On nodes for degrees 1 and 3, between them for 2, in cells for GIMP; all cases, as plain
    Python.
    """
    assert max(run_python(KINKS, NUMBA_DISABLE_JIT="1").values()) < 1e-5


def test_damping_is_its_own_adjoint(d, rng):
    A, B = rng.normal(size=(2, 9, d, d))
    damped, bar = A.copy(), B.copy()
    rpic(damped, 0.3)
    rpic(bar, 0.3)
    assert (damped * B).sum() == pytest.approx((A * bar).sum(), rel=1e-13)


@pytest.mark.parametrize("degree", STENCILS)
def test_curvatures_are_slopes_of_slopes(degree, rng):
    """Slopes are polynomials of degree 2 at most: central differences are exact."""
    for f in rng.uniform(0.5 * (degree - 1) + 0.1, 0.5 * (degree + 1) - 0.1, 5):
        rise = np.subtract(slopes(f + 0.1, STENCILS[degree]), slopes(f - 0.1, STENCILS[degree]))
        assert rise / 0.2 == pytest.approx(np.array(curvatures(f, STENCILS[degree])), abs=1e-13)


def bits_are_the_same(case):
    """Whether one thread and two give the same bars, of particles and of nodes, and the same L."""
    rng = np.random.default_rng(7)
    q = cloud(case, rng, 200, width=12.0)
    grid = like_grid(scattered(case, q, DT), rng)
    seeds = direction(q, rng, ("x", "v", "C", "L"))

    def bars():
        L = np.empty((len(q.x), case.d, case.d))
        velocity_gradients(q.x, packed_velocities(grid), L, how_of(case))
        bars, nodes = g2p_bars(case, q, grid, seeds)
        return L, *bars, nodes.v, nodes.v_old, *p2g_bars(case, q, nodes)

    return all(np.array_equal(a, b) for a, b in zip(*by_threads(bars)))


@pytest.mark.skipif(MOST < 2, reason="one core")
@pytest.mark.parametrize("case", slow_but([*CASES, Case("apic", 2, 3), Case("pic", 3, 3)],
                                          *CASES[1:3]), ids=lambda case: case.name)
def test_two_threads_give_the_same_bits(case):
    assert bits_are_the_same(case)


@pytest.mark.slow
@pytest.mark.skipif(MOST < 2, reason="one core")
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("transfer", ["pic", "flip", "apic", "mls"])
def test_two_threads_give_the_same_bits_for_every_form(transfer, degree, d):
    assert bits_are_the_same(Case(transfer, degree, d))
