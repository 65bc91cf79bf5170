"""Hencky strain of a deformation gradient and exponential of a strain, without singular values.

    log(I + A) = int_0^1 A (I + t A)^-1 dt

With n nodes the quadrature of Gauss and Legendre is the diagonal Pade approximant, whose error for
A = exp(2 eps) - I falls as tanh(eps/2)^(2 n) [Dieci1996, Higham2008]. By the theorem of Cayley and
Hamilton the resolvent is a polynomial in A with the invariants of A in its coefficients,

    A (I + t A)^-1 = (t^2 i3 I + (1 + t i1) A - t A^2)/(1 + t i1 + t^2 i2 + t^3 i3)    (3D)
    A (I + t A)^-1 = (t i2 I + A)/(1 + t i1 + t^2 i2)                                  (2D)

so that a node costs a dozen operations on scalars, and is independent of the other nodes.
"""

from math import factorial

from .jit import kernel, leaf
from .tensor import cofactor, det, dot, inner, mlin, mmt, plus_diagonal, scale, trace

RADIUS = 0.45           # |eps| below which the quadrature with many nodes errs by round-off alone
LEAST_STRETCH = 0.637   # every singular value of F is larger where |eps| < RADIUS
SMALL = 0.05            # |A| and |N| below which few nodes and terms suffice
LARGEST = 4.0           # trace of A up to which the quadrature tells whether |eps| < RADIUS

FEW = (
    (0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263),
    (0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692),
)       # nodes in [0, 1] and weights of Gauss and Legendre
MANY = ((
    0.009219682876640375, 0.04794137181476257, 0.11504866290284765, 0.2063410228566913,
    0.3160842505009099, 0.43738329574426554, 0.5626167042557345, 0.6839157494990901,
    0.7936589771433087, 0.8849513370971523, 0.9520586281852375, 0.9907803171233597,
), (
    0.023587668193255914, 0.05346966299765921, 0.08003916427167311, 0.10158371336153296,
    0.1167462682691774, 0.12457352290670139, 0.12457352290670139, 0.1167462682691774,
    0.10158371336153296, 0.08003916427167311, 0.05346966299765921, 0.023587668193255914,
))
SHORT, LONG = (tuple(1.0 / factorial(k) for k in range(n, -1, -1)) for n in (8, 14))    # of exp


@kernel
def hencky_strain(F):
    """eps = log(F F^T)/2 and True; anything and False unless det F > 0 and |eps| < RADIUS.

    Of F near I the strain has the relative accuracy of F - I. The quadrature grows with every
    eigenvalue of A > -1, so that its own size tells whether it is accurate.
    """
    A = stretch_difference(F)
    i = invariants(A)
    is_small = i[0] * i[0] - 2.0 * i[1] < SMALL * SMALL        # |A|^2
    if not (det(F) > 0.0 and (is_small or i[0] < LARGEST)):
        return A, False
    eps = polynomial(_half_log(i, FEW) if is_small else _half_log(i, MANY), A)
    return eps, is_small or inner(eps, eps) < RADIUS * RADIUS


@kernel
def stretch_difference(F):
    """A = F F^T - I; without cancellation on the diagonal where F is near I."""
    if len(F) == 2:
        (a, b), (c, d) = F
        xy = a * c + b * d
        return (_less_one(a) + b * b, xy), (xy, _less_one(d) + c * c)
    else:
        x, y, z = F
        xy, xz, yz = dot(x, y), dot(x, z), dot(y, z)
        return (
            (_less_one(x[0]) + (x[1] * x[1] + x[2] * x[2]), xy, xz),
            (xy, _less_one(y[1]) + (y[0] * y[0] + y[2] * y[2]), yz),
            (xz, yz, _less_one(z[2]) + (z[0] * z[0] + z[1] * z[1])),
        )


@kernel
def _less_one(x):
    """x^2 - 1."""
    return (x - 1.0) * (x + 1.0)


@kernel
def invariants(A):
    """Coefficients of det(I + t A) = 1 + i1 t + i2 t^2 (+ i3 t^3)."""
    if len(A) == 2:
        return trace(A), det(A)
    else:
        K = cofactor(A)
        return trace(A), trace(K), dot(A[0], K[0])


@leaf
def _half_log(i, rule):
    """Coefficients of log(I + A)/2 as `polynomial` takes them, by a quadrature."""
    nodes, weights = rule
    c0, c1, c2 = 0.0, 0.0, 0.0
    if len(i) == 2:
        for k in range(len(nodes)):
            t = nodes[k]
            w = 0.5 * weights[k] / (1.0 + t * (i[0] + t * i[1]))
            c0 += t * w
            c1 += w
        return c0 * i[1], c1
    else:
        for k in range(len(nodes)):
            t = nodes[k]
            growth = 1.0 + t * i[0]
            w = 0.5 * weights[k] / (growth + t * t * (i[1] + t * i[2]))
            c0 += t * t * w
            c1 += growth * w
            c2 -= t * w
        return c0 * i[2], c1, c2


@kernel
def exponential(N, size):
    """exp N of a symmetric N without trace, of size |N| < RADIUS."""
    j2 = 0.5 * size * size
    return polynomial(_exp(N, j2, SHORT) if size < SMALL else _exp(N, j2, LONG), N)


@leaf
def _exp(N, j2, taylor):
    """Coefficients of exp N by its Taylor series, in Horner's scheme.

    In 3D N^3 = j2 N + det N I, in 2D N^2 = j2 I, j2 = |N|^2/2.
    """
    if len(N) == 2:
        a, b = 0.0, 0.0
        for k in range(len(taylor)):
            a, b = taylor[k] + b * j2, a
        return a, b
    else:
        a, b, c, j3 = 0.0, 0.0, 0.0, det(N)
        for k in range(len(taylor)):
            a, b, c = taylor[k] + c * j3, a + c * j2, b
        return a, b, c


@kernel
def polynomial(c, A):
    """c_0 I + c_1 A, in 3D + c_2 A^2, of a symmetric A."""
    if len(A) == 2:
        return plus_diagonal(scale(c[1], A), c[0])
    else:
        return plus_diagonal(mlin(c[1], A, c[2], mmt(A, A)), c[0])
