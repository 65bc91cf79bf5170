"""Fluid projection, F <- J^(1/d) I but for a rotation: keeps J, drops the shear (NCLAW-eq21).

NCLaw drops the rotation too, to which its fluid law is blind. Exponent 1/2 in 2D (X-cross-15).
"""

from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import fill, lin, number, total_of
from .no_flow import never_fails
from .stretches import inverse, volume


class FluidProjection(NamedTuple):
    """Every shear strain flows."""


def build():
    """Return the flow; it has no parameter."""
    return FluidProjection()


@kernel
def project(s, y, dt, law, flow):
    """Return J^(1/d) each, y as it is; s as it is unless J > 0."""
    J = volume(s)
    return (fill(J ** (1.0 / number(len(s), J)), s) if J > 0.0 else s), y


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars before it; that of lam, 0; no deviator is left. All as it is unless J > 0."""
    s, (s_bar, y_bar) = state[0], bars
    J = volume(s)
    if J > 0.0:
        d_log_J = total_of(s_bar) * J ** (1.0 / len(s)) / len(s)
        return (lin(d_log_J, inverse(s), 0.0, s), y_bar), (0.0,), 0.0
    else:
        return bars, (0.0,), 1.0


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return (s'_i - s'_j)/(s_i - s_j)."""
    return share


intact = never_fails
