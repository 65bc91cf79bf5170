"""No return map: the material is elastic (NCLAW-eq13)."""

from typing import NamedTuple

from ..core.jit import kernel


class NoFlow(NamedTuple):
    """The identity."""


def build():
    """The flow; it has no parameter."""
    return NoFlow()


@kernel
def project(s, y, dt, law, flow):
    """s, y as they are."""
    return s, y


@kernel
def never_fails(y, flow):
    """1: `intact` of every flow without damage."""
    return 1.0


intact = never_fails
