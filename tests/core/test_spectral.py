import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mpm_ref.core import spectral

ROOT = Path(__file__).resolve().parents[2]

EXACT = 1e-14       # of the largest entry: some fifty units of round-off; seen: 1.2e-15
ULP = 5e-324        # the smallest float: no result below 1e-308 is more accurate than that


def rows(A):
    """A matrix as kernels know it."""
    return tuple(tuple(float(a) for a in row) for row in A)


def turn(d, rng):
    """A random proper rotation."""
    Q, _ = np.linalg.qr(rng.standard_normal((d, d)))
    Q[:, 0] *= np.sign(np.linalg.det(Q))
    return Q


def built(s, rng):
    """A matrix of the singular values s, turned at random on both sides."""
    return turn(len(s), rng) @ np.diag(s) @ turn(len(s), rng).T


SPECTRA = {
    "identity": (1, 1, 1), "twice the same": (2, 2, 1), "the lower two": (2, 1, 1),
    "1e-8 apart": (1 + 2e-8, 1 + 1e-8, 1), "1e-15 apart": (1 + 2e-15, 1 + 1e-15, 1),
    "inverted": (2, 1, -0.5), "reflected": (1, 1, -1), "rank 2": (2, 1, 0), "rank 1": (3, 0, 0),
    "rank 0": (0, 0, 0), "almost rank 1": (1, 1e-12, 1e-13), "almost rank 2": (1, 1, -1e-14),
    "graded": (1, 1e-8, 1e-16), "1e150": (2e150, 1e150, -1e150), "1e-150": (3e-150, 1e-150, 1e-150),
    "1e300 to 1e-300": (1e300, 1, 1e-300), "subnormal": (1e-310, 3e-311, -1e-311),
    "a few ulp": (3 * ULP, ULP, 0), "huge": (1e308, 1e308, 9e307),
}


def zoo(d):
    """Special matrices: each spectrum along the axes, permuted, and turned."""
    rng = np.random.default_rng(1)
    for s in SPECTRA.values():
        s = np.array((s[0], *s[4 - d:]), dtype=float)
        yield np.diag(s)
        yield np.roll(np.diag(s), 1, axis=0)
        yield built(s, rng)
    for k in range(-300, 301, 10):
        yield 10.0 ** k * built((1 + 2e-6, 1 + 1e-6, 1)[:d], rng)
    yield np.ones((d, d))
    yield np.full((d, d), -0.0)
    yield 1.01 * np.eye(d)
    yield np.triu(np.ones((d, d)))


def pile(d, n=300):
    """Random matrices: general, close to or multiples of a rotation, of small integers."""
    rng = np.random.default_rng(2)
    for k in range(n):
        N = rng.standard_normal((d, d))
        yield N
        yield np.eye(d) + 10.0 ** -(k % 17) * N
        yield turn(d, rng) + 10.0 ** -(k % 17) * N
        yield 2.7 * turn(d, rng)
        yield rng.integers(-1, 2, (d, d)).astype(float)


def matrices(d):
    yield from zoo(d)
    yield from pile(d)


def unscaled(F, *more):
    """F and more, divided by the power of two next to max |F|; and the tolerance there."""
    e = np.frexp(np.abs(F).max())[1]
    return *(np.ldexp(A, -e) for A in (F, *more)), EXACT + np.ldexp(3 * ULP, -e)


def assert_rotation(Q):
    assert np.abs(Q.T @ Q - np.eye(len(Q))).max() <= EXACT
    assert np.linalg.det(Q) > 0


def assert_svd(F):
    U, s, V, ok = spectral.svd(rows(F))
    U, s, V = np.array(U), np.array(s), np.array(V)
    assert ok
    assert_rotation(U)
    assert_rotation(V)
    assert np.all(s[:-1] >= np.abs(s[1:]))
    A, t, tol = unscaled(F, s)
    assert np.abs(U @ np.diag(t) @ V.T - A).max() <= tol


def test_svd_of_special_and_random_matrices(d):
    for F in matrices(d):
        assert_svd(F)


def entries(d, most):
    number = st.floats(-most, most, allow_nan=False)
    return st.lists(st.lists(number, min_size=d, max_size=d), min_size=d, max_size=d)


@given(F=entries(2, 5e307))
@example(F=[[1.2e-226, 0.0], [0.0, 0.0]])
def test_svd_of_any_floats_2d(F):
    assert_svd(np.array(F))


@given(F=entries(3, 5e307))
@example(F=[[0.0, 0.0, 0.0], [0.0, 0.0, -ULP], [0.0, ULP, 0.0]])
def test_svd_of_any_floats_3d(F):
    assert_svd(np.array(F))


