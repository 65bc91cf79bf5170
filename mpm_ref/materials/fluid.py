"""Weakly compressible fluid: an energy of J = det F alone (NCLAW-eq20).

    psi(F) = lam/2 (J - 1)^2,    P = lam (J - 1) cof(F),    tau = lam J (J - 1) I

`pressure` and `psi_volume` need J only, so that a fluid need not carry F; the functions of F are
for models that carry it (NCLaw keeps F = J^(1/d) I), for the fixed corotated law, whose volume
term this is, and for tests. Smooth for every F, J <= 0 included.
"""

from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import cofactor, det, diag, fill, lin, mlin, outer
from . import principal
from .moduli import lame, positive
from .stretches import d_others, others, volume


class Fluid(NamedTuple):
    """A fluid without shear stress."""

    lam: float      # bulk modulus at rest [Pa]


def build(lam=None, E=None, nu=None):
    """Return a fluid of bulk modulus lam [Pa], or of the lam that belongs to E [Pa] and nu
    (NCLAW-mat).

    Raises ValueError unless lam > 0, and unless it is given either lam or both E and nu.
    """
    if (lam is None) == (E is None and nu is None) or (E is None) != (nu is None):
        raise ValueError(
            f"lam = {lam}, E = {E}, nu = {nu}: expected the bulk modulus lam, or both E and nu"
        )
    return Fluid(positive(lam=lame(E, nu)[1] if lam is None else lam))


@kernel
def stiffness(law):
    """Return the modulus lam: rho times the square of the speed of sound at rest [Pa]."""
    return law.lam


@kernel
def units(law):
    """Return the law of lam = 1 Pa: stress is linear in it."""
    return (Fluid(1.0),)


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]."""
    return psi_volume(det(F), law)


@kernel
def psi_volume(J, law):
    """Return the energy per rest volume [J/m^3] of the volume ratio J."""
    return 0.5 * law.lam * (J - 1.0) * (J - 1.0)


@kernel
def pk1(F, law):
    """Return P = lam (J - 1) cof(F) [Pa]."""
    return mlin(law.lam * (det(F) - 1.0), cofactor(F), 0.0, F)


@kernel
def pressure(J, law):
    """Return the isotropic tau = lam J (J - 1) [Pa], positive in tension (NCLAW-eq20)."""
    return law.lam * J * (J - 1.0)


@kernel
def d_pressure(J, law):
    """Return d pressure / dJ = lam (2 J - 1) [Pa]."""
    return law.lam * (2.0 * J - 1.0)


@kernel
def kirchhoff(F, law):
    """Return the Kirchhoff stress lam J (J - 1) I [Pa]."""
    return diag(fill(pressure(det(F), law), F))


@kernel
def kirchhoff_hat(s, law):
    """Return the principal tau_i [Pa]."""
    return fill(pressure(volume(s), law), s)


@kernel
def pk1_hat(s, law):
    """Return P_i = lam (J - 1) dJ/ds_i [Pa]."""
    c = others(s)
    return lin(law.lam * (volume(s) - 1.0), c, 0.0, c)


@kernel
def dpk1_hat(s, law):
    """Return A_ij = lam (dJ/ds_i dJ/ds_j + (J - 1) d2J/ds_i ds_j) [Pa]."""
    c = others(s)
    return mlin(law.lam, outer(c, c), law.lam * (volume(s) - 1.0), d_others(s))


@kernel
def pair(s, i, j, law):
    """Return a_ij = -b_ij = -lam (J - 1) d2J/ds_i ds_j [Pa]."""
    b = law.lam * (volume(s) - 1.0) * d_others(s)[i][j]
    return -b, b


dpk1 = principal.dpk1
