"""The fast adjoints of the transfers against the plain ones, for every transfer and spline."""

import numpy as np
import pytest
from adjoints import DT, direction, g2p_bars, how_of, like_grid
from clouds import DX, EVERY, SHARE, Case, cloud, deep, scattered
from problems import run_python

from mpm_ref.core.adjoint.records import packed_bars, packed_velocities
from mpm_ref.core.adjoint.shape_gradient import GradientForm, MlsForm
from mpm_ref.core.adjoint.transfer import (
    gather_bars,
    p2g_adjoint,
    relaxation_bars,
    scatter_bars,
    velocity_gradients,
)
from mpm_ref.core.adjoint.transfer_lines import Advection
from mpm_ref.core.state import NONE, Particles
from mpm_ref.core.stencil import inverse_inertia
from mpm_ref.core.transfer import g2p

ROUND_OFF = 1e-14       # relative to the largest entry
SEEDS = ("x", "v", "C", "L")

# What is compiled costs seconds; every transfer and degree runs without compilation.
CASES = (Case("mls", 2, 3), Case("flip", 2, 3), Case("apic", 2, 2, relaxed=True))

EVERYTHING = """
import json
from clouds import EVERY
from tests.adjoint.test_transfer_lines import apart, same_gradients
print(json.dumps({case.name: (apart(case, n=5), same_gradients(case)) for case in EVERY}))
"""


@pytest.fixture(params=CASES, ids=lambda case: case.name)
def case(request):
    return request.param


def largest(found, expected):
    """The largest difference of two records, relative to the largest entry of each field."""
    pairs = [(a, b) for a, b in zip(found, expected, strict=True) if np.size(a) and np.any(b)]
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)


def copy(q):
    return Particles(*(a.copy() for a in q))


def plain_p2g(case, q, nodes, before):
    """Bars of particles by `gather_bars`, from those before."""
    bars = copy(before)
    form = GradientForm(DT)
    if case.transfer == "mls":
        form = MlsForm(DT, inverse_inertia(DX, case.stencil))
    gather_bars(q, nodes, bars, case.stencil, form, (0, len(q.x)))
    return bars


def fast_p2g(case, q, nodes, before):
    """The same by `p2g_adjoint`."""
    bars = copy(before)
    p2g_adjoint(q, packed_bars(nodes), bars, how_of(case))
    return bars


def plain_g2p(case, q, grid, seeds):
    """Bars of x and v of particles, and of nodes, by `scatter_bars`."""
    bars, how = copy(seeds), how_of(case)
    nodes = grid._replace(v=np.zeros_like(grid.v), v_old=np.zeros_like(grid.v_old))
    if case.relaxed:
        motion = relaxation_bars(q, packed_velocities(grid), bars, how)
    else:
        motion = Advection(q.x, bars.v + how.dt * bars.x, NONE)
        bars.v[:] *= how.flip if case.separate else 0.0
    of_grid = bars
    if case.transfer == "mls":
        of_grid = bars._replace(C=bars.C + bars.L if case.relaxed else bars.C, L=NONE)
    scatter_bars(motion, grid, of_grid, nodes, case.stencil, np.arange(len(q.x)))
    return (bars.x, bars.v), (nodes.v, nodes.v_old)


def apart(case, n=60):
    """The largest differences of the adjoints of p2g, and of g2p for particles and nodes."""
    rng = np.random.default_rng(9)
    q = cloud(case, rng, n)
    q.tau[:] += rng.normal(size=q.tau.shape)                # not symmetric, where it is full
    q.x[0] = DX * np.rint(q.x[0] / DX)
    nodes = like_grid(scattered(case, q, DT), rng)
    seeds, before = direction(q, rng, SEEDS), direction(q, rng, Particles._fields)
    bars, of_nodes = g2p_bars(case, q, nodes, seeds)
    of_q, plain_nodes = plain_g2p(case, q, nodes, seeds)
    return (largest(fast_p2g(case, q, nodes, before), plain_p2g(case, q, nodes, before)),
            largest((bars.x, bars.v), of_q),
            largest((of_nodes.v, of_nodes.v_old), plain_nodes))


def gradients(case, n=60):
    """L of a step as the adjoint computes it, and that of the step."""
    rng = np.random.default_rng(10)
    q = cloud(case, rng, n)
    grid, L = like_grid(scattered(case, q, DT), rng), np.full((n, case.d, case.d), np.nan)
    velocity_gradients(q.x, packed_velocities(grid), L, how_of(case))
    after = deep(q)
    g2p(after, grid, case.stencil, DT, SHARE, case.transfer == "mls")
    return L, after.L


def same_gradients(case, n=5):
    return bool(np.array_equal(*gradients(case, n)))


def test_as_the_plain_sums(case):
    assert max(apart(case)) < ROUND_OFF


def test_velocity_gradients_are_those_of_the_step_to_the_bit(case):
    assert same_gradients(case, 200)


def test_as_the_plain_sums_in_every_case():
    """All transfers, degrees and dimensions, as plain Python."""
    found = run_python(EVERYTHING, NUMBA_DISABLE_JIT="1")
    assert len(found) == len(EVERY)
    assert max(max(parts) for parts, _ in found.values()) < ROUND_OFF
    assert all(same for _, same in found.values())
