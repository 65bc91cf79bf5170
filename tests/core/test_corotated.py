"""Deformation in blocks against the loop over single particles, to the last bit."""

import numpy as np
import pytest
from threads import by_threads

from mpm_ref.body import Body, in_precision, particles_at
from mpm_ref.core import corotated, deform
from mpm_ref.core.precision import PRECISIONS, converted
from mpm_ref.explicit import deform_driver
from mpm_ref.materials import FixedCorotated, Hencky, NoFlow

LAW, DT = FixedCorotated(3e3, 4e3), 0.01
LIKE = {np.float64: (0, 1, 2), np.float32: tuple(map(np.float32, range(3)))}


def strained(n, size):
    """n particles with strains, and velocity gradients, of a size."""
    rng, rest = np.random.default_rng(n), np.zeros((n, 3))
    q = particles_at(rest, rest, np.ones(n), np.ones(n))
    q.F[:] += size * rng.normal(size=q.F.shape)
    q.L[:] = size * rng.normal(size=q.L.shape)
    return q


def both(q):
    """F and tau of particles after a step, by blocks and by single particles."""
    results, real = [], q.F.dtype.type
    for run in (corotated.elastic, deform.elastic):
        own = q._replace(F=q.F.copy(), tau=q.tau.copy())
        run(own, converted(LAW, real), converted(DT, real), LIKE[real])
        results.append(np.concatenate([own.F, own.tau]))
    return results


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("size", [0.0, 1e-7, 1e-3, 0.1, 1.0, 30.0])
@pytest.mark.parametrize("n", [1, 63, 65, 5000])
def test_blocks_give_the_bits_of_single_particles(n, size, precision):
    """Full blocks and parts of one; strains at which the iteration ends soon, late and not at all,
    with every other body inverted.
    """
    blocks, single = both(in_precision(strained(n, size), PRECISIONS[precision]))
    assert np.isfinite(single).all()
    assert np.array_equal(blocks, single)


def test_degenerate_and_broken_gradients_stay_alone():
    """Singular, inverted, huge, tiny, infinite or NaN, each in a block of healthy ones."""
    q = strained(640, 0.1)
    q.L[:] = 0.0
    q.F[5] = 0.0
    q.F[70] = np.diag([1.0, 1.0, 0.0])
    q.F[140] = np.diag([1.0, 1.0, -1.0])
    q.F[210] *= 1e200
    q.F[280] *= 1e-200
    q.F[350, 0, 0] = np.nan
    q.F[420, 1, 2] = np.inf
    blocks, single = both(q)
    assert np.array_equal(blocks, single, equal_nan=True)
    assert np.isfinite(single).all(axis=(1, 2)).sum() >= 2 * 640 - 8


def test_one_and_two_threads_give_the_same_bits():
    first, second = by_threads(lambda: both(strained(3000, 0.1))[0])
    assert np.array_equal(first, second)


def test_blocks_are_for_laws_of_the_stretch_in_3d():
    q = strained(3, 0.1)
    body = Body("body", q, LAW, NoFlow(), np.arange(3))
    assert deform_driver(body) is corotated.elastic
    assert deform_driver(body._replace(law=Hencky(3e3, 4e3))) is deform.elastic
    assert not corotated.fits(LAW, 2)
