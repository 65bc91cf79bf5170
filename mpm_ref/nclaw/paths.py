"""One-element paths: material points whose deformation is prescribed, step by step.

    F_trial = G_{k+1} G_k^-1 F,   F = returned(F_trial),   tau = kirchhoff(F)

G is the whole deformation, F what elasticity keeps of it. A learned return map acts once in a step,
so that what comes of a path depends on how many steps it takes.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..explicit import deform_body, initial_stress
from .bodies import gradients, points, stresses


class Path(NamedTuple):
    """What is prescribed, at time levels 0 .. k, and what of the stress is looked at."""

    name: str
    strain: np.ndarray      # (k + 1,) the first is 0
    G: np.ndarray           # (k + 1, d, d)
    reads: np.ndarray       # (d, d); the stress is reads : tau
    symbol: str             # of that stress


class Course(NamedTuple):
    """What becomes of a point along a path."""

    F: np.ndarray           # (k + 1, d, d)
    tau: np.ndarray         # (k + 1, d, d) [Pa]


class Kind(NamedTuple):
    """Directions of a family of paths, G = I + strain A."""

    A: np.ndarray           # (d, d)
    reads: np.ndarray       # (d, d)
    symbol: str


def kinds(d):
    """{name: `Kind`} in d dimensions: along one axis, in simple shear, alike in all directions."""
    first, shear = np.zeros((2, d, d))
    first[0, 0] = shear[0, 1] = 1.0
    return {"uniaxial": Kind(first, first, "tau_xx"), "shear": Kind(shear, shear, "tau_xy"),
            "volumetric": Kind(np.eye(d), np.eye(d) / d, "tr(tau)/d")}


def monotone(d, strain, steps):
    """`Path`s from rest to strains of at most this size, in so many steps each: stretched and
    compressed along one axis, sheared, swollen and compressed in all directions.
    """
    ends = {"uniaxial": (strain, -strain), "shear": (strain,), "volumetric": (strain, -strain)}
    return [path(name, kind, (0.0, end), steps) for name, kind in kinds(d).items()
            for end in ends[name]]


def cycles(d, strain, steps):
    """`Path`s that load and unload, in so many steps from turn to turn: compressed along one axis
    and back; sheared, back, the other way and back.
    """
    known = kinds(d)
    return [path("uniaxial cycle", known["uniaxial"], (0.0, -strain, 0.0), steps),
            path("shear cycle", known["shear"], (0.0, strain, 0.0, -strain, 0.0), steps)]


def path(name, kind, turns, steps):
    """The `Path` from turn to turn (strains), in so many even steps each."""
    legs = [np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(turns)]
    strain = np.concatenate([turns[:1], *legs])
    G = np.eye(len(kind.A)) + strain[:, None, None] * kind.A
    return Path(name, strain, G, kind.reads, kind.symbol)


def course(law, flow, path, dt):
    """`Course` of a law and a flow along a path, in steps of dt [s]."""
    point, d = points(law, flow, path.G[:1]), path.G.shape[1]
    initial_stress(point)
    rows = [(gradients(point)[0].copy(), stresses(point)[0].copy())]
    for before, after in pairwise(path.G):
        point.particles.L[0] = (after @ np.linalg.inv(before) - np.eye(d)) / dt
        deform_body(point, dt)
        rows.append((gradients(point)[0].copy(), stresses(point)[0].copy()))
    return Course(*(np.array(rows) for rows in zip(*rows, strict=True)))


def looked_at(path, course):
    """The stress (k + 1,) [Pa] that a path looks at; NaN where it is not finite."""
    finite = np.isfinite(course.tau).all(axis=(1, 2))
    found = np.full(len(finite), np.nan)
    found[finite] = np.einsum("ij,kij->k", path.reads, course.tau[finite])
    return found
