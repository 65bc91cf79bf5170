"""Singular values, polar decomposition, symmetric eigenvalues and their differentials, of 2 x 2 and 3 x 3 matrices.

Direct, without sweeps. One eigenvector of a symmetric 3 x 3 matrix is always well conditioned: that of the eigenvalue
farthest from the middle one. It is split off by orthonormal bases; what is left is a 2 x 2 problem with a closed form.
Errors are a few units of round-off times the largest singular value, also for repeated, zero and negative ones:
nothing is divided by a small singular value or by the distance of two.
"""

from math import copysign, frexp, isfinite, ldexp, nan, sqrt

from .jit import kernel
from .tensor import (
    cross,
    det,
    diagonal,
    dot,
    fill,
    identity,
    lin,
    mlin,
    mm,
    mmt,
    mv,
    norm,
    scale_columns,
    transpose,
)

SMALLEST, LARGEST = 1e-30, 1e30     # of max |F|, where fourth powers neither overflow nor lose digits
NEGLIGIBLE = 1e-40                  # of one square against another: far below round-off
UNDETERMINED = 2.3e-16              # (s_i + s_j)/s_0 below which R is not determined


@kernel
def svd(F):
    """F = U diag(s) V^T, det U = det V = +1, s[0] >= s[1] >= |s[2]|; det F < 0 makes the last one negative.

    Returns U, s, V, ok. For input that is not finite ok is False and U, s, V are NaN.
    """
    if not _all_finite(F):
        return _nan(F), fill(nan, F), _nan(F), False
    A, e = _moderate(F)
    U, s, V = _svd(A)
    return U, _rescaled(s, e), V, True


@kernel
def polar(F):
    """F = R S, R = U V^T a proper rotation, S = V diag(s) V^T symmetric, with one negative eigenvalue if det F < 0."""
    U, s, V, _ = svd(F)
    return mmt(U, V), mmt(scale_columns(V, s), V)


@kernel
def rotation(F):
    """R of `polar`."""
    return polar(F)[0]


@kernel
def eigh(A):
    """A = Q diag(w) Q^T of a symmetric A (its upper triangle is read): w ascending, det Q = +1.

    NaN for input that is not finite.
    """
    if not _all_finite(A):
        return fill(nan, A), _nan(A)
    B, e = _moderate(A)
    w, Q = _eigh(B)
    return _rescaled(w, e), Q


@kernel
def d_rotation(U, s, V, dF):
    """dR of R = U V^T when F = U diag(s) V^T changes by dF: U X V^T, X_ij = (M_ij - M_ji)/(s_i + s_j), M = U^T dF V.

    Smooth for repeated singular values. Where s_i + s_j = 0 (to round-off) R is not unique: X_ij = 0 is returned.
    """
    M = mm(transpose(U), mm(dF, V))
    if len(s) == 2:
        x = _spin(M, s, 0, 1)
        X = (0.0, x), (-x, 0.0)
    else:
        x, y, z = _spin(M, s, 0, 1), _spin(M, s, 0, 2), _spin(M, s, 1, 2)
        X = (0.0, x, y), (-x, 0.0, z), (-y, -z, 0.0)
    return mmt(mm(U, X), V)


@kernel
def d_singular(U, V, dF):
    """ds_i = u_i . dF v_i. Of repeated singular values only symmetric functions (their sum, ..) have a differential."""
    return diagonal(mm(transpose(U), mm(dF, V)))


@kernel
def _spin(M, s, i, j):
    total = s[i] + s[j]
    return (M[i][j] - M[j][i]) / total if total > UNDETERMINED * s[0] else 0.0


@kernel
def _nan(like):
    return mlin(nan, identity(like), nan, identity(like))


@kernel
def _finite(x):
    if len(x) == 2:
        return isfinite(x[0]) and isfinite(x[1])
    else:
        return isfinite(x[0]) and isfinite(x[1]) and isfinite(x[2])


@kernel
def _all_finite(A):
    if len(A) == 2:
        return _finite(A[0]) and _finite(A[1])
    else:
        return _finite(A[0]) and _finite(A[1]) and _finite(A[2])