def test_singular_values_are_those_of_lapack(d):
    for F in pile(d):
        s = np.array(spectral.svd(rows(F))[1])
        lapack = np.linalg.svd(F, compute_uv=False)
        assert np.abs(np.abs(s) - lapack).max() <= 2 * EXACT * lapack[0]    # both err; seen: 7e-15


@pytest.mark.parametrize("s", [(2.0, 1.0, -0.5), (2.0, 2.0, 1.0), (1.0, 1e-8, -1e-9)])
def test_known_singular_values_with_their_sign(s, rng):
    F = built(s, rng)
    assert np.abs(np.array(spectral.svd(rows(F))[1]) - s).max() <= EXACT * s[0]
    assert np.sign(spectral.svd(rows(-F))[1][2]) == -np.sign(s[2])


def test_last_singular_value_has_the_sign_of_det(d, rng):
    for _ in range(100):
        F = rng.standard_normal((d, d))
        assert np.sign(spectral.svd(rows(F))[1][-1]) == np.sign(np.linalg.det(F))


def test_of_unit_matrix_nothing_is_turned(d):
    U, s, V, _ = spectral.svd(rows(np.eye(d)))
    assert U == V == rows(np.eye(d))
    assert s == (1.0,) * d


def test_polar(d):
    for F in matrices(d):
        R, S = map(np.array, spectral.polar(rows(F)))
        assert_rotation(R)
        A, S, tol = unscaled(F, S)
        assert np.abs(R @ S - A).max() <= tol
        assert np.abs(S - S.T).max() <= tol


def test_polar_of_known_stretch(d, rng):
    s = (3.0, 2.0, 0.5)[:d]
    R, V = turn(d, rng), turn(d, rng)
    S = V @ np.diag(s) @ V.T
    R_got, S_got = spectral.polar(rows(R @ S))
    assert np.abs(R_got - R).max() <= EXACT
    assert np.abs(S_got - S).max() <= EXACT


def test_rotation_is_that_of_polar(d):
    for F in matrices(d):
        R = np.array(spectral.polar(rows(F))[0])
        fast = np.array(spectral.rotation(rows(F)))
        assert_rotation(fast)
        s = spectral.svd(rows(F))[1]
        if s[-2] + s[-1] > 0.1 * s[0]:      # elsewhere R itself moves by round-off of F
            assert np.abs(fast - R).max() <= EXACT


def test_fast_rotation_is_used_where_it_should_be():
    fast = getattr(spectral._fast_rotation, "py_func", spectral._fast_rotation)
    assert fast(rows(np.diag((1.5, 1.0, 0.7))))[1]
    for s in ((1.0, 0.0, 0.0), (1.0, 1.0, -1.0), (1.0, 0.01, 0.01), (0.0, 0.0, 0.0)):
        assert not fast(rows(np.diag(s)))[1]


def test_stretch_is_that_of_the_left_polar_decomposition(d):
    for F in matrices(d):
        R, V = np.array(spectral.polar(rows(F))[0]), np.array(spectral.stretch(rows(F)))
        A, V, tol = unscaled(F, V)
        s = np.array(spectral.svd(rows(A))[1])
        assert np.abs(V - V.T).max() <= tol
        assert np.abs(V @ R - A).max() <= tol
        assert np.abs(np.sort(np.linalg.eigvalsh(V))[::-1] - s).max() <= 2 * tol


def symmetric(d):
    for F in matrices(d):
        A = 0.5 * F + 0.5 * F.T
        yield A
        yield 1e-150 * A if np.abs(A).max() > 1e-150 else 1e150 * A
        yield F @ F.T if np.abs(F).max() < 1e100 else A
    rng = np.random.default_rng(3)
    for w in ((1, 1, 2), (1, 2, 2), (-1, 0, 1), (-2, -1, -1), (1, 1, 1), (0, 0, 0), (0, 0, 1)):
        Q = turn(d, rng)
        yield Q @ np.diag(np.array(w[:d], dtype=float)) @ Q.T
        yield np.diag(np.array(w[:d], dtype=float))


def test_eigh(d):
    for A in symmetric(d):
        A = np.triu(A) + np.triu(A, 1).T
        w, Q = map(np.array, spectral.eigh(rows(A)))
        assert_rotation(Q)
        assert np.all(w[:-1] <= w[1:])
        B, t, tol = unscaled(A, w)
        assert np.abs(Q @ np.diag(t) @ Q.T - B).max() <= tol
        assert np.abs(t - np.linalg.eigvalsh(B)).max() <= 2 * tol


