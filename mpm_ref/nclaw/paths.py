"""One-element paths: material points whose deformation is prescribed, step by step.

    F_trial = G_{k+1} G_k^-1 F,   F = returned(F_trial),   tau = kirchhoff(F)

G is the total deformation, F its elastic part. A learned return map acts once in a step, so that
the response to a path depends on the number of steps.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..explicit import deform_body, initial_stress
from .bodies import deformation_gradients, kirchhoff_stresses, material_points


class StrainPath(NamedTuple):
    """A prescribed deformation at time levels 0 .. k, and the component of stress to record."""

    name: str
    strain: np.ndarray      # (k + 1,) the first is 0
    G: np.ndarray           # (k + 1, d, d)
    reads: np.ndarray       # (d, d); the stress is reads : tau
    symbol: str             # of that stress


class PathResponse(NamedTuple):
    """The elastic deformation gradient and the stress of a point along a path."""

    F: np.ndarray           # (k + 1, d, d)
    tau: np.ndarray         # (k + 1, d, d) [Pa]


class PathFamily(NamedTuple):
    """The direction of a family of paths, G = I + strain A, and the stress to record."""

    A: np.ndarray           # (d, d)
    reads: np.ndarray       # (d, d)
    symbol: str


def path_families(d):
    """Return {name: `PathFamily`} in d dimensions: along one axis, in simple shear, volumetric."""
    first, shear = np.zeros((2, d, d))
    first[0, 0] = shear[0, 1] = 1.0
    return {"uniaxial": PathFamily(first, first, "tau_xx"),
            "shear": PathFamily(shear, shear, "tau_xy"),
            "volumetric": PathFamily(np.eye(d), np.eye(d) / d, "tr(tau)/d")}


def monotone(d, strain, steps):
    """Return the `StrainPath`s from rest to strains of this size: extension and compression along
    one axis, shear, expansion and compression in all directions. steps: their number on each path.
    """
    ends = {"uniaxial": (strain, -strain), "shear": (strain,), "volumetric": (strain, -strain)}
    return [path(name, kind, (0.0, end), steps) for name, kind in path_families(d).items()
            for end in ends[name]]


def cycles(d, strain, steps):
    """Return the `StrainPath`s that load and unload: compression along one axis and back; shear,
    back, shear in the opposite direction and back. steps: their number from turn to turn.
    """
    families = path_families(d)
    return [path("uniaxial cycle", families["uniaxial"], (0.0, -strain, 0.0), steps),
            path("shear cycle", families["shear"], (0.0, strain, 0.0, -strain, 0.0), steps)]


def path(name, kind, turns, steps):
    """Return the `StrainPath` through turning points (strains), with `steps` even steps between
    successive ones.
    """
    legs = [np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(turns)]
    strain = np.concatenate([turns[:1], *legs])
    G = np.eye(len(kind.A)) + strain[:, None, None] * kind.A
    return StrainPath(name, strain, G, kind.reads, kind.symbol)


def path_response(law, flow, path, dt):
    """Return the `PathResponse` of a law and a flow along a path, in steps of dt [s]."""
    point, d = material_points(law, flow, path.G[:1]), path.G.shape[1]
    initial_stress(point)
    rows = [(deformation_gradients(point)[0].copy(), kirchhoff_stresses(point)[0].copy())]
    for before, after in pairwise(path.G):
        point.particles.L[0] = (after @ np.linalg.inv(before) - np.eye(d)) / dt
        deform_body(point, dt)
        rows.append((deformation_gradients(point)[0].copy(), kirchhoff_stresses(point)[0].copy()))
    return PathResponse(*(np.array(rows) for rows in zip(*rows, strict=True)))


def path_stress(path, response):
    """Return the stress (k + 1,) [Pa] that a path records; NaN where it is not finite."""
    finite = np.isfinite(response.tau).all(axis=(1, 2))
    stress = np.full(len(finite), np.nan)
    stress[finite] = np.einsum("ij,kij->k", path.reads, response.tau[finite])
    return stress
