"""Stress, return map and differential of loose points: arrays of F, without particles or a grid.

F (N, d, d) holds deformation gradients; laws and flows are those of `materials`, by
`materials.make_law` and `make_flow`. `deform_body` takes the same kernels in a step.
"""

from typing import NamedTuple

import numpy as np

from .body import Body, particles_at
from .core.jit import kernel
from .core.law import dpk1, kirchhoff, pk1, psi
from .core.tensor import mat, put_mat
from .explicit import deform_body
from .materials import Material


class Response(NamedTuple):
    """Energy and stresses of N points."""

    psi: np.ndarray     # (N,)       energy per rest volume [J/m^3]
    P: np.ndarray       # (N, d, d)  first Piola-Kirchhoff stress [Pa]
    tau: np.ndarray     # (N, d, d)  Kirchhoff stress P F^T [Pa]


class PlasticResponse(NamedTuple):
    """Points after a return map."""

    F: np.ndarray       # (N, d, d), or J (N,) of a fluid without F
    tau: np.ndarray     # (N, d, d), or (N,)  Kirchhoff stress [Pa]
    y: np.ndarray       # (N,) yield stress [Pa], or (0,) of a flow without history


def response(F, law):
    """Return the `Response` of an elastic law to F (N, d, d). Raises ValueError for another shape.

    Learned laws have no energy: their psi is NaN.
    """
    F = _points("F", F)
    out = Response(np.full(len(F), np.nan), np.empty_like(F), np.empty_like(F))
    like = tuple(range(F.shape[1]))
    _stresses(F, law, out.tau, like)
    if type(law) in pk1.methods:
        _first_stresses(F, law, out.P, like)
    else:
        out.P[:] = out.tau @ np.linalg.inv(F).swapaxes(1, 2)
    if type(law) in psi.methods:
        _energies(F, law, out.psi, like)
    return out


def differential(F, dF, law):
    """Return dP (N, d, d) [Pa], the change of P by dF: (d^2 psi/dF^2) : dF.

    Raises ValueError for other shapes, TypeError for a law without derivatives, as a learned one.
    """
    F, dF = _points("F", F), _points("dF", dF)
    if F.shape != dF.shape:
        raise ValueError(f"dF has shape {dF.shape}: expected that of F, {F.shape}")
    dP = np.empty_like(F)
    _differentials(F, dF, law, dP, tuple(range(F.shape[1])))
    return dP


def return_map(F, law, flow, dt=0.0, y=None):
    """Return the `PlasticResponse` to trial gradients F (N, d, d): F = project(F_trial), and tau.

    dt [s] is the length of the step, which viscous flows need; y (N,) [Pa] the yield stress before
    it, of flows that change it. Arguments stay as they are. Raises ValueError for other shapes, or
    a y that is missing.
    """
    F = _points("F", F)
    n, d, _ = F.shape
    x, ones, material = np.zeros((n, d)), np.ones(n), Material(law, flow)
    q = particles_at(x, x, ones, ones, "pic", fluid=not material.needs_F)
    if material.has_history:
        if np.shape(y) != (n,):
            raise ValueError(f"y has shape {np.shape(y)}: expected ({n},), yield stresses [Pa]")
        q = q._replace(y=np.array(y, dtype=float))
    q.F[:] = F if material.needs_F else np.linalg.det(F)
    deform_body(Body("points", q, law, flow, np.arange(n)), dt)
    return PlasticResponse(q.F, q.tau, q.y)


def _points(name, F):
    F = np.ascontiguousarray(F, dtype=float)
    if F.ndim != 3 or F.shape[1:] not in ((2, 2), (3, 3)):
        raise ValueError(f"{name} has shape {F.shape}: expected (N, 2, 2) or (N, 3, 3)")
    return F


@kernel
def _stresses(F, law, tau, like):
    for p in range(len(F)):
        put_mat(tau, p, kirchhoff(mat(F, p, like), law))


@kernel
def _first_stresses(F, law, P, like):
    for p in range(len(F)):
        put_mat(P, p, pk1(mat(F, p, like), law))


@kernel
def _energies(F, law, energy, like):
    for p in range(len(F)):
        energy[p] = psi(mat(F, p, like), law)


@kernel
def _differentials(F, dF, law, dP, like):
    for p in range(len(F)):
        put_mat(dP, p, dpk1(mat(F, p, like), mat(dF, p, like), law))
