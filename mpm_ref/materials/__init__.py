"""Constitutive laws: one law per file, the same names in each.

    mu, lam, ...    the parameters, a NamedTuple named as the law
    from_E_nu       (or build) makes it from the parameters of a scene, checked
    psi, pk1, kirchhoff, dpk1                   functions of F: energy, stresses, differential
    kirchhoff_hat, pk1_hat, dpk1_hat, pair      the same in singular values, see `principal`
    stiffness, units                            lam + 2 mu; the law of each modulus alone

with tau = P F^T (NSF-sec3.1-stress); and of the return maps ("flows"): `build`, `project` on
singular values, its adjoint `project_vjp` and `gap_ratio`, `intact`. Elasticity:
`fixed_corotated`, `hencky`, `neo_hookean`, `log_neo_hookean`, `fluid`. Importing this package
registers them all with the names of `core.law`.
"""

from ..core import law
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
    principal,
    snow_clamp,
    von_mises,
    waves,
    yielding_hencky,
)
from .drucker_prager import DruckerPrager
from .fixed_corotated import FixedCorotated
from .fixed_corotated_von_mises import FixedCorotatedVonMises
from .fluid import Fluid
from .fluid_projection import FluidProjection
from .hencky import Hencky
from .herschel_bulkley import HerschelBulkley
from .log_neo_hookean import LogNeoHookean
from .moduli import bulk_modulus, lame, yield_radius
from .neo_hookean import NeoHookean
from .no_flow import NoFlow
from .principal import dpk1_spd
from .snow_clamp import SnowClamp
from .table import FLOWS, LAWS, Material, make_flow, make_law, recovers
from .von_mises import Hardening, Softening, VonMises
from .waves import stiffness, wave_modulus
from .yielding_hencky import YieldingHencky

__all__ = [
    "FLOWS",
    "LAWS",
    "DruckerPrager",
    "FixedCorotated",
    "FixedCorotatedVonMises",
    "Fluid",
    "FluidProjection",
    "Hardening",
    "Hencky",
    "HerschelBulkley",
    "LogNeoHookean",
    "Material",
    "NeoHookean",
    "NoFlow",
    "SnowClamp",
    "Softening",
    "VonMises",
    "YieldingHencky",
    "bulk_modulus",
    "dpk1_spd",
    "lame",
    "make_flow",
    "make_law",
    "recovers",
    "stiffness",
    "wave_modulus",
    "yield_radius",
]

_OF_LAWS = (law.psi, law.pk1, law.kirchhoff, law.dpk1, law.kirchhoff_hat,
            principal.pk1_hat, principal.dpk1_hat, principal.pair, waves.stiffness, law.units)

for _law, _file in ((FixedCorotated, fixed_corotated), (Hencky, hencky),
                    (NeoHookean, neo_hookean), (LogNeoHookean, log_neo_hookean), (Fluid, fluid)):
    for _function in _OF_LAWS:
        _function.method(_law, getattr(_file, _function.__name__))
    law.kirchhoff_vjp.method(_law, principal.kirchhoff_vjp)
law.kirchhoff_of_stretch.method(FixedCorotated, fixed_corotated.kirchhoff_of_stretch)
law.corotated.method(FixedCorotated, fixed_corotated.corotated)
for _function in (principal.pk1_hat, principal.dpk1_hat, principal.pair):
    _function.method(YieldingHencky, getattr(yielding_hencky, _function.__name__))
law.kirchhoff_of_strain.method(Hencky, hencky.kirchhoff_of_strain)
law.strain_moduli.method(Hencky, hencky.strain_moduli)
law.pressure.method(Fluid, fluid.pressure)
law.d_pressure.method(Fluid, fluid.d_pressure)
law.psi_volume.method(Fluid, fluid.psi_volume)

for _flow, _file, _project, _project_vjp, _intact in (
    (VonMises, von_mises, von_mises.project, von_mises.project_vjp, von_mises.intact),
    (Hardening, von_mises, von_mises.project, von_mises.harden_vjp, von_mises.intact),
    (Softening, von_mises, von_mises.project, von_mises.soften_vjp, von_mises.carries),
    *((_flow, _file, _file.project, _file.project_vjp, _file.intact) for _flow, _file in (
        (NoFlow, no_flow),
        (DruckerPrager, drucker_prager),
        (HerschelBulkley, herschel_bulkley),
        (FluidProjection, fluid_projection),
        (SnowClamp, snow_clamp),
        (FixedCorotatedVonMises, fixed_corotated_von_mises),
    )),
):
    law.project.method(_flow, _project)
    law.project_vjp.method(_flow, _project_vjp)
    law.gap_ratio.method(_flow, _file.gap_ratio)
    law.intact.method(_flow, _intact)

for _flow, _plastic_strain in (
    (DruckerPrager, drucker_prager.plastic_strain),
    (VonMises, von_mises.plastic_strain),
    (Hardening, von_mises.harden),
    (Softening, von_mises.soften),
):
    law.plastic_strain.method(_flow, _plastic_strain)