def test_eigh_reads_the_upper_triangle(d):
    A = np.triu(np.arange(1.0, 1 + d * d).reshape(d, d))
    assert spectral.eigh(rows(A)) == spectral.eigh(rows(A + np.triu(A, 1).T))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_said(bad, d):
    for i in range(d * d):
        F = np.eye(d)
        F.flat[i] = bad
        U, s, V, ok = spectral.svd(rows(F))
        R, S = spectral.polar(rows(F))
        w, Q = spectral.eigh(rows(F))
        assert not ok
        for result in (U, s, V, R, S, w, Q, spectral.rotation(rows(F)), spectral.stretch(rows(F))):
            assert np.all(np.isnan(result))


STATES = {
    "general": (1.7, 1.1, 0.6), "unit": (1, 1, 1), "1.01": (1.01, 1.01, 1.01),
    "repeated": (2, 2, 1), "nearly repeated": (1 + 1e-9, 1, 1 - 1e-9), "inverted": (2, 1, -0.5),
}


@pytest.mark.parametrize("state", STATES)
def test_d_rotation_is_the_differential(state, d, rng):
    s = np.array(STATES[state], dtype=float)[3 - d:]
    F, dF = built(s, rng), rng.standard_normal((d, d))
    U, s, V, _ = spectral.svd(rows(F))
    R, dR = np.array(spectral.polar(rows(F))[0]), np.array(spectral.d_rotation(U, s, V, rows(dF)))
    rest = [np.abs(spectral.rotation(rows(F + h * dF)) - R - h * dR).max() for h in (1e-3, 1e-4)]
    assert rest[0] < 2e-4           # of the order h^2
    assert rest[1] < 0.02 * rest[0]      # second order would be 0.01


def test_d_singular_is_the_differential(d, rng):
    F, dF = built(np.array((1.7, 1.1, -0.6))[3 - d:], rng), rng.standard_normal((d, d))
    U, s, V, _ = spectral.svd(rows(F))
    s, ds = np.array(s), np.array(spectral.d_singular(U, V, rows(dF)))
    rest = [np.abs(np.subtract(spectral.svd(rows(F + h * dF))[1], s + h * ds)).max()
            for h in (1e-3, 1e-4)]
    assert rest[0] < 2e-4
    assert rest[1] < 0.02 * rest[0]


@pytest.mark.parametrize("state", ["unit", "1.01", "repeated", "nearly repeated"])
def test_symmetric_functions_of_repeated_singular_values(state, d, rng):
    F, dF = built(np.array(STATES[state], dtype=float)[3 - d:], rng), rng.standard_normal((d, d))
    U, s, V, _ = spectral.svd(rows(F))
    ds = np.array(spectral.d_singular(U, V, rows(dF)))
    for f, df in ((np.sum, np.sum(ds)), (np.prod, np.sum(np.prod(s) / s * ds))):
        rest = [abs(f(spectral.svd(rows(F + h * dF))[1]) - f(s) - h * df) for h in (1e-3, 1e-4)]
        assert rest[0] < 2e-4
        assert rest[1] < 0.02 * rest[0] + EXACT


@pytest.mark.parametrize("s", [(1, 1, -1), (1, 0, 0), (0, 0, 0), (2, 1, -1), (1, 1e-17, 0)])
def test_d_rotation_is_finite_where_the_rotation_is_not_unique(s, d, rng):
    F, dF = np.diag(np.array(s, dtype=float)[3 - d:]), rng.standard_normal((d, d))
    U, s, V, _ = spectral.svd(rows(F))
    dR = np.array(spectral.d_rotation(U, s, V, rows(dF)))
    R = np.array(spectral.polar(rows(F))[0])
    assert np.all(np.isfinite(dR))
    assert np.abs(R.T @ dR + dR.T @ R).max() <= EXACT * np.abs(dR).max()


def digits(d):
    """Every result for the special matrices, to the last bit."""
    results = []
    for F in map(rows, zoo(d)):
        U, s, V, _ = spectral.svd(F)
        results += [U, s, V, spectral.rotation(F), spectral.d_rotation(U, s, V, F)]
        results += [spectral.eigh(F), spectral.d_singular(U, V, F), spectral.stretch(F)]
    return repr(results)


def test_plain_python_gives_the_same_bits():
    code = "from tests.core import test_spectral as t; print(t.digits(2)); print(t.digits(3))"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": f"{ROOT / 'tests/support'}:{ROOT}"}
    plain = subprocess.check_output([sys.executable, "-c", code], env=env, text=True)
    assert plain.splitlines() == [digits(2), digits(3)]
