"""Reduced fields: all that a reduced step asks of points, from r latent coordinates xhat.

Any object with the members of `DeformationMap` is a map of positions g(X; xhat) (LDM-eq14); one
with those of `ReducedField` also has a stress, and is what `step` advances. Where plasticity or a
tear leaves F behind, stress and affine field are fields of their own (NSF):

    network              perceptrons: LDM's map, and NSF's three fields
    pod                  POD modes as a map: linear, and the honest baseline
    pod_fields           NSF's three fields as sums of POD modes
    polynomial_manifold  a map with coordinates that follow from others
    elastic              the stress of a map's own F, on any of the maps above
    affine               all affine deformations, exactly
    joint_latent         latent coordinates of position and stress together

How a field names its points is its own: a map that is continuous in space takes positions at rest,
X (n, d) [m]; a field that is known at its data's points alone takes their numbers (n,).
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
        """Return x (n, d), F = dg/dX (n, d, d) or None where it is not known, and dg/dxhat
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
