"""Scales of round-off: what perturbed plain twins say bounds the errors of other precisions."""

import numpy as np
import pytest
from goldens_adjoint import strained

from mpm_ref.oracle import error_bounds, recording
from mpm_ref.oracle.plain_adjoint import contact_jacobian
from mpm_ref.oracle.plain_twin import Twin
from mpm_ref.plain.boundary import Contact, contact_velocity

REAL = np.longdouble


def contact(kind, mu=0.0):
    """A floor at rest."""
    return Contact(np.array((0, 1, 0), REAL), np.zeros(3, REAL), kind, REAL(mu))


def sampled(f, *inputs):
    """The exact result of f, and the scale of its rows: from samples of perturbed inputs."""
    rng, exact = np.random.default_rng(0), f(*(a.astype(REAL) for a in inputs))
    samples = [f(*(error_bounds.perturb(a, rng, error_bounds.size(a)) for a in inputs))
               for _ in range(error_bounds.SAMPLES)]
    return exact, error_bounds.scale(exact, samples, "particles")


def contracted(a, b, c):
    """A product of sums that cancel."""
    sums = np.einsum("pab,pbc->pac", a, b), np.einsum("pab,pcb->pac", b, c)
    return np.einsum("pab,pbc->pac", *sums) + c


def entrywise(a, b, c):
    """Products of entries, with terms that cancel."""
    tenth = a.dtype.type(1) / 10
    return tenth * (a * b) * c - (a * b + -c) * a[:, ::-1]


@pytest.mark.parametrize("f", [contracted, entrywise])
def test_scales_bound_the_round_off_of_single_precision(f, rng):
    """Inputs are rounded, and every operation is."""
    inputs = rng.normal(size=(3, 50, 4, 4))
    exact, S = sampled(f, *inputs)
    rounded = f(*inputs.astype(np.float32))
    units = abs(rounded - exact) / (S[:, None, None] * np.finfo(np.float32).eps)
    assert 0.005 < units.max() < 1.0


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("dim", [2, 3])
def test_scales_bound_the_round_off_of_a_step(real, dim):
    """Every entry of a plain twin in single or double precision is within the tolerance."""
    problem = strained(dim)
    runs = recording.ReferenceRuns(problem)
    done, other = runs.step(0), Twin(problem, real)
    contacts = {tuple(np.array(i) + runs.last.exact.stages.nodes.box.first): c
                for i, c in runs.last.exact.contacts.items()}
    theirs = other.step(done.dt, done.nodes, contacts, done.bases).arrays
    precision = "f32" if real is np.float32 else "f64"
    for key, a in done.arrays.items():
        unit = recording.expand_like(a.tolerance(precision) * a.scale, a.value)
        assert (abs(theirs[key] - a.value) / unit).max() < 0.25, key
        assert a.error < 1.0, key


def test_the_scale_of_a_gradient_shows_a_kink(rng):
    """A node that is just about to stick has two gradients."""
    rubs = [contact("separate", 0.5)]
    bar = rng.normal(size=3)

    def pulled(v):
        return np.array([contact_jacobian(row, rubs).T @ bar.astype(row.dtype) for row in v])

    far, near = (sampled(pulled, np.array([[t, -1.0, 0.0]]))[1] for t in (0.9, 0.5))
    assert far < 100.0
    assert near > 1e12


def test_what_a_condition_takes_away_leaves_round_off(rng):
    """A node that sticks has exactly no velocity in one code, and an ulp of it in another."""
    v = np.array([[[-0.4, -1.0, 0.7]]])
    after = np.array([[contact_velocity(v[0, 0], [contact("sticky")])]], float)
    sizes = {(0, 0): error_bounds.size(v[0, 0], 0)}
    off = error_bounds.perturb_constrained(after, sizes, rng)
    assert not after.any()
    assert 0.0 < abs(off).max() < 2.0 * error_bounds.EPS


def test_zero_stays_zero():
    """All that enters is 0: so are the scales, and only 0 agrees."""
    zero = np.zeros((4, 2))
    assert not sampled(np.negative, zero)[1].any()
    assert not error_bounds.with_floor(np.zeros(3)).any()


def test_a_wild_entry_lifts_no_other():
    """The floor of an array's scales follows the median, not the largest."""
    S = error_bounds.with_floor(np.array([0.0, 1.0, 2.0, 1e20]))
    assert S.tolist() == [2.0 * error_bounds.FLOOR, 1.0, 2.0, 1e20]
