"""Figure 18: a soft box at rest whose deformation gradients are random diagonal matrices.

The paper prints their entries, in [0.7, 1.3], and a tolerance of 1e-7; the scene is not in the
release. Our choice: a cube of 1 m, rho 1000 kg/m^3, E 1e5 Pa, 8 particles per cell in a regular
pattern, no gravity, nothing that holds it, and a first step of a frame, 1/24 s, as nothing moves
yet. Poisson's ratio decides how hard it is. "Some diagonal matrix" may be one for the box or one
for each particle: both are here.
"""

import numpy as np

from mpm_ref.scene import Body, Box, Limits, Material, Regular, Scene, Scheme, build

LOW, HIGH = 0.7, 1.3                    # of the stretches
VARIANTS = ("body", "particle")         # that share a matrix
FRAME = 1.0 / 24.0                      # [s]


def stretched(variant, dx=0.125, seed=0, nu=0.3, E=1e5):
    """`Problem` of the first step, with a matrix per `variant`, E in Pa.

    Raises ValueError for a variant that is not in `VARIANTS`.
    """
    if variant not in VARIANTS:
        raise ValueError(f"variant = {variant!r}: expected one of {VARIANTS}")
    problem = build(box(dx, nu, E))
    F = problem.bodies[0].particles.F
    rows = len(F) if variant == "particle" else 1
    F[:] = F * np.random.default_rng(seed).uniform(LOW, HIGH, (rows, 1, 3))
    return problem


def box(dx, nu, E):
    """The box as a `Scene`, still without deformation."""
    body = Body(
        name="box", density=1000.0, shape=Box(lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 1.0)),
        sampling=Regular(per_cell=2), material=Material(law="fixed_corotated", E=E, nu=nu))
    return Scene(
        title="Stretched box", dim=3, dx=dx, body=(body,), cfl=0.6, longest=FRAME, steps=1,
        integrator="hot", scheme=Scheme(transfer="apic"),
        limits=Limits(cfl=100.0))       # the first step, from rest, crosses cells
