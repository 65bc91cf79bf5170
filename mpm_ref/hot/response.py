"""Energy and stress of particles after the step they are about to make.

    F_p = (I + dt L_p) F_p^n,    psi_p = V0_p psi(F_p),    T_p = dt V0_p P(F_p) (F_p^n)^T

T_p is what the sum HOT-eq2 takes, times -dt: the derivative of psi_p with respect to L_p [J s].
"""

from math import inf

from ..core import law as laws
from ..core.jit import CHUNKS, by_type, chunk, kernel, parallel, prange
from ..core.spectral import rotation, svd
from ..core.tensor import (
    dot,
    identity,
    inner,
    mat,
    mlin,
    mm,
    mmt,
    put_mat,
    scale_columns,
    total_of,
)
from ..materials import FixedCorotated, Fluid, Hencky, LogNeoHookean, NeoHookean, fluid, hencky
from ..materials.log_strain import log_strain

energy_and_stress = by_type("energy_and_stress")      # (F, law) -> psi, P, at the cost of P alone


@kernel
def moved(L, dt, F):
    """(I + dt L) F."""
    return mm(mlin(1.0, identity(F), dt, L), F)


@kernel
def respond(sites, law, dt, like, bounds):
    """psi_p and T_p of the particles bounds[0] .. bounds[1] - 1; before, T_p holds L_p."""
    for p in range(bounds[0], bounds[1]):
        F_n = mat(sites.F, p, like)
        psi, P = energy_and_stress(moved(mat(sites.T, p, like), dt, F_n), law)
        sites.psi[p] = sites.V0[p] * psi
        put_mat(sites.T, p, mlin(dt * sites.V0[p], mmt(P, F_n), 0.0, F_n))


@kernel
def by_rotation(F, law):
    """psi, P of the fixed corotated law from one polar decomposition (NCLAW-eq12)."""
    D = mlin(1.0, F, -1.0, rotation(F))
    psi = law.mu * inner(D, D) + fluid.psi(F, law)
    return psi, mlin(2.0 * law.mu, D, 1.0, fluid.pk1(F, law))


@kernel
def by_stretches(F, law):
    """psi, P of the Hencky law from one singular value decomposition (NSF-eq13)."""
    U, s, V, _ = svd(F)
    psi = inf
    if s[len(s) - 1] > 0.0:
        eps = log_strain(s)
        psi = law.mu * dot(eps, eps) + 0.5 * law.lam * total_of(eps) * total_of(eps)
    return psi, mmt(scale_columns(U, hencky.pk1_hat(s, law)), V)


@kernel
def apart(F, law):
    """psi, P of a law that needs no decomposition."""
    return laws.psi(F, law), laws.pk1(F, law)


energy_and_stress.method(FixedCorotated, by_rotation)
energy_and_stress.method(Hencky, by_stretches)
for _law in (NeoHookean, LogNeoHookean, Fluid):
    energy_and_stress.method(_law, apart)


@parallel
def _respond_all(sites, law, dt, like):
    for c in prange(CHUNKS):
        respond(sites, law, dt, like, chunk(c, len(sites.psi)))


def response(sites, law, dt):
    """`respond` for all particles of a body."""
    _respond_all(sites, law, dt, tuple(range(sites.F.shape[1])))
