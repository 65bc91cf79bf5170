"""The shape gradient a_ip of a pair, with which the force is f_i = -sum_p V0_p tau_p a_ip.

    gradient form   a_ip = dw_ip                da_ip/dx_p = d^2 w_ip/dx_p^2
    MLS form        a_ip = D^-1 w_ip r_ip       da_ip/dx_p = D^-1 (r_ip dw_ip^T - w_ip I)

Names as in `transfer`. The base node of a particle is piecewise constant and has no derivative.
Where a weight has a kink (degree 1), or its slope has one (gradient form, degree 2, GIMP), the
derivative is that from above.
"""

from typing import NamedTuple

from ..gimp import Gimp, gimp_curvatures
from ..jit import by_type, kernel
from ..stencil import arm, gradient, locate, product, slopes_per_axis, weights_per_axis
from ..tensor import dot, lin, mv


class ParticleSplines(NamedTuple):
    """Spline weights of one particle and their derivatives, per axis."""

    s: tuple        # offset from the base node [cells]
    w: tuple        # weights N
    dw: tuple       # N'
    ddw: tuple      # N''
    dx: float       # spacing [m]


class GradientForm(NamedTuple):
    """Forces over dt with the shape gradient dw_ip."""

    dt: float       # [s]


class MlsForm(NamedTuple):
    """Forces over dt with the shape gradient D^-1 w_ip r_ip."""

    dt: float       # [s]
    D_inv: float    # [1/m^2]


shape_gradient = by_type("shape_gradient")              # (k, l, splines, form) -> a_ip
# (k, l, splines, q, form) -> (da_ip/dx_p)^T q
shape_gradient_bar = by_type("shape_gradient_bar")


@kernel
def _slope(k, l, splines, form):
    return gradient(k, l, splines.w, splines.dw, splines.dx)


@kernel
def _slope_bar(k, l, splines, q, form):
    return mv(hessian(k, l, splines), q)


@kernel
def _moment(k, l, splines, form):
    r_ip = arm(k, l, splines.s, splines.dx)
    return lin(form.D_inv * product(k, l, splines.w), r_ip, 0.0, r_ip)


@kernel
def _moment_bar(k, l, splines, q, form):
    r_ip, dw_ip = arm(k, l, splines.s, splines.dx), _slope(k, l, splines, form)
    w_ip = product(k, l, splines.w)
    return lin(form.D_inv * dot(r_ip, q), dw_ip, -form.D_inv * w_ip, q)


shape_gradient.method(GradientForm, _slope)
shape_gradient.method(MlsForm, _moment)
shape_gradient_bar.method(GradientForm, _slope_bar)
shape_gradient_bar.method(MlsForm, _moment_bar)


@kernel
def around(x, grid, stencil):
    """Base node of the point x, and its `ParticleSplines`."""
    base, s = locate(x, grid, stencil)
    w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
    return base, ParticleSplines(s, w, dw, curvatures_per_axis(s, stencil), grid.dx)


# second derivatives of the weights w_ip with respect to the position of the particle

three_curvatures = by_type("three_curvatures")          # (f, stencil) -> N'' of three nodes


@kernel
def _quadratic_curvatures(f, stencil):
    return 1.0, -2.0, 1.0


three_curvatures.method(tuple, _quadratic_curvatures)
three_curvatures.method(Gimp, gimp_curvatures)


@kernel
def curvatures(f, stencil):
    """N''(f - k) for the nodes k = 0 .. degree of one axis; see `spline.slopes`."""
    if len(stencil) == 2:
        return 0.0, 0.0
    elif len(stencil) == 3:
        return three_curvatures(f, stencil)
    else:
        return 2.0 - f, 3.0 * f - 5.0, 4.0 - 3.0 * f, f - 1.0


@kernel
def curvatures_per_axis(s, stencil):
    """ddw[a][k] = N''(s_a - k)."""
    if len(s) == 2:
        return curvatures(s[0], stencil), curvatures(s[1], stencil)
    else:
        return curvatures(s[0], stencil), curvatures(s[1], stencil), curvatures(s[2], stencil)


@kernel
def hessian(k, l, splines):
    """d^2 w_ip / dx_p^2 of node (k, l) [1/m^2], from `splines` with w, dw, ddw per axis and dx."""
    w, dw, ddw, c = splines.w, splines.dw, splines.ddw, splines.dx**-2
    if len(k) == 2:
        a, b = k[0], l
        xy = c * dw[0][a] * dw[1][b]
        return (c * ddw[0][a] * w[1][b], xy), (xy, c * w[0][a] * ddw[1][b])
    else:
        a, b = k[0], k[1]
        xy = c * dw[0][a] * dw[1][b] * w[2][l]
        xz = c * dw[0][a] * w[1][b] * dw[2][l]
        yz = c * w[0][a] * dw[1][b] * dw[2][l]
        return (
            (c * ddw[0][a] * w[1][b] * w[2][l], xy, xz),
            (xy, c * w[0][a] * ddw[1][b] * w[2][l], yz),
            (xz, yz, c * w[0][a] * w[1][b] * ddw[2][l]),
        )
