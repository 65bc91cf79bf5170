"""Singular values, polar decomposition, symmetric eigenvalues and their differentials, 2D and 3D.

Errors are a few units of round-off times the largest singular value, whether singular values are
repeated, zero, negative or 1e-300: nothing is divided by a small one, nor by the difference of two.
The method stands in `deflation`.
"""

from math import nan, sqrt

from .deflation import (
    complement,
    direction,
    eigh2,
    separated,
    svd2,
    turned,
    unit_or_last,
)
from .jit import kernel, leaf
from .scaling import is_finite, is_moderate, moderate, not_a_number, rescaled
from .tensor import (
    cofactor,
    cross,
    det,
    diagonal,
    dot,
    doubles,
    fill,
    inner,
    mlin,
    mm,
    mmt,
    mv,
    numbers,
    plus_diagonal,
    scale_columns,
    trace,
    transpose,
    vector_of,
)

UNDETERMINED = 2.3e-16      # (s_i + s_j)/s_0, at and below which R is not determined
MOST_ITERATIONS, SMALL_STEP = 8, 1e-6   # for the sum of singular values; the last step over it
FAR_FROM_SINGULAR = 6.0     # most (sum s)^3/prod (s_i + s_j) for the fast rotation; 27/8 at F = I


@kernel
def svd(F):
    """F = U diag(s) V^T, det U = det V = +1, s[0] >= s[1] >= |s[2]|; s[-1] has the sign of det F.

    Returns U, s, V, ok. For input that is not finite ok is False and U, s, V are NaN. Of a single F
    they are computed in double, then rounded.
    """
    if not is_finite(F):
        return not_a_number(F), fill(nan, F[0]), not_a_number(F), False
    A, e = moderate(doubles(F))
    U, s, V = _svd(A)
    one = F[0][0]
    return numbers(U, one), vector_of(rescaled(s, e), one), numbers(V, one), True


@kernel
def polar(F):
    """F = R S, R = U V^T a proper rotation, S = V diag(s) V^T symmetric, as U, s, V of `svd`.

    Where det F < 0, S has one negative eigenvalue. NaN for input that is not finite.
    """
    U, s, V, _ = svd(F)
    return mmt(U, V), mmt(scale_columns(V, s), V)


@kernel
def rotation(F):
    """R of `polar` to round-off; three times as fast where F is far from singular and inverted."""
    if is_moderate(F):
        R, ok = _fast_rotation(F)
        if ok:
            return R
    U, _, V, _ = svd(F)
    return mmt(U, V)


@kernel
def stretch(F):
    """Left stretch V of F = V R with R of `polar`: V = R F^T = U diag(s) U^T, symmetric.

    As fast as `rotation`, and all that a stress needs: F F^T - V = (F - R) F^T.
    """
    if len(F) == 2:
        return mmt(rotation(F), F)
    else:
        if is_moderate(F):
            B = mmt(F, F)
            t = sum_of_singular(trace(B), trace(cofactor(B)), det(F))
            V, ok = _fast_stretch(F, t)
            if ok:
                return V
        return _stretch_by_svd(F)


@kernel
def stretch_by_sum(F, t):
    """`stretch` in 3D, of F with the `sum_of_singular` t; that is not read where F is close to
    singular, inverted, huge or tiny.
    """
    if is_moderate(F):
        V, ok = _fast_stretch(F, t)
        if ok:
            return V
    return _stretch_by_svd(F)


@kernel
def _stretch_by_svd(F):
    U, s, _, _ = svd(F)
    return mmt(scale_columns(U, s), U)


@kernel
def eigh(A):
    """A = Q diag(w) Q^T of a symmetric A (its upper triangle is read): w ascending, det Q = +1.

    Returns w, Q; NaN for input that is not finite.
    """
    if not is_finite(A):
        return fill(nan, A), not_a_number(A)
    B, e = moderate(A)
    w, Q = _eigh(B)
    return rescaled(w, e), Q


