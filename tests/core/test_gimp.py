"""The weights of GIMP: averages of linear splines, which are smooth where a particle crosses a
node.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.core.adjoint.shape_gradient import curvatures
from mpm_ref.core.gimp import gimp_stencil
from mpm_ref.core.spline import STENCILS, base_of, slopes, weights
from mpm_ref.plain.gimp import averaged, averaged_slope
from mpm_ref.plain.spline import pairs

NUMBERS = (1.0, 1.5, 2.0, 3.0, 8.0)         # particles per cell and axis
PLACES = st.floats(-50.0, 50.0)
PER_CELL = st.floats(1.0, 20.0)


def around(x, stencil):
    """The nodes that a particle at x [cells] reaches, with weights and slopes."""
    base = base_of(x, 1.0, stencil)
    nodes = base + np.arange(len(stencil))
    return nodes, np.array(weights(x - base, stencil)), np.array(slopes(x - base, stencil))


@pytest.mark.parametrize("per_cell", NUMBERS)
def test_equal_the_plain_twin(per_cell, rng):
    """To 1e-14, since the twin subtracts integrals of up to 1 and divides by the length."""
    for x in rng.uniform(-7.0, 7.0, 50):
        nodes, w, dw = around(x, gimp_stencil(per_cell))
        assert abs(w - averaged(x - nodes, per_cell)).max() <= 1e-14
        assert abs(dw - averaged_slope(x - nodes, per_cell)).max() <= 1e-14 * per_cell


@pytest.mark.parametrize("per_cell", NUMBERS)
def test_are_means_of_linear_splines_over_the_particle(per_cell, rng):
    """Midpoints on 4000 parts, of which only those with a kink err, by 1/4000 of their share."""
    parts = (np.arange(4000) + 0.5) / 4000 - 0.5
    for x in rng.uniform(-3.0, 3.0, 5):
        nodes, w, _ = around(x, gimp_stencil(per_cell))
        points = [around(y, STENCILS[1]) for y in x + parts / per_cell]
        means = [sum(v @ (near == node) for near, v, _ in points) / 4000 for node in nodes]
        assert w == pytest.approx(means, abs=1e-7)


@given(x=PLACES, per_cell=PER_CELL)
def test_weights_are_shares_that_reproduce_lines(x, per_cell):
    nodes, w, dw = around(x, gimp_stencil(per_cell))
    assert w.min() >= 0.0
    assert w.sum() == pytest.approx(1.0, abs=1e-15)
    assert w @ (nodes - x) == pytest.approx(0.0, abs=2e-14)
    assert dw.sum() == pytest.approx(0.0, abs=1e-15)
    assert dw @ (nodes - x) == pytest.approx(1.0, abs=2e-13)


@given(x=PLACES)
def test_particles_that_fill_a_cell_have_quadratic_splines(x):
    ours, theirs = (around(x, stencil) for stencil in (gimp_stencil(1.0), STENCILS[2]))
    assert np.array_equal(ours[0], theirs[0])
    for a, b in zip(ours[1:], theirs[1:], strict=True):
        assert abs(a - b).max() <= 5e-16
    base = ours[0][0]
    assert curvatures(x - base, gimp_stencil(1.0)) == curvatures(x - base, STENCILS[2])


@given(f=st.floats(0.5, 1.5), per_cell=st.sampled_from(NUMBERS))
def test_slopes_and_curvatures_are_derivatives(f, per_cell):
    """Weights are pieces of degree 2: away from kinks differences are exact but for round-off."""
    stencil, h = gimp_stencil(per_cell), 1e-3
    if min(abs(f - kink) for kink in (stencil.low, stencil.high)) <= h:
        return
    for value, derivative in ((weights, slopes), (slopes, curvatures)):
        rise = np.subtract(value(f + h, stencil), value(f - h, stencil)) / (2.0 * h)
        assert rise == pytest.approx(np.array(derivative(f, stencil)), abs=1e-11)


def test_curvatures_at_a_kink_are_those_from_above():
    stencil = gimp_stencil(2.0)
    assert curvatures(stencil.low, stencil) == (2.0, -4.0, 2.0)
    assert not any(curvatures(stencil.high, stencil))


@pytest.mark.parametrize("per_cell", NUMBERS)
def test_weights_and_slopes_are_continuous_where_linear_slopes_jump(per_cell):
    """At nodes, half-way between them, and where a particle's end passes a node."""
    half, step = 0.5 / per_cell, 1e-9

    def values(x, stencil, k):
        nodes, *found = around(x, stencil)
        return np.array([v @ (nodes == k) for v in found])

    for x in (0.0, 0.5, -0.5, half, -half, 1.0 - half, 1.0 + half):
        jumps = [values(x + step, gimp_stencil(per_cell), k)
                 - values(x - step, gimp_stencil(per_cell), k) for k in (-1, 0, 1)]
        assert np.abs(jumps).max() <= 2.1 * step * 2.0 * per_cell       # 2 h times the curvature
    linear = values(step, STENCILS[1], 0) - values(-step, STENCILS[1], 0)
    assert linear[1] == -2.0


def force_on_node(row, stencil):
    """Of unit stress in particles at the places of a row [cells]."""
    found = [around(y, stencil) for y in row]
    return abs(sum(dw @ (nodes == 0) for nodes, _, dw in found))


@given(x=st.floats(0.0, 1.0), per_cell=st.floats(1.0, 6.0))
def test_equal_stress_has_no_force_where_particles_fill_space(x, per_cell):
    """Slopes of touching particles telescope, wherever they lie and however many fill a cell."""
    row = x + np.arange(-30, 31) / per_cell
    assert force_on_node(row, gimp_stencil(per_cell)) <= 1e-12 * per_cell


def test_linear_splines_have_a_force_there():
    assert force_on_node(0.1 + np.arange(-30, 31) / 1.8, STENCILS[1]) == 1.0


def test_the_second_moment_depends_on_the_place():
    """Hence there is no D for an affine field; l = 1/4."""
    def moment(x):
        nodes, w, _ = around(x, gimp_stencil(2.0))
        return w @ (nodes - x) ** 2
    assert moment(0.0) == pytest.approx(0.125)
    assert moment(0.5) == pytest.approx(0.25)


@pytest.mark.parametrize("real", [np.float32, np.float64, np.longdouble])
def test_plain_pairs_keep_their_type(d, real, rng):
    ip = pairs(rng.uniform(-1.0, 1.0, (20, d)).astype(real), real(0.1), 2, 2.0)
    assert {ip.w.dtype, ip.dw.dtype, ip.r.dtype} == {np.dtype(real)}
    tol = 100 * np.finfo(real).eps
    assert abs(ip.w.sum(axis=1) - 1).max() < tol
    assert abs(np.einsum("psa,psb->pab", ip.dw, ip.r) - np.eye(d)).max() < 10 * tol
