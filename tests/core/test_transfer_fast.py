"""The fast transfers against the plain sums, for every kind of particle that they may meet."""

import numpy as np
import pytest
from clouds import AFFINE, DX, SHARE, Case, cloud, deep

from mpm_ref.core import transfer
from mpm_ref.core.grid import Storage
from mpm_ref.core.order import slabs_of
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.state import NONE
from mpm_ref.core.transfer_lines import (
    gather_lines,
    gather_lines_mls,
    scatter_lines,
    scatter_lines_mls,
)
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


LINES = (
    Case("pic", 1, 3, body_force=True), Case("flip", 1, 2), Case("pic", 2, 2), Case("flip", 2, 3),
    Case("apic", 2, 3, fluid=True), Case("apic", 3, 2), Case("apic", 3, 3, relaxed=True),
    Case("flip", 3, 3, body_force=True), Case("mls", 2, 2, body_force=True), Case("mls", 3, 3),
    Case("mls", 2, 3, relaxed=True, body_force=True), Case("mls", 3, 2, relaxed=True),
    Case("flip", 2, 3, body_force=True, gimp=2.0), Case("pic", 2, 2, gimp=3.0),
)
SUMS = {False: (scatter_lines, transfer.scatter, gather_lines, transfer.gather),
        True: (scatter_lines_mls, transfer.scatter_mls, gather_lines_mls, transfer.gather_mls)}


@pytest.mark.slow
@pytest.mark.parametrize("case", LINES, ids=lambda case: case.name)
def test_lines_equal_the_plain_sums(case):
    q = cloud(case, np.random.default_rng(3))
    scatter, plain_scatter, gather, plain_gather = SUMS[case.transfer == "mls"]
    grids = []
    for kernel in (scatter, plain_scatter):
        grid = Storage(DX, case.stencil, case.d, flip=case.separate).cover([q.x])
        kernel(q, grid, case.stencil, DT, np.arange(len(q.x)))
        grids.append(grid)
    for name in ("m", "v", "f"):
        fast, plain = (getattr(grid, name) for grid in grids)
        assert not plain.size or close(fast, plain)
    moved = [deep(q), deep(q)]
    for kernel, after in zip((gather, plain_gather), moved, strict=True):
        kernel(after, grids[1], case.stencil, DT, SHARE, (10, len(q.x) - 10))
    for name in ("x", "v", "L", *(("C",) if case.transfer in AFFINE else ())):
        assert close(getattr(moved[0], name), getattr(moved[1], name))
        assert np.all(getattr(moved[0], name)[:10] == getattr(q, name)[:10])


@pytest.mark.parametrize(("degree", "d", "mls", "old", "ran"), [
    (2, 3, True, False, "mls3"), (3, 3, True, False, "lines_mls"), (2, 2, True, False, "lines_mls"),
    (2, 3, False, False, "lines"), (2, 3, True, True, "lines_mls"),
])
def test_it_runs_where_it_applies_and_nowhere_else(degree, d, mls, old, ran, monkeypatch):
    """old: the grid carries its old velocity, for relaxation."""
    called = []
    for kind in ("mls3", "lines", "lines_mls"):
        for name in (f"scatter_{kind}_color", f"gather_{kind}_all"):
            monkeypatch.setattr(transfer, name, lambda *arguments, name=name: called.append(name))
    q = cloud(Case("mls", degree, d), np.random.default_rng(1), n=4)
    grid = Storage(DX, STENCILS[degree], d, flip=old).cover([q.x])
    slabs = slabs_of(q.x, grid, STENCILS[degree])
    transfer.p2g(q, grid, STENCILS[degree], DT, slabs, mls)
    transfer.g2p(q, grid, STENCILS[degree], DT, 0.0, mls)
    assert called == [f"scatter_{ran}_color"] * 2 + [f"gather_{ran}_all"]
