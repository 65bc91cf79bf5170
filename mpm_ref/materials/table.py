"""The laws and flows by the names of scene files, and what a body must know of its material."""

import inspect
from collections.abc import Callable
from math import sqrt
from typing import NamedTuple

from . import (
    drucker_prager,
    fixed_corotated,
    fixed_corotated_von_mises,
    fluid,
    fluid_projection,
    hencky,
    herschel_bulkley,
    log_neo_hookean,
    neo_hookean,
    no_flow,
    snow_clamp,
    von_mises,
)
from .fixed_corotated import FixedCorotated
from .fluid import Fluid
from .hencky import Hencky
from .log_neo_hookean import LogNeoHookean
from .neo_hookean import NeoHookean
from .no_flow import NoFlow
from .von_mises import Hardening, Softening
from .waves import stiffness


class FlowEntry(NamedTuple):
    """Constructor of a flow from the values of a scene file."""

    build: Callable         # its keyword parameters are those of the scene; `dim` is added
    laws: tuple             # the laws that it is written for


# name in scene files -> function of the scene's parameters
LAWS = {
    "fixed_corotated": fixed_corotated.from_E_nu,
    "hencky": hencky.from_E_nu,
    "neo_hookean": neo_hookean.from_E_nu,
    "log_neo_hookean": log_neo_hookean.from_E_nu,
    "fluid": fluid.build,
}

SOLIDS = FixedCorotated, Hencky, NeoHookean, LogNeoHookean

# Return maps in log strain are for Hencky; fixed corotated has its own von Mises (X-cross-13). One
# exception: the public code of NSF's cake softens in log strain and takes the stress from fixed
# corotated elasticity, which then does not end on the yield surface.
FLOWS = {
    "none": FlowEntry(no_flow.build, (tuple,)),         # every law
    "drucker_prager": FlowEntry(drucker_prager.build, (Hencky,)),
    "von_mises": FlowEntry(von_mises.build, (Hencky,)),
    "von_mises_hardening": FlowEntry(von_mises.build_hardening, (Hencky,)),
    "von_mises_softening": FlowEntry(von_mises.build_softening, (Hencky, FixedCorotated)),
    "herschel_bulkley": FlowEntry(herschel_bulkley.build, (NeoHookean,)),
    "fluid_projection": FlowEntry(fluid_projection.build, (Fluid,)),
    "snow_clamp": FlowEntry(snow_clamp.build, SOLIDS),
    "fixed_corotated_von_mises": FlowEntry(fixed_corotated_von_mises.build, (FixedCorotated,)),
}


class Material(NamedTuple):
    """An elastic law with a flow, and what follows for the state of a body."""

    law: NamedTuple
    flow: NamedTuple

    @property
    def needs_F(self):
        """True if particles carry the deformation gradient, else its determinant J."""
        return not (isinstance(self.law, Fluid) and isinstance(self.flow, NoFlow))

    @property
    def has_history(self):
        """True if each particle carries a yield stress of its own."""
        return isinstance(self.flow, Hardening | Softening)

    @property
    def initial_y(self):
        """Yield stress of every particle at the start [Pa]; 0 where none is carried."""
        return self.flow.tau_y if self.has_history else 0.0

    def wave_speed(self, rho):
        """Return the speed of the compression wave at rest [m/s], for the density at rest
        [kg/m^d].
        """
        return sqrt(stiffness(self.law) / rho)


def recovers(law):
    """Return whether the law turns inverted matter, det F <= 0, back: fixed corotated does.

    A fluid's energy is finite there too, but no run should go on with a fluid of J <= 0.
    """
    return isinstance(law, FixedCorotated)


def make_law(name, /, **parameters):
    """Return the law of that name, e.g. `make_law("hencky", E=1e6, nu=0.2)` [Pa].

    Raises ValueError for an unknown name, an unknown, missing or impossible parameter.
    """
    build = _entry(LAWS, "law", name)
    return _built(build, f"law {name!r}", parameters)


def make_flow(name, law, dim, /, **parameters):
    """Return the flow of that name on a law, in dim = 2 or 3 dimensions.

    E.g. `make_flow("drucker_prager", law, 3, friction_angle=25)` (degrees). Raises ValueError for
    an unknown name, a law it is not written for, an unknown, missing or impossible parameter.
    """
    build, laws = _entry(FLOWS, "flow", name)
    if dim not in (2, 3):
        raise ValueError(f"flow {name!r}: dim = {dim}: expected 2 or 3")
    if not isinstance(law, laws):
        raise ValueError(
            f"flow {name!r} on the law {type(law).__name__}: expected "
            f"{' or '.join(c.__name__ for c in laws)}, which it is written for"
        )
    return _built(build, f"flow {name!r}", parameters, dim)


def _entry(table, kind, name):
    try:
        return table[name]
    except KeyError:
        raise ValueError(f"{kind} {name!r}: expected one of {', '.join(table)}") from None


def _built(build, what, parameters, dim=None):
    """Return `build(**parameters)` after a check of the names; ValueError says `what` it was
    for.
    """
    signature = inspect.signature(build).parameters
    accepted = {name: p.default is p.empty for name, p in signature.items()}
    given = dict(parameters)
    if accepted.pop("dim", False):
        given["dim"] = dim
    unknown = [name for name in parameters if name not in accepted]
    missing = [name for name, required in accepted.items() if required and name not in parameters]
    if unknown or missing:
        raise ValueError(f"{what}: " + "; ".join(_complaints(unknown, missing, accepted)))
    try:
        return build(**given)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None


def _complaints(unknown, missing, accepted):
    if unknown:
        known = ", ".join(accepted) or "none"
        yield f"unknown parameter {', '.join(unknown)}; its parameters are: {known}"
    if missing:
        yield f"missing parameter {', '.join(missing)}"
