"""Bodies far from each other, stepped on dense and on sparse grids."""

from contextlib import contextmanager
from math import inf

import numpy as np
from problems import DT, DX, JELLY, METAL, ball, digest, moving

from mpm_ref.body import in_precision, particles_at, with_separate_gradient
from mpm_ref.core import sparse_grid
from mpm_ref.core.sparse_grid import SparseStorage, is_sparse
from mpm_ref.core.spline import STENCILS
from mpm_ref.explicit import Scheme
from mpm_ref.materials import Fluid, NoFlow, make_flow
from mpm_ref.problem import Clock, Problem

WIDTH = {2: 200.0, 3: 50.0}     # [cells] of a cloud of clusters, such that dense grids are small
FAST = 4.0          # [m/s] 0.08 cells a step: two such bodies meet after 125 steps and 20 cells


@contextmanager
def rule(least, per_particle, share):
    """Another rule for which grids are sparse."""
    before = sparse_grid.LEAST, sparse_grid.PER_PARTICLE, sparse_grid.SHARE
    sparse_grid.LEAST, sparse_grid.PER_PARTICLE, sparse_grid.SHARE = least, per_particle, share
    try:
        yield
    finally:
        sparse_grid.LEAST, sparse_grid.PER_PARTICLE, sparse_grid.SHARE = before


def sparse():
    """Grids are sparse where that saves a node."""
    return rule(0, 0, 1.0)


def dense():
    """Grids are dense."""
    return rule(inf, inf, 0.0)


def sparse_over(x, degree=2, flip=False, gap=0):
    """A sparse grid over points x (N, d), and the dense one."""
    store = SparseStorage(DX, STENCILS[degree], x.shape[1], flip, gap)
    with sparse():
        first = store.cover([x])
    with dense():
        second = SparseStorage(DX, STENCILS[degree], x.shape[1], flip).cover([x])
    assert is_sparse(first)
    assert not is_sparse(second)
    return first, second


def clusters(rng, d, centers=6, n=40, width=None):
    """Points x (N, d) [m] in clusters of 3 cells, the last of which is far from all others."""
    width = WIDTH[d] if width is None else width
    c = rng.uniform(-0.5, 0.5, (centers, 1, d)) * width
    c[-1] = width
    return DX * (c + rng.uniform(-1.5, 1.5, (centers, n, d))).reshape(-1, d)


def far_bodies(scheme=None, d=2, conditions=None, cells=20.0, speed=FAST):
    """An elastic body, a hardening one and a drop of fluid, of which the first two meet."""
    scheme = scheme or Scheme()
    flow = make_flow("von_mises_hardening", METAL, d, tau_y=50.0, xi=0.2)
    right, up = np.eye(d)[0], np.eye(d)[-1]
    make = dict(transfer=scheme.transfer)
    jelly = ball("jelly", np.zeros(d), JELLY, NoFlow(), **make)
    metal = ball("metal", cells * DX * right + 0.3 * DX * up, METAL, flow, **make)
    metal = metal._replace(particles=metal.particles._replace(y=np.full(len(metal.id), 50.0)))
    drop = ball("drop", cells * DX * (0.5 * right - 1.3 * up), Fluid(1e4), NoFlow(), **make,
                radius=1.4)
    q = drop.particles
    drop = drop._replace(particles=particles_at(q.x, q.v, q.m, q.V0, scheme.transfer, fluid=True))
    bodies = moving(jelly, speed * right, 3.0), moving(metal, -speed * right), moving(drop, 0 * up)
    if scheme.relaxation:
        bodies = tuple(body._replace(particles=with_separate_gradient(body.particles))
                       for body in bodies)
    bodies = tuple(body._replace(particles=in_precision(body.particles, scheme.real))
                   for body in bodies)
    return Problem(bodies, DX, Clock(dt=DT, steps=300), -9.8 * up, scheme, conditions)


def advanced(problem, steps, sort_every=64):
    """The digest of the bodies after some steps, and whether the grid of each was sparse."""
    stepper, kinds = problem.stepper(), []
    stepper.start(problem.bodies)
    for k in range(steps):
        if k % sort_every == 0:
            stepper.sort(problem.bodies)
        kinds.append(is_sparse(stepper.step(problem.bodies, k * DT, DT)))
    return digest(problem.bodies), kinds


