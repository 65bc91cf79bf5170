"""The size of a gradient: nodes of soft and stiff matter made comparable (HOT-sec5.2).

    xi_p    = ||dP/dF||_F at F = I                                  stiffness of a law [Pa]
    xi_i    = sum_p w_ip m_p xi_p / sum_p w_ip m_p                  of a node [Pa]
    kappa_i = xi_i ell dt,    ell = 2 d (2 dx)^(d-1)                characteristic impulse [kg m/s]
    g^_i    = g_i / kappa_i,    residual = ||g^||_2 / sqrt(n)       without unit       (HOT-eq9)

ell is the surface of the cube of side 2 dx about a node: 24 dx^2; in 2D the perimeter 8 dx, times
the 1 m of thickness. n counts all nodes with mass, held ones too.
"""

from math import sqrt

import numpy as np

from ..core.jit import kernel, parallel, prange
from ..core.order import slabs_of
from ..core.state import NONE, Grid
from ..core.stencil import column, columns, locate, node, product, weights_per_axis
from ..core.tensor import fill, inner, vec
from ..materials.principal import local


def dot(a, b):
    """Sum of a * b; unlike a product by BLAS the same bits for any number of threads."""
    return float(np.sum(a * b))


def length(a):
    """||a||_2 over all entries."""
    return sqrt(dot(a, a))


def scaled_norm(g, kappa):
    """||g^||_2 / sqrt(n) of g (n, d) and kappa (n,), both in kg m/s (HOT-eq9); 0 for n = 0."""
    return length(g / kappa[:, None]) / sqrt(max(len(g), 1))


@kernel
def squared_stiffness(like, law):
    """xi_p^2 [Pa^2]: squares of the d^2 eigenvalues of d2psi/dF2 at F = I (HOT-sec5.2).

    They are those of A, and a and b for each pair of axes: see `materials.principal`.
    """
    A, pairs = local(fill(1.0, like), law)
    total = inner(A, A)
    for k in range(len(pairs)):
        total += pairs[k][0] * pairs[k][0] + pairs[k][1] * pairs[k][1]
    return total


def rest_stiffness(law, d):
    """xi_p [Pa] of a law in d dimensions.

    For mu and lam at rest: sqrt((d (d + 1)/2 - 1) 4 mu^2 + (2 mu + d lam)^2).
    """
    return sqrt(squared_stiffness((1.0,) * d, law))


def surface(dx, d):
    """ell [m^(d-1)] (HOT-eq9)."""
    return 2 * d * (2.0 * dx) ** (d - 1)


@kernel
def scatter_mass(x, m, grid, stencil, members):
    """m_i += sum_p w_ip m_p, for the particles listed in `members`."""
    d = grid.m.shape
    for p in members:
        base, s = locate(vec(x, p, d), grid, stencil)
        w = weights_per_axis(s, stencil)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                grid.m[node(base, k, l)] += product(k, l, w) * m[p]


@parallel
def _scatter_mass_color(x, m, grid, stencil, slabs, color):
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        scatter_mass(x, m, grid, stencil, slabs.order[slabs.start[a] : slabs.start[a + 1]])


def nodal_mass(body, unknowns, stencil):
    """The body's share of the mass of every unknown node (n,) [kg]."""
    d = unknowns.number.ndim
    grid = Grid(np.zeros(unknowns.number.shape), np.empty((0,) * d + (d,)), NONE, NONE,
                unknowns.origin, unknowns.dx)
    x, m = body.particles.x, body.particles.m
    slabs = slabs_of(x, grid, stencil)
    for color in (0, 1):
        _scatter_mass_color(x, m, grid, stencil, slabs, color)
    return grid.m[unknowns.number >= 0]


def nodal_stiffness(bodies, unknowns, stencil):
    """xi_i (n,) [Pa] of the bodies' particles around every unknown node.

    One body's particles share their law, so that only its mass needs scattering; and not even
    that, where all bodies are equally stiff.
    """
    xi = [rest_stiffness(body.law, unknowns.number.ndim) for body in bodies]
    if min(xi) == max(xi):
        return np.full(len(unknowns.m), xi[0])
    m = [nodal_mass(body, unknowns, stencil) for body in bodies]
    return sum(x * m_b for x, m_b in zip(xi, m)) / sum(m)


def characteristic_norms(bodies, unknowns, stencil, dt):
    """kappa_i (n,) [kg m/s] of every unknown node, for a step dt [s] (HOT-eq9)."""
    ell = surface(unknowns.dx, unknowns.number.ndim)
    return nodal_stiffness(bodies, unknowns, stencil) * ell * dt
