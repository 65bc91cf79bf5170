from math import nextafter, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.core.spline import STENCILS, base_of, slopes, weights
from mpm_ref.plain.spline import bspline, pairs, slope

DEGREES = (1, 2, 3)
ROUND_OFF = 1e-14


def around(x, dx, degree):
    """Base node, weights and slopes of the kernels at one coordinate."""
    stencil = STENCILS[degree]
    base = base_of(x, dx, stencil)
    f = x / dx - base
    return base, np.array(weights(f, stencil)), np.array(slopes(f, stencil))


@st.composite
def near_faces(draw):
    """A multiple of half a cell, or the number just below or above it, and dx."""
    dx = draw(st.sampled_from([0.1, 0.04, 1 / 3, 1.0, 2.0**-7, pi]))
    x = 0.5 * dx * draw(st.integers(-4000, 4000))
    return nextafter(x, draw(st.sampled_from([-1e9, x, 1e9]))), dx


@pytest.mark.parametrize("degree", DEGREES)
def test_equal_the_recursion(degree, rng):
    """The basis of LDM-sec2.2-spaces; its degree is not printed."""
    for x in rng.uniform(-7.0, 7.0, 50):
        base, w, dw = around(x, 1.0, degree)
        u = x - (base + np.arange(degree + 1)) + (degree + 1) / 2
        assert abs(w - bspline(u, degree)).max() <= 1e-15 * (1 + abs(x))
        assert abs(dw - slope(u, degree)).max() <= 1e-15 * (1 + abs(x))


@pytest.mark.parametrize("degree", DEGREES)
def test_slope_is_the_derivative(degree):
    u = np.linspace(0.013, degree + 0.97, 31, dtype=np.longdouble)
    h = np.longdouble(1e-5)
    difference = (bspline(u + h, degree) - bspline(u - h, degree)) / (2 * h)
    assert abs(slope(u, degree) - difference).max() < 1e-9


@pytest.mark.parametrize("degree", DEGREES)
@given(point=near_faces())
def test_partition_of_unity_at_faces(degree, point):
    _, w, dw = around(*point, degree)
    assert abs(w.sum() - 1.0) <= ROUND_OFF
    assert abs(dw.sum()) <= ROUND_OFF
    assert w.min() >= -ROUND_OFF


@pytest.mark.parametrize("degree", DEGREES)
@given(point=near_faces())
def test_no_jump_between_neighbouring_numbers(degree, point):
    """Whichever base node round-off selects, each node's weight is the same to round-off."""
    x, dx = point
    here, there = {}, {}
    for store, y in ((here, x), (there, nextafter(x, 1e9))):
        base, w, _ = around(y, dx, degree)
        store.update(zip(range(base, base + degree + 1), w))
    jump = max(abs(here.get(i, 0.0) - there.get(i, 0.0)) for i in here | there)
    assert jump <= 1e-15 * (1 + abs(x / dx))


@pytest.mark.parametrize("degree", DEGREES)
@given(x=st.floats(-50, 50))
def test_linear_moment_vanishes(degree, x):
    base, w, dw = around(x, 1.0, degree)
    arm = base + np.arange(degree + 1) - x
    assert abs(w @ arm) <= 2e-14
    assert abs(dw @ arm - 1.0) <= 4e-14


@pytest.mark.parametrize("degree", [2, 3])
@given(x=st.floats(-50, 50))
def test_second_moment_is_constant(degree, x):
    """D of NSF-alg-mpm: sum_i w_ip r_ip^2 = (degree + 1)/12 cells^2."""
    base, w, _ = around(x, 1.0, degree)
    assert abs(w @ (base + np.arange(degree + 1) - x) ** 2 - (degree + 1) / 12) <= 2e-14


def test_second_moment_of_linear_splines_is_not():
    moments = [around(x, 1.0, 1)[1] @ (np.arange(2) - x) ** 2 for x in (0.0, 0.25, 0.5)]
    assert moments == pytest.approx([0.0, 3 / 16, 1 / 4])


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("real", [np.float32, np.float64, np.longdouble])
def test_plain_pairs_keep_their_type(d, degree, real, rng):
    ip = pairs(rng.uniform(-1.0, 1.0, (20, d)).astype(real), real(0.1), degree)
    assert {ip.w.dtype, ip.dw.dtype, ip.r.dtype} == {np.dtype(real)}
    tol = 100 * np.finfo(real).eps
    assert abs(ip.w.sum(axis=1) - 1).max() < tol
    assert abs(np.einsum("psa,psb->pab", ip.dw, ip.r) - np.eye(d)).max() < 10 * tol
