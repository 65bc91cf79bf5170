"""Fluid projection, F <- J^(1/d) I but for a rotation: keeps J, drops the shear (NCLAW-eq21).

NCLaw drops the rotation too, to which its fluid law is blind. Exponent 1/2 in 2D (X-cross-15).
"""

from typing import NamedTuple

from ..core.jit import kernel
from ..core.tensor import fill
from .no_flow import never_fails
from .stretches import volume


class FluidProjection(NamedTuple):
    """Every shear strain flows."""


def build():
    """The flow; it has no parameter."""
    return FluidProjection()


@kernel
def project(s, y, dt, law, flow):
    """J^(1/d) each, y as it is; s as it is unless J > 0."""
    J = volume(s)
    return (fill(J ** (1.0 / len(s)), s) if J > 0.0 else s), y


intact = never_fails
