"""Elastic constants, yield radii, and the checks of parameters where they enter."""

from math import isfinite, sqrt


def lame(E, nu):
    """Return mu, lam [Pa] of Young's modulus E [Pa] and Poisson's ratio nu (NSF-F0).

    The same in 2D, where the laws without a deviator are then in plane strain. Raises ValueError
    unless E > 0 and -1 < nu < 1/2.
    """
    positive(E=E)
    if not -1.0 < nu < 0.5:
        raise ValueError(
            f"nu = {nu}: expected -1 < nu < 0.5; take 0.49 for nearly incompressible matter, "
            "where the time step is still affordable"
        )
    return E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))


def bulk_modulus(E, nu):
    """Return the bulk modulus E / (3 (1 - 2 nu)) = lam + 2 mu / 3 [Pa] (NSF-F0); errors as
    `lame`.
    """
    mu, lam = lame(E, nu)
    return lam + 2.0 * mu / 3.0


def yield_radius(dim, sigma_y=None, tau_y=None):
    """Return the radius tau_y of the yield surface |dev tau|_F = tau_y [Pa], the convention of all
    flows here.

    The papers use two (X-cross-7): this radius itself (NSF-F4, NCLAW-eq18), or the yield stress
    in uniaxial tension, of which the radius is sqrt(2/3) sigma_y in 3D (NSF-F5, HOT-vonmises) and
    sqrt(1/2) sigma_y in 2D (X-cross-15: the deviator is that of the plane, |tau_1 - tau_2| <=
    sigma_y). Exactly one is to be given; ValueError otherwise.
    """
    if (sigma_y is None) == (tau_y is None):
        raise ValueError(
            f"sigma_y = {sigma_y}, tau_y = {tau_y}: expected one of them: sigma_y is the uniaxial "
            "yield stress, tau_y the Frobenius norm of the deviatoric stress at yield"
        )
    if tau_y is not None:
        return positive(tau_y=tau_y)
    return positive(sigma_y=sigma_y) * sqrt(0.5 if dim == 2 else 2.0 / 3.0)


def positive(**named):
    """Return the one given number as a float; ValueError unless finite and > 0."""
    return _checked(named, lambda x: x > 0.0, "a finite number > 0")


def not_negative(**named):
    """Return the one given number as a float; ValueError unless finite and >= 0."""
    return _checked(named, lambda x: x >= 0.0, "a finite number >= 0")


def least_stretch(s_min):
    """Return the bound to which singular values are lifted, 0 for none; ValueError outside
    [0, 1).
    """
    return _checked({"s_min": s_min}, lambda x: 0.0 <= x < 1.0, "0 <= s_min < 1, 0 for no bound")


def _checked(named, holds, expected):
    (name, value), = named.items()
    if not (isfinite(value) and holds(value)):
        raise ValueError(f"{name} = {value}: expected {expected}")
    return float(value)
