"""Matrices that are not finite, or whose squares leave the range of floats: tests and scaling."""

from math import frexp, isfinite, ldexp, nan

from .jit import kernel
from .tensor import identity, lin, mlin

SMALLEST, LARGEST = 1e-30, 1e30     # of max |A_ij|, between which fourth powers lose no digits


@kernel
def not_a_number(like):
    """A matrix of NaN."""
    return mlin(nan, identity(like), nan, identity(like))


@kernel
def is_finite(A):
    """Return whether all entries are finite."""
    if len(A) == 2:
        (a, b), (c, d) = A
        return isfinite(a) and isfinite(b) and isfinite(c) and isfinite(d)
    else:
        return _finite_vector(A[0]) and _finite_vector(A[1]) and _finite_vector(A[2])


@kernel
def _finite_vector(x):
    return isfinite(x[0]) and isfinite(x[1]) and isfinite(x[2])


@kernel
def largest_entry(A):
    """Return max |A_ij|."""
    if len(A) == 2:
        return max(abs(A[0][0]), abs(A[0][1]), abs(A[1][0]), abs(A[1][1]))
    else:
        return max(_largest(A[0]), _largest(A[1]), _largest(A[2]))


@kernel
def _largest(x):
    return max(abs(x[0]), abs(x[1]), abs(x[2]))


@kernel
def is_moderate(A):
    """Return whether the largest entry is of a size that needs no scaling."""
    return SMALLEST < largest_entry(A) < LARGEST


@kernel
def moderate(A):
    """2^-e A and e: e = 0 where A needs no scaling, otherwise the largest entry becomes about 1."""
    a = largest_entry(A)
    if SMALLEST < a < LARGEST or a == 0.0:
        return A, 0
    e = frexp(a)[1]
    return _shifted(A, -e), e


@kernel
def _shifted(A, e):
    """2^e A."""
    if len(A) == 2:
        (a, b), (c, d) = A
        return (ldexp(a, e), ldexp(b, e)), (ldexp(c, e), ldexp(d, e))
    else:
        return _shifted_vector(A[0], e), _shifted_vector(A[1], e), _shifted_vector(A[2], e)


@kernel
def _shifted_vector(x, e):
    return ldexp(x[0], e), ldexp(x[1], e), ldexp(x[2], e)


@kernel
def rescaled(s, e):
    """2^e s, in two steps: 2^e may be out of range where 2^e s is not. Infinite where both are."""
    if e == 0:
        return s
    t = lin(ldexp(1.0, e // 2), s, 0.0, s)
    return lin(ldexp(1.0, e - e // 2), t, 0.0, t)
