"""From functions of the singular values to differentials in F, for any isotropic law.

With F = U diag(s) V^T and X = U^T dF V, the differential of P = U diag(pk1_hat(s)) V^T falls
apart (Teran et al. 2005):

    (U^T dP V)_ii          = sum_j A_ij X_jj                 A_ij = d pk1_hat_i / d s_j
    sym  of the pair i, j  = a_ij (X_ij + X_ji) / 2          a_ij = (P_i - P_j) / (s_i - s_j)
    skew of the pair i, j  = b_ij (X_ij - X_ji) / 2          b_ij = (P_i + P_j) / (s_i + s_j)

`A, pairs` with pairs = ((a_01, b_01),) in 2D and those of (0, 1), (0, 2), (1, 2) in 3D is all
there is to know at a point: the eigenvalues of d2psi/dF2 are those of A, the a and the b. A law
gives the quotients in closed form, without subtracting or dividing by nearly equal singular
values, so that repeated ones need no care.
"""

from ..core.jit import by_type, kernel
from ..core.spectral import eigh, mixed, svd
from ..core.tensor import diagonal, mlin, mm, mmt, mv, scale_columns, transpose

pk1_hat = by_type("pk1_hat")        # (s, law) -> principal P_i
dpk1_hat = by_type("dpk1_hat")      # (s, law) -> A, d x d
pair = by_type("pair")              # (s, i, j, law) -> a_ij, b_ij


@kernel
def local(s, law):
    """Return A, pairs of the exact differential at singular values s [Pa]."""
    if len(s) == 2:
        return dpk1_hat(s, law), (pair(s, 0, 1, law),)
    else:
        pairs = pair(s, 0, 1, law), pair(s, 0, 2, law), pair(s, 1, 2, law)
        return dpk1_hat(s, law), pairs


@kernel
def local_spd(s, law):
    """Return A, pairs with their negative eigenvalues set to zero; `local` to the bit if there are
    none.

    The nearest differential, in the Frobenius norm, without negative eigenvalues.
    """
    A, pairs = local(s, law)
    if len(s) == 2:
        return semidefinite(A), (_not_negative(pairs[0]),)
    else:
        kept = _not_negative(pairs[0]), _not_negative(pairs[1]), _not_negative(pairs[2])
        return semidefinite(A), kept


@kernel
def apply(A, pairs, X):
    """Return U^T dP V for X = U^T dF V."""
    return mixed(mv(A, diagonal(X)), pairs, X)


@kernel
def dpk1(F, dF, law):
    """Return the differential dP = (d2psi/dF2) : dF [Pa]."""
    U, s, V, _ = svd(F)
    A, pairs = local(s, law)
    return mmt(mm(U, apply(A, pairs, mm(transpose(U), mm(dF, V)))), V)


@kernel
def dpk1_spd(F, dF, law):
    """Return `dpk1` with its negative eigenvalues set to zero, as projected Newton needs it
    (HOT-alg1).
    """
    U, s, V, _ = svd(F)
    A, pairs = local_spd(s, law)
    return mmt(mm(U, apply(A, pairs, mm(transpose(U), mm(dF, V)))), V)


@kernel
def kirchhoff_vjp(s, T, law):
    """Return U^T F_bar V at F = U diag(s) V^T, of T = U^T tau_bar U: as tau = P F^T and d2psi/dF2
    is symmetric, F_bar = (d2psi/dF2) : (tau_bar F) + tau_bar^T P.
    """
    A, pairs = local(s, law)
    from_F = scale_columns(transpose(T), pk1_hat(s, law))
    return mlin(1.0, apply(A, pairs, scale_columns(T, s)), 1.0, from_F)


@kernel
def semidefinite(A):
    """Return a symmetric matrix with its negative eigenvalues set to zero; A itself if none is."""
    w, Q = eigh(A)
    if w[0] >= 0.0:
        return A
    else:
        return mmt(scale_columns(Q, _not_negative(w)), Q)


@kernel
def _not_negative(w):
    """Return the negative components of a vector set to zero; NaN stays NaN."""
    if len(w) == 2:
        return _at_least_zero(w[0]), _at_least_zero(w[1])
    else:
        return _at_least_zero(w[0]), _at_least_zero(w[1]), _at_least_zero(w[2])


@kernel
def _at_least_zero(x):
    return 0.0 if x < 0.0 else x
