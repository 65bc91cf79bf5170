"""The lever a_ip of a pair, with which the force is f_i = -sum_p V0_p tau_p a_ip.

    gradient form   a_ip = dw_ip                da_ip/dx_p = d^2 w_ip/dx_p^2
    MLS form        a_ip = D^-1 w_ip r_ip       da_ip/dx_p = D^-1 (r_ip dw_ip^T - w_ip I)

Names as in `transfer`. The base node of a particle is piecewise constant and has no derivative.
Where a weight has a kink (degree 1), or its slope has one (gradient form, degree 2), the
derivative is that from above.
"""

from typing import NamedTuple

from ..jit import by_type, kernel
from ..stencil import arm, gradient, locate, product, slopes_per_axis, weights_per_axis
from ..tensor import dot, lin, mv
from .curvature import curvatures_per_axis, hessian


class Splines(NamedTuple):
    """Those of one particle, per axis."""

    s: tuple        # offset from the base node [cells]
    w: tuple        # weights N
    dw: tuple       # N'
    ddw: tuple      # N''
    dx: float       # spacing [m]


class GradientForm(NamedTuple):
    """Forces over dt with the lever dw_ip."""

    dt: float       # [s]


class MlsForm(NamedTuple):
    """Forces over dt with the lever D^-1 w_ip r_ip."""

    dt: float       # [s]
    D_inv: float    # [1/m^2]


lever = by_type("lever")                # (k, l, splines, form) -> a_ip
lever_bar = by_type("lever_bar")        # (k, l, splines, q, form) -> (da_ip/dx_p)^T q


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


lever.method(GradientForm, _slope)
lever.method(MlsForm, _moment)
lever_bar.method(GradientForm, _slope_bar)
lever_bar.method(MlsForm, _moment_bar)


@kernel
def around(x, grid, stencil):
    """Base node of the point x, and its `Splines`."""
    base, s = locate(x, grid, stencil)
    w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
    return base, Splines(s, w, dw, curvatures_per_axis(s, stencil), grid.dx)