@kernel
def _largest(x):
    if len(x) == 2:
        return max(abs(x[0]), abs(x[1]))
    else:
        return max(abs(x[0]), abs(x[1]), abs(x[2]))


@kernel
def _largest_entry(A):
    if len(A) == 2:
        return max(_largest(A[0]), _largest(A[1]))
    else:
        return max(_largest(A[0]), _largest(A[1]), _largest(A[2]))


@kernel
def _moderate(A):
    """2^-e A and e, such that fourth powers are harmless; e = 0 but for extreme A."""
    a = _largest_entry(A)
    if (SMALLEST < a and a < LARGEST) or a == 0.0:
        return A, 0
    e = frexp(a)[1]
    return _shifted(A, -e), e


@kernel
def _shifted(A, e):
    if len(A) == 2:
        return (
            (ldexp(A[0][0], e), ldexp(A[0][1], e)),
            (ldexp(A[1][0], e), ldexp(A[1][1], e)),
        )
    else:
        return (
            (ldexp(A[0][0], e), ldexp(A[0][1], e), ldexp(A[0][2], e)),
            (ldexp(A[1][0], e), ldexp(A[1][1], e), ldexp(A[1][2], e)),
            (ldexp(A[2][0], e), ldexp(A[2][1], e), ldexp(A[2][2], e)),
        )


