"""Deflation of a 3 x 3 spectral problem to a 2 x 2 one, and the closed forms of the latter.

Of the three eigenvalues of a symmetric matrix, the one farthest from the middle one has a well
conditioned eigenvector, however close the other two are [Scherzinger2008]. With that
vector split off, what remains lies in the plane across it, where singular values and eigenvalues
are sums and differences of two lengths. No sweeps, no tolerances.

The largest entry of an input is 0 or moderate (see `scaling`), so that the fourth powers below
stay in the range of floats.
"""

from math import copysign, sqrt

from .jit import leaf
from .tensor import cross, det, inner, lin, norm, plus_diagonal

NEGLIGIBLE = 1e-40      # of one square against another: far below round-off
NO_LENGTH = 1e-200      # a square too small for its root to have a direction; negligible as well


@leaf
def separated(A):
    """Unit eigenvector of the eigenvalue farthest from the middle one, of a symmetric A (3 x 3).

    Returns it and whether its eigenvalue is the largest (else it is the smallest). A = q I + p B,
    where B has the eigenvalues 2 cos(a), 2 cos(a +- 2 pi/3), and det B = 2 cos(3 a).
    """
    q = (A[0][0] + A[1][1] + A[2][2]) / 3.0
    D = plus_diagonal(A, -q)
    p2 = inner(D, D) / 6.0
    if p2 <= NEGLIGIBLE * q * q:
        return (0.0, 0.0, 1.0), False
    r = 1.0 / sqrt(p2)
    d = r * r * r * det(D)
    largest = d >= 0.0
    sign = r if largest else -r
    B = times(sign, D[0]), times(sign, D[1]), times(sign, D[2])
    return null_vector(plus_diagonal(B, -largest_root(min(abs(d), 2.0)))), largest


@leaf
def largest_root(d):
    """Largest root of b^3 - 3 b = d for 0 <= d <= 2, which is 2 cos(acos(d/2)/3).

    Interpolation in Chebyshev points (error 1e-5), then a step of Halley's method (error 1e-15).
    """
    b = 1.732061 + d * (0.1664117 + d * (-0.02296097 + d * (0.004378047 - d * 0.0005044248)))
    f, df = b * (b * b - 3.0) - d, 3.0 * b * b - 3.0
    return b - f * df / (df * df - 3.0 * b * f)


@leaf
def null_vector(M):
    """Unit x with M x = 0, M symmetric of rank 2: the largest column of its cofactors c x x^T."""
    x, y, z = cross(M[1], M[2]), cross(M[2], M[0]), cross(M[0], M[1])
    diagonal = x[0]
    if y[1] > diagonal:
        x, diagonal = y, y[1]
    if z[2] > diagonal:
        x = z
    return unit_or_last(x)


@leaf
def times(a, x):
    """a x of a vector of three."""
    return a * x[0], a * x[1], a * x[2]


@leaf
def unit_or_last(x):
    """x/|x| of a vector of three; the last axis if x = 0."""
    n = norm(x)
    if n > 0.0:
        return times(1.0 / n, x)
    else:
        return 0.0, 0.0, 1.0


@leaf
def complement(n):
    """Vectors a, b that make (a, b, n) orthonormal and right-handed, |n| = 1 [Duff2017]."""
    sign = copysign(1.0, n[2])
    h = -1.0 / (sign + n[2])
    g = n[0] * n[1] * h
    a = (1.0 + sign * n[0] * n[0] * h, sign * g, -sign * n[0])
    b = (g, sign + n[1] * n[1] * h, -n[1])
    return a, b


@leaf
def turned(a, cs):
    """Two vectors turned in their plane by the angle of cosine and sine cs."""
    c, s = cs
    return lin(c, a[0], s, a[1]), lin(-s, a[0], c, a[1])


@leaf
def direction(x, y):
    """(cosine, sine) of the direction of (x, y), and its length; the first axis if it has none."""
    r2 = x * x + y * y
    if r2 > NO_LENGTH:
        r = sqrt(r2)
        return (x / r, y / r), r
    else:
        return (1.0, 0.0), 0.0


@leaf
def half(c, s):
    """Cosine and sine of half the angle of cosine c and sine s; the cosine is not negative."""
    long = sqrt(0.5 + 0.5 * abs(c))
    short = 0.5 * abs(s) / long
    if c >= 0.0:
        return long, copysign(short, s)
    else:
        return short, copysign(long, s)


@leaf
def svd2(M):
    """M = U diag(s) V^T, 2 x 2: angle of U as (cosine, sine), s[0] >= |s[1]|, angle of V.

    M is q times the rotation by a plus r times the reflection ((cos b, sin b), (sin b, -cos b)).
    Hence s = q + r, q - r; U turns by (b + a)/2, V by (b - a)/2.
    """
    a, q = direction(0.5 * (M[0][0] + M[1][1]), 0.5 * (M[1][0] - M[0][1]))
    b, r = direction(0.5 * (M[0][0] - M[1][1]), 0.5 * (M[1][0] + M[0][1]))
    v = half(b[0] * a[0] + b[1] * a[1], b[1] * a[0] - b[0] * a[1])
    u = v[0] * a[0] - v[1] * a[1], v[1] * a[0] + v[0] * a[1]
    return u, (q + r, q - r), v


@leaf
def eigh2(a, b, c):
    """Eigenvalues of ((a, b), (b, c)), ascending, and the second's eigenvector."""
    beta, r = direction(0.5 * (a - c), b)
    m = 0.5 * (a + c)
    return (m - r, m + r), half(beta[0], beta[1])
