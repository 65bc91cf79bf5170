"""The unrolled transfer against the general kernels, for every kind of particle it may meet."""

import numpy as np
import pytest
from clouds import DX, Case, cloud, deep

from mpm_ref.core import transfer
from mpm_ref.core.grid import Storage
from mpm_ref.core.order import slabs_of
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.state import NONE
from mpm_ref.core.transfer_mls3 import gather_mls3, scatter_mls3

DT = 0.03
ROUND_OFF = 5e-15       # relative to the largest entry; sums of a few hundred terms
STENCIL = STENCILS[2]
PARTICLES = {
    "solid": Case("mls", 2, 3),
    "fluid with body force, without affine field": Case("mls", 2, 3, body_force=True, fluid=True),
}


@pytest.fixture(params=PARTICLES, scope="module")
def particles(request):
    q = cloud(PARTICLES[request.param], np.random.default_rng(1))
    return q if "without" not in request.param else q._replace(C=NONE)


def close(a, b):
    return abs(a - b).max() <= ROUND_OFF * abs(b).max()


def scattered(kernel, q):
    grid = Storage(DX, STENCIL, 3).cover([q.x])
    kernel(q, grid, STENCIL, DT, np.arange(len(q.x)))
    return grid


def gathered(kernel, q, grid, *share):
    after = deep(q)
    kernel(after, grid, STENCIL, DT, *share, (10, len(q.x) - 10))
    return after


def test_scatter_equals_the_general_one(particles):
    fast, general = (scattered(k, particles) for k in (scatter_mls3, transfer.scatter_mls))
    assert close(fast.m, general.m)
    assert close(fast.v, general.v)


def test_gather_equals_the_general_one(particles):
    grid = Storage(DX, STENCIL, 3).cover([particles.x])
    grid.v[:] = np.random.default_rng(2).normal(size=grid.v.shape)
    fast = gathered(gather_mls3, particles, grid)
    general = gathered(transfer.gather_mls, particles, grid, 0.0)
    assert close(fast.x, general.x)
    assert close(fast.v, general.v)
    assert fast.C.shape == particles.C.shape
    if len(fast.C):
        assert close(fast.C, general.C)
        assert np.all(fast.C[:10] == particles.C[:10])


@pytest.mark.parametrize(("degree", "d", "mls", "old", "fast"), [
    (2, 3, True, False, True), (3, 3, True, False, False), (2, 2, True, False, False),
    (2, 3, False, False, False), (2, 3, True, True, False),
])
def test_it_runs_where_it_applies_and_nowhere_else(degree, d, mls, old, fast, monkeypatch):
    """old: the grid carries its old velocity, for relaxation."""
    ran = []
    for name in ("scatter_mls3_color", "_scatter_mls_color", "_scatter_color",
                 "gather_mls3_all", "_gather_mls", "_gather"):
        monkeypatch.setattr(transfer, name, lambda *arguments, name=name: ran.append(name))
    q = cloud(Case("mls", degree, d), np.random.default_rng(1), n=4)
    grid = Storage(DX, STENCILS[degree], d, flip=old).cover([q.x])
    slabs = slabs_of(q.x, grid, STENCILS[degree])
    transfer.p2g(q, grid, STENCILS[degree], DT, slabs, mls)
    transfer.g2p(q, grid, STENCILS[degree], DT, 0.0, mls)
    assert ["mls3" in name for name in ran] == [fast] * 3
