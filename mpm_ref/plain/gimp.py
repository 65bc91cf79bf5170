"""Linear splines averaged over the length of a particle: the weights of uniform GIMP.

    N(u) = (S(u + l) - S(u - l))/(2 l),     S' = T,     T(u) = max(1 - |u|, 0)

u is the position from the node, l the half width of a particle, both in cells [Bardenhagen2004].
"""

import numpy as np


def tent(u):
    """T(u), the linear B-spline about its node; u is an array of any shape."""
    return np.maximum(1 - abs(u), 0)


def tent_integral(u):
    """S(u) = int_-inf^u T, which grows from 0 at u = -1 to 1 at u = 1."""
    u = np.clip(u, -1, 1)
    return np.where(u < 0, (1 + u) ** 2 / 2, 1 - (1 - u) ** 2 / 2)


def averaged(u, per_cell):
    """N(u) of particles of which `per_cell` fill a cell along an axis: 2 l = 1/per_cell."""
    l = 1 / per_cell / 2
    return (tent_integral(u + l) - tent_integral(u - l)) * per_cell


def averaged_slope(u, per_cell):
    """dN/du = (T(u + l) - T(u - l))/(2 l), the derivative of `averaged`."""
    l = 1 / per_cell / 2
    return (tent(u + l) - tent(u - l)) * per_cell
