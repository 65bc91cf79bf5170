"""Principal logarithmic strain eps = log s, and what the return maps do with it."""

from math import exp, inf, log

from ..core.jit import kernel
from ..core.law import plastic_strain
from ..core.tensor import fill, lin, norm, number, total_of
from .stretches import positive_stretches


@kernel
def log_strain(s):
    """Return eps_i = log s_i; all NaN where one s_i is not > 0."""
    return _log(positive_stretches(s))


@kernel
def _log(s):
    if len(s) == 2:
        return log(s[0]), log(s[1])
    else:
        return log(s[0]), log(s[1]), log(s[2])


@kernel
def stretches(eps):
    """Return s_i = exp eps_i."""
    if len(eps) == 2:
        return exp(eps[0]), exp(eps[1])
    else:
        return exp(eps[0]), exp(eps[1]), exp(eps[2])


@kernel
def deviator(x):
    """Return the deviator x - mean(x); in 2D that of the plane (X-cross-15)."""
    return lin(1.0, x, -total_of(x) / number(len(x), x[0]), fill(1.0, x))


@kernel
def clamp(s, low, high):
    """Return each s_i brought into [low, high]; NaN stays NaN."""
    if len(s) == 2:
        return _clamp(s[0], low, high), _clamp(s[1], low, high)
    else:
        return _clamp(s[0], low, high), _clamp(s[1], low, high), _clamp(s[2], low, high)


@kernel
def _clamp(x, low, high):
    if x < low:
        return low
    else:
        return high if x > high else x


@kernel
def lifted(s, s_min):
    """Return s_i < s_min lifted to s_min, where s_min > 0."""
    return clamp(s, s_min, inf) if s_min > 0.0 else s


@kernel
def radial_return(s, y, dt, law, flow):
    """Return the singular values after the return, s inside the surface, 1 where all strain is
    released; and y.

        eps <- eps - dgamma eps_hat / |eps_hat|           (NSF-F3, NSF-F4, NCLAW-eq16, NCLAW-eq19)

    dgamma is that of `plastic_strain`. NSF-F4 prints |eps| for the denominator |eps_hat|, with
    which the return misses the surface.
    """
    eps = log_strain(lifted(s, flow.s_min))
    eps_hat = deviator(eps)
    size = norm(eps_hat)
    dgamma, y, released = plastic_strain(number(len(s), size), total_of(eps), size, y, law, flow)
    if released:
        return fill(1.0, s), y
    elif dgamma > 0.0:
        return stretches(lin(1.0, eps, -dgamma / size, eps_hat)), y
    else:
        return s, y
