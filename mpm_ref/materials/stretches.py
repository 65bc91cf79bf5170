"""Functions of the principal stretches (singular values) s: J, its derivatives, 1/s."""

from math import nan

from ..core.jit import kernel
from ..core.tensor import fill


@kernel
def volume(s):
    """Return J, the product of the singular values."""
    J = s[0]
    for i in range(1, len(s)):
        J *= s[i]
    return J


@kernel
def others(s):
    """Return dJ/ds_i: the product of all singular values but the i-th."""
    if len(s) == 2:
        return s[1], s[0]
    else:
        return s[1] * s[2], s[2] * s[0], s[0] * s[1]


@kernel
def d_others(s):
    """Return d2J/ds_i ds_j: off the diagonal the product of the remaining singular values."""
    if len(s) == 2:
        return (0.0, 1.0), (1.0, 0.0)
    else:
        return (0.0, s[2], s[1]), (s[2], 0.0, s[0]), (s[1], s[0], 0.0)


@kernel
def positive_stretches(s):
    """Return s, or NaN where one of them is not > 0: some laws are not defined there."""
    for i in range(len(s)):
        if not s[i] > 0.0:
            return fill(nan, s)
    return s


@kernel
def expanded(J):
    """Return J; NaN unless J > 0."""
    return J if J > 0.0 else nan


@kernel
def inverse(s):
    """Return 1/s_i; all NaN where one s_i is not > 0."""
    return _inverse(positive_stretches(s))


@kernel
def _inverse(s):
    if len(s) == 2:
        return 1.0 / s[0], 1.0 / s[1]
    else:
        return 1.0 / s[0], 1.0 / s[1], 1.0 / s[2]