@kernel
def _rescaled(s, e):
    """2^e s, in two steps for 2^e itself may be out of range; infinite where s is."""
    if e == 0:
        return s
    t = lin(ldexp(1.0, e // 2), s, 0.0, s)
    return lin(ldexp(1.0, e - e // 2), t, 0.0, t)


@kernel
def _svd(F):
    if len(F) == 2:
        (cu, su), s, (cv, sv) = _svd2(F[0][0], F[0][1], F[1][0], F[1][1])
        return ((cu, -su), (su, cu)), s, ((cv, -sv), (sv, cv))
    else:
        v, top = _separated(_gram(F))
        w = _complement(v)
        f0, f1, fv = mv(F, w[0]), mv(F, w[1]), mv(F, v)
        u = _unit(fv if top else cross(f0, f1))
        a = _complement(u)
        cs_u, t, cs_v = _svd2(dot(a[0], f0), dot(a[0], f1), dot(a[1], f0), dot(a[1], f1))
        a, w, t_u = _turned(a, cs_u), _turned(w, cs_v), dot(u, fv)
        if top:
            U, s, V = (u, a[0], a[1]), (t_u, t[0], t[1]), (v, w[0], w[1])
        else:
            U, s, V = (a[0], a[1], u), (t[0], t[1], t_u), (w[0], w[1], v)
        return transpose(U), _in_order(s), transpose(V)


@kernel
def _in_order(s):
    """s[0] >= s[1] >= |s[2]| where equal values came out in the other order by round-off."""
    s1 = min(s[1], s[0])
    return s[0], s1, max(-s1, min(s[2], s1))


@kernel
def _eigh(A):
    if len(A) == 2:
        w, (c, s) = _eigh2(A[0][0], A[0][1], A[1][1])
        return w, ((s, c), (-c, s))
    else:
        S = (A[0], (A[0][1], A[1][1], A[1][2]), (A[0][2], A[1][2], A[2][2]))
        v, top = _separated(S)
        a = _complement(v)
        s0, s1 = mv(S, a[0]), mv(S, a[1])
        w, (c, s) = _eigh2(dot(a[0], s0), dot(a[0], s1), dot(a[1], s1))
        q, p = _turned(a, (s, -c))
        w_v = dot(v, mv(S, v))
        if top:
            return (w[0], w[1], max(w_v, w[1])), transpose((q, p, v))
        else:
            return (min(w_v, w[0]), w[0], w[1]), transpose((v, q, p))


@kernel
def _gram(F):
    """F^T F."""
    C = transpose(F)
    return mmt(C, C)


@kernel
def _separated(A):
    """Unit eigenvector of the eigenvalue of A that is farthest from the middle one, and whether it is the largest."""
    q = (A[0][0] + A[1][1] + A[2][2]) / 3.0
    D = mlin(1.0, A, -q, identity(A))
    p2 = (dot(D[0], D[0]) + dot(D[1], D[1]) + dot(D[2], D[2])) / 6.0
    if p2 <= NEGLIGIBLE * q * q:
        return (0.0, 0.0, 1.0), False
    p = 1.0 / sqrt(p2)
    d = p * p * p * det(D)
    top = d >= 0.0
    sign = p if top else -p
    return _null(mlin(sign, D, -_largest_root(min(abs(d), 2.0)), identity(A))), top


@kernel
def _largest_root(d):
    """Largest root of b^3 - 3 b - d = 0 for 0 <= d <= 2, that is 2 cos(acos(d/2)/3)."""
    b = 1.732061 + d * (0.1664117 + d * (-0.02296097 + d * (0.004378047 - d * 0.0005044248)))
    f, df = b * (b * b - 3.0) - d, 3.0 * b * b - 3.0
    return b - f * df / (df * df - 3.0 * b * f)


@kernel
def _null(M):
    """Unit vector x with M x = 0 of a symmetric M of rank 2: the largest column of its cofactor matrix."""
    x, y, z = cross(M[1], M[2]), cross(M[2], M[0]), cross(M[0], M[1])
    x00 = x[0]
    if y[1] > x[0]:
        x, x00 = y, y[1]
    if z[2] > x00:
        x = z
    return _unit(x)


@kernel
def _unit(x):
    """x/|x|; an axis if x = 0."""
    n = norm(x)
    if n > 0.0:
        return lin(1.0 / n, x, 0.0, x)
    else:
        return 0.0, 0.0, 1.0


@kernel
def _complement(n):
    """Unit vectors a, b such that (a, b, n) is a right-handed orthonormal basis (Duff et al. 2017)."""
    sign = copysign(1.0, n[2])
    h = -1.0 / (sign + n[2])
    g = n[0] * n[1] * h
    a = (1.0 + sign * n[0] * n[0] * h, sign * g, -sign * n[0])
    b = (g, sign + n[1] * n[1] * h, -n[1])
    return a, b


@kernel
def _turned(a, cs):
    """Two vectors turned in their plane by the angle of cosine and sine cs."""
    c, s = cs
    return lin(c, a[0], s, a[1]), lin(-s, a[0], c, a[1])


@kernel
def _angle(x, y):
    """Cosine and sine of the direction (x, y), and its length; direction (1, 0) for a negligible length."""
    r2 = x * x + y * y
    if r2 > 1e-200:
        r = sqrt(r2)
        return x / r, y / r, r
    else:
        return 1.0, 0.0, 0.0


@kernel
def _half(c, s):
    """Cosine and sine of half the angle of cosine c and sine s, the cosine not negative."""
    long = sqrt(0.5 + 0.5 * abs(c))
    short = 0.5 * abs(s) / long
    if c >= 0.0:
        return long, copysign(short, s)
    else:
        return short, copysign(long, s)


@kernel
def _svd2(a, b, c, d):
    """Angles of U and V as (cosine, sine), and s, of the matrix ((a, b), (c, d)): s[0] >= |s[1]|.

    It is q Rot(alpha) + r Rot(beta) diag(1, -1), so that s = q + r, q - r, U and V turn by (beta + alpha)/2, (beta - alpha)/2.
    """
    ca, sa, q = _angle(0.5 * (a + d), 0.5 * (c - b))
    cb, sb, r = _angle(0.5 * (a - d), 0.5 * (c + b))
    if r == 0.0:
        cb, sb = ca, sa
    cv, sv = _half(cb * ca + sb * sa, sb * ca - cb * sa)
    return (cv * ca - sv * sa, sv * ca + cv * sa), (q + r, q - r), (cv, sv)


@kernel
def _eigh2(a, b, d):
    """Eigenvalues of ((a, b), (b, d)), ascending; direction of the second's eigenvector, as (cosine, sine)."""
    cb, sb, r = _angle(0.5 * (a - d), b)
    m = 0.5 * (a + d)
    return (m - r, m + r), _half(cb, sb)
