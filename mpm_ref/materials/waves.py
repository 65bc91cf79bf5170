"""The stiffest wave of a deformed material, for the stable time step.

A small plane wave of direction n and polarisation u, in the material as it stands at singular
values s, travels at the speed c with

    rho_0 c^2 = u_i n_j a_ijkl u_k n_l,     a_ijkl = F_jJ F_lL d2psi/dF_iJ dF_kL [Pa]

where rho_0 is the density *at rest*: both sides are per rest volume. In principal axes, with A, a,
b of `principal`, the form consists of

    u_i^2 n_i^2 s_i^2 A_ii                                          compression along axis i
    u_i^2 n_j^2 s_j^2 g_ij,   g = (a + b)/2                         shear, i and j different
    2 u_i n_j u_j n_i k_ij,   k = s_i s_j (A_ij + (a - b)/2)        their coupling

The last two are a quadratic form in (u_i n_j, u_j n_i), of matrix ((s_j^2 g, k), (k, s_i^2 g)).
Since the u_i^2 n_j^2 sum up to 1, no wave exceeds the largest of the s_i^2 A_ii and of the larger
eigenvalues of these matrices. At rest all of them are lam + 2 mu: the bound is attained. Waves
along the principal axes alone do not bound the others: in Hencky matter at large strain the
fastest wave runs between the axes.
"""

from math import isnan, nan, sqrt

from ..core.jit import by_type, kernel
from .principal import dpk1_hat, pair

stiffness = by_type("stiffness")        # (law) -> lam + 2 mu [Pa], the wave modulus at rest
# (law) -> lam + 2 mu and `timestep.largest_modulus`, of a law without second derivatives
moduli_at_rest = by_type("moduli_at_rest", 0)


@kernel
def wave_modulus(s, law):
    """Return W [Pa]: no elastic wave at singular values s is faster than c = sqrt(W / rho_0).

    lam + 2 mu at rest, lam J^2 for a fluid, >= 0; NaN where the law is not defined. c is a speed
    in space, as the cell size is.
    """
    A = dpk1_hat(s, law)
    W = 0.0
    for i in range(len(s)):
        W = max(W, s[i] * s[i] * A[i][i])
        for j in range(i):
            a, b = pair(s, j, i, law)
            g, k = 0.5 * (a + b), s[i] * s[j] * (A[i][j] + 0.5 * (a - b))
            W = max(W, _larger_eigenvalue(s[j] * s[j] * g, k, s[i] * s[i] * g))
    return nan if isnan(A[0][0]) else W


@kernel
def _larger_eigenvalue(p, k, q):
    """Return the larger eigenvalue of ((p, k), (k, q))."""
    h = 0.5 * (p - q)
    return 0.5 * (p + q) + sqrt(h * h + k * k)
