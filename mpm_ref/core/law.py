"""The names of a constitutive law. A law is a NamedTuple of parameters; its file gives these
functions.

`F` is a deformation gradient (d x d), `s` its singular values (d), `J` its determinant; stresses
in Pa. Laws register their functions here (`kirchhoff.method(FixedCorotated, ...)`), so that loops
over particles, which know no material, can call `kirchhoff(F, law)` and be compiled for the law
they are handed.
"""

from .jit import by_type

psi = by_type("psi")                      # (F, law) -> energy per rest volume [J/m^d]
pk1 = by_type("pk1")                      # (F, law) -> P = dpsi/dF
kirchhoff = by_type("kirchhoff")          # (F, law) -> tau = P F^T
dpk1 = by_type("dpk1")                    # (F, dF, law) -> dP = (d2psi/dF2) : dF
kirchhoff_hat = by_type("kirchhoff_hat")  # (s, law) -> principal Kirchhoff stresses
psi_volume = by_type("psi_volume")        # (J, law) -> energy density of a law that needs J only
pressure = by_type("pressure")            # (J, law) -> isotropic tau of a law that needs J only
project = by_type("project")              # (s, y, dt, law, flow) -> s, y after the return map
intact = by_type("intact")                # (y, flow) -> 1.0, or 0.0 where the material has failed
