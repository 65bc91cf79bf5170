"""Reduced fields: positions and stresses of points as functions of r latent coordinates xhat.

Any object with the members of `DeformationMap` is a map of positions g(X; xhat) (LDM-eq14); one
with those of `ReducedField` also has a stress, and is what `step` advances. Where plasticity or
fracture makes F meaningless, stress and affine field are separate fields (NSF):

    network              perceptrons: LDM's map, and NSF's three fields
    pod                  POD modes as a map: linear, the baseline of nonlinear ones
    numbered             POD modes by the numbers of points, also of several bodies
    pod_fields           NSF's three fields as sums of POD modes
    polynomial_manifold  a map on POD modes of which some are polynomials of the others
    elastic              the stress of a map's own F, on any of the maps above
    affine               all affine deformations, exactly
    joint_latent         latent coordinates of position and stress together

Points are given as the field needs them: a map that is continuous in space takes positions at rest,
X (n, d) [m]; a field with values at the points of its data alone takes their numbers (n,).
"""

from typing import Protocol, runtime_checkable


@runtime_checkable
class DeformationMap(Protocol):
    """Positions of material points, x = g(X; xhat).

    Optional, for the rates of LDM: velocity(points, xhat, vhat), dg/dxhat vhat (n, d) [m/s].
    Optional: single(), the map in single precision.
    """

    dim: int        # number of axes d
    r: int          # number of latent coordinates

    def place(self, points, xhat):
        """Return x (n, d) [m] at latent coordinates xhat (r,)."""

    def derivatives(self, points, xhat):
        """Return x (n, d), F = dg/dX (n, d, d) or None where there is none, and dg/dxhat
        (n, d, r).
        """


@runtime_checkable
class ReducedField(DeformationMap, Protocol):
    """Positions and stresses of material points.

    Optional, for the transfer APIC: affine(points, xhat), the affine velocity field C (n, d, d)
    [1/s]. Optional, for `quadrature.lagrangian.NumberedPoints`: near(xhat, x, distance), numbers of
    all points that may be within a distance [m], by the largest axis, of one of the positions x
    (m, d).
    """

    def stress(self, points, xhat, F=None):
        """Return the Kirchhoff stress (n, d, d) [Pa]; F (n, d, d): where `derivatives` has given it
        already.
        """
