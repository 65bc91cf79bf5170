"""The names of a constitutive law. A law is a NamedTuple of parameters; its file gives these
functions.

`F` is a deformation gradient (d x d), `s` its singular values (d), `J` its determinant; stresses
in Pa. Laws register their functions here (`kirchhoff.method(FixedCorotated, ...)`), so that loops
over particles, which know no material, can call `kirchhoff(F, law)` and be compiled for the law
they are handed.

A radial return map takes dgamma dev eps/|dev eps| from the Hencky strain eps = log(F F^T)/2, or
releases all of it. `plastic_strain` returns dgamma, not above 0 inside the surface; y'; and whether
all of eps is released, as it is where the material has failed. Such a flow has the field `s_min`,
the least stretch of a trial F.

The adjoint of a return map s, y -> s', y': `project_vjp` turns bars = (s'_bar, y'_bar) at state =
(s, y) into (s_bar, y_bar), the bars of all parameters (the law's, then the flow's, in the order of
their fields), and the share of the deviator that the return leaves, 1 where nothing flows.
`gap_ratio` is (s'_i - s'_j)/(s_i - s_j) in closed form, its limit included. `units` holds because
tau is linear in the moduli of every law: d tau / d mu is the tau of mu = 1 and no other modulus.
"""

from .jit import by_type

psi = by_type("psi")                      # (F, law) -> energy per rest volume [J/m^3]
pk1 = by_type("pk1")                      # (F, law) -> P = dpsi/dF
kirchhoff = by_type("kirchhoff")          # (F, law) -> tau = P F^T
dpk1 = by_type("dpk1")                    # (F, dF, law) -> dP = (d2psi/dF2) : dF
kirchhoff_of_stretch = by_type("kirchhoff_of_stretch")  # (F, V, law) -> tau of F = V R
kirchhoff_hat = by_type("kirchhoff_hat")  # (s, law) -> principal Kirchhoff stresses
psi_volume = by_type("psi_volume")        # (J, law) -> energy density of a law that needs J only
pressure = by_type("pressure")            # (J, law) -> isotropic tau of a law that needs J only
project = by_type("project")              # (s, y, dt, law, flow) -> s, y after the return map
plastic_strain = by_type("plastic_strain")  # (d, tr eps, |dev eps|, y, law, flow) -> see above
kirchhoff_of_strain = by_type("kirchhoff_of_strain")    # (eps, law) -> tau of a Hencky strain
returned = by_type("returned")            # (F, flow) -> F of a return map that is no function of s
intact = by_type("intact")                # (y, flow) -> 1.0, or 0.0 where the material has failed

# Adjoint: `X_bar` is the gradient of a scalar loss by X. See `core.adjoint.deform`.
kirchhoff_vjp = by_type("kirchhoff_vjp")  # (s, T, law) -> U^T F_bar V, where T = U^T tau_bar U
kirchhoff_bar = by_type("kirchhoff_bar")  # (F, tau_bar, law) -> F_bar of a law of the whole F
returned_bar = by_type("returned_bar")    # (F, F_new_bar, flow) -> F_bar of `returned`
corotated = by_type("corotated")          # (J, law) -> a, p, dp/dJ of tau = a (F F^T - V) + p(J) I
strain_moduli = by_type("strain_moduli")  # (law) -> a, b of tau = a eps + b (tr eps) I
units = by_type("units")                  # (law) -> laws of one modulus 1, the others 0
d_pressure = by_type("d_pressure")        # (J, law) -> d pressure / dJ
project_vjp = by_type("project_vjp")      # (state, bars, dt, law, flow) -> bars, parameters, share
gap_ratio = by_type("gap_ratio")          # (s, s_new, i, j, share, flow) -> see above
