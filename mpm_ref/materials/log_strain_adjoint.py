"""Adjoints of what return maps do with principal strains; `X_bar` is the gradient of a loss by X.

`log_gap_ratio` is what the pairs of singular values need: with z = (s_i - s_j)/s_j a return of the
share c gives (s'_i - s'_j)/(s_i - s_j) = (s'_j/s_j) expm1(c log1p(z))/z, with the limit c s'_j/s_j
at z = 0. Nothing nearly equal is subtracted but s_i - s_j itself, on which the value depends
smoothly: its relative error is a few units of round-off times s_0/s_j, whatever the gap.
"""

from math import expm1, inf, log1p

from ..core.jit import kernel
from ..core.tensor import dot, fill, lin, mul, norm, total_of
from .log_strain import clamp, deviator, lifted, log_strain, stretches
from .stretches import inverse


@kernel
def radial_vjp(x, radius, x_bar, size_bar):
    """Return x_bar and radius_bar of x' = mean(x) + radius n, n = dev x/|dev x|, from x'_bar.

    size_bar is the bar of |dev x|, where it is used beside x'.
    """
    x_hat = deviator(x)
    size = norm(x_hat)
    n = lin(1.0 / size, x_hat, 0.0, x_hat)
    q = deviator(x_bar)
    radius_bar = dot(q, n)
    across = lin(1.0, q, -radius_bar, n)
    of_n = lin(radius / size, across, size_bar, n)
    return lin(1.0, of_n, total_of(x_bar) / len(x), fill(1.0, x)), radius_bar


@kernel
def radial_return_vjp(s, bars, tau_y, law, s_min):
    """Return the bars of s, of tau_y/(2 mu) and of s_min, from bars = (s'_bar, dgamma_bar) of
    `radial_return`, and the share tau_y/(2 mu)/|eps_hat| of the deviator that is left; 1 inside the
    surface.
    """
    s_bar, dgamma_bar = bars
    eps = log_strain(lifted(s, s_min))
    eps_hat = deviator(eps)
    size, radius = norm(eps_hat), tau_y / (2.0 * law.mu)
    dgamma = size - radius
    if not dgamma > 0.0:
        return s_bar, 0.0, 0.0, 1.0
    s_new = stretches(lin(1.0, eps, -dgamma / size, eps_hat))
    eps_bar, radius_bar = radial_vjp(eps, radius, mul(s_new, s_bar), dgamma_bar)
    s_bar, s_min_bar = log_strain_vjp(s, eps_bar, s_min)
    return s_bar, radius_bar - dgamma_bar, s_min_bar, radius / size


@kernel
def log_strain_vjp(s, eps_bar, s_min):
    """Return the bars of s and s_min of eps = log(lifted(s))."""
    return lifted_vjp(s, mul(eps_bar, inverse(lifted(s, s_min))), s_min)


@kernel
def lifted_vjp(s, x_bar, s_min):
    """Return the bars of s and s_min of x = lifted(s)."""
    if s_min > 0.0:
        s_bar, s_min_bar, _ = clamp_vjp(s, x_bar, s_min, inf)
        return s_bar, s_min_bar
    else:
        return x_bar, 0.0


@kernel
def clamp_vjp(s, x_bar, low, high):
    """Return the bars of s, low and high of x = clamp(s)."""
    low_bar, high_bar = 0.0, 0.0
    for i in range(len(s)):
        if s[i] < low:
            low_bar += x_bar[i]
        elif s[i] > high:
            high_bar += x_bar[i]
    return mul(x_bar, unclamped(s, low, high)), low_bar, high_bar


@kernel
def unclamped(s, low, high):
    """Return 1 for each s_i that a clamp leaves as it is, otherwise 0."""
    if len(s) == 2:
        return _unclamped(s[0], low, high), _unclamped(s[1], low, high)
    else:
        return _unclamped(s[0], low, high), _unclamped(s[1], low, high), _unclamped(s[2], low, high)


@kernel
def _unclamped(x, low, high):
    return 0.0 if x < low or x > high else 1.0


@kernel
def clamp_gap_ratio(s, i, j, low, high):
    """Return (x_i - x_j)/(s_i - s_j) of x = clamp(s); for equal ones the derivative."""
    gap = s[i] - s[j]
    x = clamp(s, low, high)
    return (x[i] - x[j]) / gap if gap != 0.0 else _unclamped(s[i], low, high)


@kernel
def log_gap_ratio(s, s_new, i, j, share, s_min):
    """Return (s'_i - s'_j)/(s_i - s_j) where the return leaves that share of dev log(lifted(s))."""
    x = lifted(s, s_min)
    z = (x[i] - x[j]) / x[j]
    growth = expm1(share * log1p(z)) / z if z != 0.0 else share
    return growth * s_new[j] / x[j] * lifted_gap_ratio(s, i, j, s_min)


@kernel
def lifted_gap_ratio(s, i, j, s_min):
    """Return (x_i - x_j)/(s_i - s_j) of x = lifted(s)."""
    return clamp_gap_ratio(s, i, j, s_min, inf) if s_min > 0.0 else 1.0
