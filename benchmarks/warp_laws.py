"""Strain, return map and stress of a step of MPM in Warp, as its users would write them.

Kernels are generic, see `warp_transfer`.
"""

from typing import Any

import warp as wp

NEWTON = 8      # iterations of `polar`: double precision for strains of order 1


@wp.func
def identity(like: Any):
    """Return the identity matrix of the size and type of a matrix."""
    I = type(like)()
    for a in range(len(like)):
        I[a, a] = like.dtype(1.0)
    return I


@wp.kernel
def deform(q: Any, after: Any, k: Any):
    """Compute F_trial = (I + dt L) F, which an elastic body keeps."""
    p = wp.tid()
    F = q.F[p]
    after.F_trial[p] = (identity(F) + k.dt * after.L[p]) * F
    after.F[p] = after.F_trial[p]


@wp.kernel
def expand(q: Any, after: Any, k: Any):
    """Compute J <- det(I + dt L) J of a fluid, which has no F."""
    p = wp.tid()
    L = after.L[p]
    after.J[p] = wp.determinant(identity(L) + k.dt * L) * q.J[p]


# Warp 1.19 takes the kernels that a factory makes of `wp.svd2` and `wp.svd3` for one.

@wp.kernel
def decompose_2d(q: Any, k: Any):
    """Decompose F = U diag(s) V^T in 2D."""
    p = wp.tid()
    U, s, V = wp.svd2(q.F[p])
    q.U[p] = U
    q.s[p] = s
    q.V[p] = V


@wp.kernel
def decompose_3d(q: Any, k: Any):
    """Decompose F = U diag(s) V^T in 3D."""
    p = wp.tid()
    U, s, V = wp.svd3(q.F[p])
    q.U[p] = U
    q.s[p] = s
    q.V[p] = V


@wp.kernel
def polar(q: Any, k: Any):
    """Compute the rotation of F by Newton's iteration, as U, with V = I."""
    p = wp.tid()
    F = q.F[p]
    R = F
    for _ in range(NEWTON):
        R = F.dtype(0.5) * (R + wp.transpose(wp.inverse(R)))
    q.U[p] = R
    q.V[p] = identity(F)


@wp.kernel
def jelly_stress(q: Any, k: Any):
    """Compute tau = 2 mu (F - R) F^T + lam (J - 1) J I with R = U V^T, and its energy."""
    p = wp.tid()
    mu, lam, F = k.law[0], k.law[1], q.F[p]
    one = type(mu)(1.0)
    strain = F - q.U[p] * wp.transpose(q.V[p])
    J = wp.determinant(F)
    q.tau[p] = type(mu)(2.0) * mu * strain * wp.transpose(F) + lam * (J - one) * J * identity(F)
    q.psi[p] = mu * wp.ddot(strain, strain) + type(mu)(0.5) * lam * (J - one) * (J - one)


@wp.kernel
def fluid_stress(q: Any, k: Any):
    """Compute tau = lam (J - 1) J I and its energy."""
    p = wp.tid()
    lam, J = k.law[1], q.J[p]
    strain = J - type(J)(1.0)
    q.tau[p] = lam * strain * J * identity(q.L[p])
    q.psi[p] = type(J)(0.5) * lam * strain * strain


@wp.func
def log_strain(s: Any):
    """Return log s."""
    e = type(s)()
    for a in range(len(s)):
        e[a] = wp.log(s[a])
    return e


@wp.func
def total(e: Any):
    """Return the sum of the entries of a vector."""
    tr = e.dtype(0.0)
    for a in range(len(e)):
        tr += e[a]
    return tr


@wp.kernel
def sand_return(q: Any, k: Any):
    """Bring F back to the cone of Drucker and Prager."""
    p = wp.tid()
    s = q.s[p]
    mu, lam, d = k.law[0], k.law[1], s.dtype(len(s))
    e = log_strain(s)
    tr = total(e)
    e_hat = type(s)()
    for a in range(len(s)):
        e_hat[a] = e[a] - tr / d
    size = wp.length(e_hat)
    excess = size + k.alpha * (d * lam + s.dtype(2.0) * mu) / (s.dtype(2.0) * mu) * tr
    if tr > s.dtype(0.0):
        for a in range(len(s)):
            s[a] = s.dtype(1.0)
    elif excess > s.dtype(0.0):
        for a in range(len(s)):
            s[a] = wp.exp(e[a] - excess / size * e_hat[a])
    q.s[p] = s
    q.F[p] = q.U[p] * wp.diag(s) * wp.transpose(q.V[p])


@wp.kernel
def sand_stress(q: Any, k: Any):
    """Compute tau = U diag(2 mu e + lam tr e) U^T with e = log s, and its energy."""
    p = wp.tid()
    mu, lam, U = k.law[0], k.law[1], q.U[p]
    e = log_strain(q.s[p])
    tr = total(e)
    two_mu = type(mu)(2.0) * mu
    q.tau[p] = U * (two_mu * wp.diag(e) + lam * tr * identity(U)) * wp.transpose(U)
    q.psi[p] = mu * wp.dot(e, e) + type(mu)(0.5) * lam * tr * tr


@wp.kernel
def energies(q: Any, k: Any):
    """Add up the kinetic, elastic and gravitational energy."""
    p = wp.tid()
    v, C, m = q.v[p], q.C[p], q.m[p]
    spin = k.dx * k.dx / type(m)(4.0) * wp.ddot(C, C)
    wp.atomic_add(q.energy, 0, type(m)(0.5) * m * (wp.dot(v, v) + spin))
    wp.atomic_add(q.energy, 1, q.V0[p] * q.psi[p])
    wp.atomic_add(q.energy, 2, -m * wp.dot(k.gravity[0], q.x[p]))
