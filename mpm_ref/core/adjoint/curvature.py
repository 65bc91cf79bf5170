"""Second derivatives of the weights w_ip with respect to the position of the particle."""

from ..jit import kernel


@kernel
def curvatures(f, stencil):
    """N''(f - k) for the nodes k = 0 .. degree of one axis; see `spline.slopes`."""
    if len(stencil) == 2:
        return 0.0, 0.0
    elif len(stencil) == 3:
        return 1.0, -2.0, 1.0
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
