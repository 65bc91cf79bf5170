"""Taylor tests of 100 steps of the four materials that NCLaw trains on, in 2D and 3D: from rest,
where all singular values of F are equal, from deformed states, where some are, and without strain.
"""

import numpy as np
import pytest
from adjoint_runs import NCLAW, line_of, loss, moved, order, seeds_of, strains, taped, thrown
from problems import FREE

from mpm_ref.explicit import Scheme

pytestmark = pytest.mark.slow

STEPS = 100
FINE = 6e-5 * 0.5 ** np.arange(4)   # no particle passes a kink of its law; finer is round-off in 3D
COARSE = 4e-4 * 0.5 ** np.arange(4)     # of states without strain, far from any kink
SECOND = pytest.approx(2.0, abs=0.1)    # the order of a remainder
MATERIALS = pytest.mark.parametrize("name", NCLAW)


@MATERIALS
@pytest.mark.parametrize("deformed", [False, True], ids=["rest", "deformed"])
def test_rollout(name, d, deformed):
    """In the whole state at the start, all constants and gravity."""
    assert order(thrown(name, d, deformed), (37, STEPS), FINE) == SECOND


@pytest.mark.parametrize("name", ["jelly", "plasticine", "water"])
def test_flight_without_strain(name, d):
    """F = I in every step. Sand is on the tip of its cone there, and has no derivative."""
    run = thrown(name, d, False)._replace(conditions=FREE, scheme=Scheme())
    run.bodies[0].particles.v[:] = run.bodies[0].particles.v[0]
    assert order(run, (37, STEPS), COARSE) == SECOND
    loss(run, {STEPS: ()})
    assert abs(run.bodies[0].particles.F - np.eye(d)).max() < 1e-12


@MATERIALS
def test_rollouts_reach_what_they_test(name, d):
    """The gradient by every constant is there, but for limits that no particle reaches; the wall is
    met.
    """
    seeds = seeds_of(thrown(name, d, False), (STEPS,), np.random.default_rng(0))
    run, free = (moved(run, line_of(run, np.random.default_rng(0)), 0.0) for run in (
        thrown(name, d, False), thrown(name, d, False)._replace(conditions=FREE)))
    bars, = taped(run, seeds).bodies
    loss(free, seeds)
    assert abs(run.bodies[0].particles.x - free.bodies[0].particles.x).max() > 0.01
    for a in (*bars[:4], bars.m, bars.V0, np.array(bars.law), np.array(bars.flow[:1])):
        assert np.isfinite(a).all()
        assert (a != 0.0).any() or not len(a)


def test_singular_values_repeat(d):
    """At rest all, and in every second deformed state two."""
    assert (thrown("jelly", d, False).bodies[0].particles.F == np.eye(d)).all()
    gaps = abs(np.diff(np.linalg.svd(strains(20, d), compute_uv=False))).min(axis=1)
    assert gaps[::2].max() < 1e-14
    assert gaps[1::2].min() > 1e-4
