"""No return map: the material is elastic (NCLAW-eq13)."""

from typing import NamedTuple

from ..core.jit import kernel


class NoFlow(NamedTuple):
    """Elasticity: a return map that is the identity."""


def build():
    """Return the flow; it has no parameter."""
    return NoFlow()


@kernel
def project(s, y, dt, law, flow):
    """Return s, y as they are."""
    return s, y


@kernel
def project_vjp(state, bars, dt, law, flow):
    """Return the bars as they are; none of the parameters; all of the deviator is left."""
    return bars, no_bars(law), 1.0


@kernel
def no_bars(law):
    """Return a 0 for every modulus of the law."""
    if len(law) == 1:
        return (0.0,)
    else:
        return 0.0, 0.0


@kernel
def gap_ratio(s, s_new, i, j, share, flow):
    """Return the constant 1."""
    return 1.0


@kernel
def never_fails(y, flow):
    """Return 1: `intact` of every flow without damage."""
    return 1.0


intact = never_fails
