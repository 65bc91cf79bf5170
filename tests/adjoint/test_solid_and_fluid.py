"""Gradients through a hundred steps in 3D: a plastic body and a fluid on one grid."""

import numpy as np
import pytest
from adjoint_runs import order, seeds_of, splash, taped
from adjoints import H

STEPS = 100


def test_rollout():
    """In the whole state and all parameters; walls as in NCLAW-sim."""
    assert order(splash(), (37, STEPS), 4e-3 * H) == pytest.approx(2.0, abs=0.1)


def test_rollout_reaches_what_it_tests():
    """The metal yields, the fluid is compressed, both touch walls and each other."""
    run = splash()
    seeds = seeds_of(run, (STEPS,), np.random.default_rng(0))
    g = taped(run, seeds)
    metal, fluid = g.bodies
    assert metal.flow.tau_y != 0.0
    assert fluid.law.lam != 0.0
    assert np.ptp(run.bodies[1].particles.F) > 1e-3
    only = taped(splash(), {STEPS: [seeds[STEPS][0], None]})
    assert abs(only.bodies[1].v).max() > 1e-3 * abs(metal.v).max()     # they have met
    free = taped(splash()._replace(conditions=None), seeds)
    assert abs(free.gravity - g.gravity).max() > 1e-3 * abs(g.gravity).max()