@kernel
def d_rotation(U, s, V, dF):
    """Change of R = U V^T when F = U diag(s) V^T changes by dF.

    dR = U X V^T, X_ij = (M_ij - M_ji)/(s_i + s_j), M = U^T dF V: regular for repeated singular
    values. Where s_i + s_j = 0 to round-off, R is not unique and has no differential: X_ij = 0.
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
    """ds_i = u_i . dF v_i when F changes by dF.

    Repeated singular values have no differential, but symmetric functions of them do, as their sum.
    """
    return diagonal(mm(transpose(U), mm(dF, V)))


@kernel
def mixed(x, pairs, X):
    """Matrix of diagonal x; of each pair i, j of X the symmetric part a and the skew part b times.

    How the differential of an isotropic function acts in principal axes, and its adjoint as well.
    pairs = ((a, b),) in 2D; in 3D those of (0, 1), (0, 2), (1, 2).
    """
    if len(X) == 2:
        p, q = _mixed(pairs[0], X[0][1], X[1][0])
        return (x[0], p), (q, x[1])
    else:
        p01, p10 = _mixed(pairs[0], X[0][1], X[1][0])
        p02, p20 = _mixed(pairs[1], X[0][2], X[2][0])
        p12, p21 = _mixed(pairs[2], X[1][2], X[2][1])
        return (x[0], p01, p02), (p10, x[1], p12), (p20, p21, x[2])


@kernel
def _mixed(ab, x_ij, x_ji):
    sym, skew = 0.5 * ab[0] * (x_ij + x_ji), 0.5 * ab[1] * (x_ij - x_ji)
    return sym + skew, sym - skew


@kernel
def _spin(M, s, i, j):
    total = s[i] + s[j]
    return (M[i][j] - M[j][i]) / total if total > UNDETERMINED * s[0] else 0.0


@leaf
def _svd(F):
    if len(F) == 2:
        u, s, v = svd2(F)
        return ((u[0], -u[1]), (u[1], u[0])), s, ((v[0], -v[1]), (v[1], v[0]))
    else:
        C = transpose(F)
        v, largest = separated(mmt(C, C))
        w = complement(v)
        f0, f1, fv = mv(F, w[0]), mv(F, w[1]), mv(F, v)
        u = unit_or_last(fv if largest else cross(f0, f1))
        a = complement(u)
        turn_u, s, turn_v = svd2(((dot(a[0], f0), dot(a[0], f1)), (dot(a[1], f0), dot(a[1], f1))))
        a, w = turned(a, turn_u), turned(w, turn_v)
        if largest:
            return _columns(u, a), _sorted(dot(u, fv), s[0], s[1]), _columns(v, w)
        return _columns_last(a, u), _sorted(s[0], s[1], dot(u, fv)), _columns_last(w, v)


@kernel
def _columns(u, a):
    """Matrix of the columns u, a[0], a[1]."""
    return transpose((u, a[0], a[1]))


@kernel
def _columns_last(a, u):
    """Matrix of the columns a[0], a[1], u."""
    return transpose((a[0], a[1], u))


@kernel
def _sorted(a, b, c):
    """s[0] >= s[1] >= |s[2]| where round-off puts equal values in the other order."""
    b = min(a, b)
    return a, b, max(-b, min(b, c))


@kernel
def _eigh(A):
    if len(A) == 2:
        w, (c, s) = eigh2(A[0][0], A[0][1], A[1][1])
        return w, ((s, c), (-c, s))
    else:
        S = (A[0], (A[0][1], A[1][1], A[1][2]), (A[0][2], A[1][2], A[2][2]))
        v, largest = separated(S)
        a = complement(v)
        s0, s1, t = mv(S, a[0]), mv(S, a[1]), dot(v, mv(S, v))
        w, (c, s) = eigh2(dot(a[0], s0), dot(a[0], s1), dot(a[1], s1))
        a = turned(a, (s, -c))
        if largest:
            return (w[0], w[1], max(t, w[1])), _columns_last(a, v)
        return (min(t, w[0]), w[0], w[1]), _columns(v, a)


@leaf
def _fast_rotation(F):
    """R and True, or anything and False if F is too close to singular or inverted.

    R = ((|F|^2 + t^2)/2 F + t cof F - F F^T F)/z,  t = sum s_i,  z = prod (s_i + s_j)
    [Markley1993]. It loses digits as z/t^3 does.
    """
    if len(F) == 2:
        (c, s), r = direction(F[0][0] + F[1][1], F[1][0] - F[0][1])
        return ((c, -s), (s, c)), r > 0.0
    else:
        K = cofactor(F)
        n2, J = inner(F, F), dot(F[0], K[0])
        t = sum_of_singular(n2, inner(K, K), J)
        z = 0.5 * t * (t * t - n2) - J
        if not (FAR_FROM_SINGULAR * z > t * t * t):
            return F, False
        G = mlin(0.5 * (n2 + t * t) / z, F, t / z, K)
        return mlin(1.0, G, -1.0 / z, mm(mmt(F, F), F)), True


@leaf
def _fast_stretch(F, t):
    """R F^T of `_fast_rotation`, from B = F F^T: V = ((tr B + t^2)/2 B + t J I - B B)/z."""
    B, J = mmt(F, F), det(F)
    n2 = trace(B)
    z = 0.5 * t * (t * t - n2) - J
    if not (FAR_FROM_SINGULAR * z > t * t * t):
        return F, False
    V = mlin(0.5 * (n2 + t * t) / z, B, -1.0 / z, mmt(B, B))
    return plus_diagonal(V, t * J / z), True


@leaf
def sum_of_singular(n2, k2, J):
    """t = sum s_i of n2 = |F|^2, k2 = |cof F|^2, J = det F.

    It is the largest root of (t^2 - n2)^2 - 8 J t - 4 k2. All roots are real, so that Halley's
    method descends to it from sqrt(3 n2) >= t. Given up where the rotation will be.
    """
    t = sqrt(3.0 * n2)
    for _ in range(MOST_ITERATIONS):
        z = product_of_sums(t, n2, J)
        if not (FAR_FROM_SINGULAR * z > t * t * t):
            break
        step = halley_step(t, z, n2, k2, J)
        t -= step
        if step <= SMALL_STEP * t:
            break
    return t


@kernel
def product_of_sums(t, n2, J):
    """Return z = prod (s_i + s_j) of t = sum s_i."""
    return 0.5 * t * (t * t - n2) - J


@kernel
def halley_step(t, z, n2, k2, J):
    """Return the step by which Halley's method lowers t, z of `product_of_sums`."""
    h = t * t - n2
    f = h * h - 8.0 * J * t - 4.0 * k2
    return 8.0 * z * f / (64.0 * z * z - f * (6.0 * t * t - 2.0 * n2))
