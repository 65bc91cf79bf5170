"""Losses of single stages of a step, and their adjoints, for Taylor tests."""

import numpy as np
from clouds import AFFINE, DX, cloud, deep, scattered

from mpm_ref.core.adjoint.records import packed_bars, packed_velocities, unpack, zero_records
from mpm_ref.core.adjoint.transfer import Exchange, g2p_adjoint, p2g_adjoint
from mpm_ref.core.order import slabs_of
from mpm_ref.core.state import Particles
from mpm_ref.core.transfer import g2p

DT, FLIP = 0.03, 0.9
H = 1e-2 * 0.5 ** np.arange(5)      # of Taylor tests; a displacement is at most H cells or so


def rate(f, slope, h=H):
    """Observed order of |f(h) - f(0) - h slope|."""
    remainder = [abs(f(k) - f(0.0) - k * slope) for k in h]
    return np.polyfit(np.log(h), np.log(remainder), 1)[0]


def pairing(a, b):
    """Sum over all fields of the sums of products."""
    return float(sum((x * y).sum() for x, y in zip(a, b)))


def inside_cells(case, rng, n=40):
    """Random particles, none within a tenth of a cell of where its stencil changes, or a twentieth
    of where its slopes have kinks; a full tau is not symmetric, as that of a neural law need not be
    (NCLAW-X5).
    """
    q = cloud(case, rng, n)
    q.tau[:] += rng.normal(size=q.tau.shape)
    cell = rng.integers(-3, 3, q.x.shape) + 0.5 * (case.degree - 1)
    place = rng.uniform(0.1, 0.9, q.x.shape)
    for kink in case.kinks:
        place += 0.1 * (abs(place - kink) < 0.05)
    q.x[:] = DX * (cell + place)
    return q


def zeros(q):
    """Bars of particles, all zero."""
    return Particles(*(np.zeros_like(a) for a in q))


def direction(q, rng, fields):
    """A random direction in some of the fields of particles."""
    dq = zeros(q)
    for name in fields:
        a = getattr(dq, name)
        a[:] = rng.normal(size=a.shape) * (DX / 3 if name == "x" else 1.0)
    return dq


def shifted(q, dq, h):
    """q + h dq; under MLS L stays the same array as C."""
    new = Particles(*(a + h * b for a, b in zip(q, dq)))
    return new._replace(L=new.C) if q.L is q.C else new


def like_grid(grid, rng):
    """Random numbers in the shape of a grid's fields."""
    m, v, f, v_old = (rng.normal(size=a.shape) for a in (grid.m, grid.v, grid.f, grid.v_old))
    return grid._replace(m=m, v=v, f=f, v_old=v_old)


def fields_of(grid):
    """What is carried of mass, momentum and force."""
    return grid.m, grid.v, grid.f


def how_of(case):
    """The exchange of a case."""
    return Exchange(case.stencil, DT, FLIP, case.transfer == "mls")


def p2g_loss(case, q, nodes):
    """<nodes, p2g(q)>."""
    return pairing(fields_of(nodes), fields_of(scattered(case, q, DT)))


def p2g_bars(case, q, nodes):
    """Its gradient with respect to particles."""
    bars = zeros(q)
    p2g_adjoint(q, packed_bars(nodes), bars, how_of(case))
    return bars


def g2p_loss(case, q, grid, seeds):
    """<seeds, g2p(q, grid)> of x, v, C, L; under MLS L is C and counts once."""
    after = deep(q)
    g2p(after, grid, case.stencil, DT, FLIP, case.transfer == "mls")
    names = "xvC" if case.transfer == "mls" and not case.relaxed else "xvCL"
    return pairing((getattr(seeds, n) for n in names), (getattr(after, n) for n in names))


def g2p_bars(case, q, grid, seeds):
    """Its gradient with respect to particles and to nodes."""
    bars = Particles(*(a.copy() for a in seeds))
    nodes = grid._replace(v=np.zeros_like(grid.v), v_old=np.zeros_like(grid.v_old))
    of_moved, slabs = zero_records(grid), slabs_of(q.x, grid, case.stencil)
    g2p_adjoint(q, packed_velocities(grid), bars, of_moved, how_of(case), slabs)
    unpack(of_moved, nodes)
    return bars, nodes


def inputs_of(case):
    """Fields of particles that p2g reads."""
    names = ["x", "v", "tau", "m", "V0"]
    return names + ["C"] * (case.transfer in AFFINE) + ["b"] * case.body_force
