"""Latent coordinates of position and stress together, for materials whose stress depends on their
history. An extension: the paper leaves path dependence for later work (section 7).

A metal that is sheared to and fro passes every position with several stresses. NSF's fields, whose
latent coordinates are fitted to positions alone, give a mean of them. Here latent coordinates are
the coefficients of modes that both share, and are fitted to both:

    [(x_p - X_p) / x_0, tau_p / tau_0] = sum_k xhat_k [U_kp / x_0, T_kp / tau_0] + the rest
    min_y sum_p |g(X_p; y) - x_p|^2 / x_0^2 + w^2 |h(X_p; y) - tau_p|^2 / tau_0^2

x_p are the samples' positions after the step, as in NSF. tau_p are their stresses after it, by the
material's law: the elastic strain of Hencky's law follows from the stress, the velocity gradient
changes it over the step, and the return map limits it. So samples, and they alone, need singular
values and a return map again.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...body import Body, particles_at
from ...explicit import deform_body, gather
from ...materials import Hardening, Hencky, Softening
from ..projection import Projected, project_position
from ..quadrature.lagrangian import NumberedPoints
from ..step import ReducedStepper
from ..symmetric import values
from .pod_fields import PodFields, cells, fit_modal_field, modes_of
from .radial_basis import through

SHARE = 0.3         # of the stress in the modes, over that of the displacement
WEIGHT = 0.03       # of the stress in the inversion; with more it outweighs the motion of a step


class Scale(NamedTuple):
    """Units of positions and stresses: root mean squares over the snapshots."""

    x: float            # of a displacement's value [m]
    tau: float          # of a stress's value [Pa]


def joint(histories, sizes, size, share=SHARE):
    """Return the `PodFields` of `Histories` whose latent coordinates are shared by displacement and
    stress, the latent coordinates (s, k + 1, r) of the snapshots, and their `Scale`; size [m] of
    blocks. Raises ValueError for more modes than the snapshots hold, and where nothing moves or
    nothing is stressed.
    """
    s, levels, n, d = histories.x.shape
    u = (histories.x - histories.X).reshape(s * levels, -1)
    tau = histories.tau.reshape(s * levels, -1)
    scale = Scale(*(float(np.sqrt(np.mean(a.astype(float) ** 2))) for a in (u, tau)))
    if not min(scale) > 0.0:
        raise ValueError(f"snapshots with displacements of {scale.x:g} m and stresses of "
                         f"{scale.tau:g} Pa, root mean square: expected some of both")
    V, xhat = modes_of(np.hstack([u / scale.x, share * tau / scale.tau]), sizes.r, "r")
    U = scale.x * V[:n * d]
    unit = np.full(sizes.r, np.sqrt(np.mean(xhat[:, 0] ** 2)))

    def fit(a):
        return through(xhat, a, unit, sizes.smoothing)

    bend = None
    if sizes.modes > sizes.r:
        rest, a = modes_of(u - xhat @ U.T, sizes.modes - sizes.r, "modes")
        U, bend = np.hstack([U, rest]), fit(a)
    U = np.ascontiguousarray(U.reshape(n, d, -1))
    tau = fit_modal_field(histories.tau, sizes.tau, "tau", fit)
    C = fit_modal_field(histories.C, sizes.C, "C", fit) if sizes.C else None
    fields = PodFields(histories.X, U, bend, tau, C, np.zeros(0), cells(histories.X, U, size))
    return fields, xhat.reshape(s, levels, -1), scale


class Stacked(NamedTuple):
    """Position and stress of each point as one vector, in the units of a `Scale`."""

    fields: PodFields
    scale: Scale
    weight: float

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.fields.r

    def vectors(self, x, tau):
        """Return positions x (m, d) [m] and stresses tau (m, d, d) [Pa] as vectors (m, d + d (d +
        1)/2).
        """
        return np.hstack([x / self.scale.x, self.weight * values(tau) / self.scale.tau])

    def place(self, points, xhat):
        """Return the vectors (m, d + d (d + 1)/2) of points of these numbers."""
        return self.vectors(self.fields.place(points, xhat), self.fields.stress(points, xhat))

    def derivatives(self, points, xhat):
        """Return the vectors, None, and the vectors' derivatives (m, d + d (d + 1)/2, r)."""
        x, _, G = self.fields.derivatives(points, xhat)
        tau = self.fields.tau
        H = tau.modes[points] @ tau.coefficients.slope(xhat)
        both = np.concatenate([G / self.scale.x, self.weight * H / self.scale.tau], axis=1)
        return self.vectors(x, self.fields.stress(points, xhat)), None, both


@dataclass(frozen=True)
class JointInversion:
    """Projection on latent coordinates whose positions and stresses of the samples are nearest to
    those after the step (NSF-eq10 with stress beside position).
    """

    scale: Scale
    weight: float = WEIGHT

    def __call__(self, field, latent, samples, trial, dt, weights=None):
        """Return `Projected` from the `Kinematics` of samples and their trial particles. Raises
        ValueError for samples with weights.
        """
        if weights is not None:
            raise ValueError("samples with weights: expected samples that all count the same; "
                             "weights are made for positions alone")
        both = Stacked(field, self.scale, self.weight)
        fit = project_position(both, samples.points, both.vectors(trial.x, trial.tau), latent.xhat)
        return Projected(fit.y, None, fit)


@dataclass
class JointStepper(ReducedStepper):
    """Advance latent coordinates of position and stress, for a body of one law and flow. Raises
    ValueError for a law other than Hencky's, or a flow with a history of its own.
    """

    law: object = None
    flow: object = None

    def __post_init__(self):
        super().__post_init__()
        if not isinstance(self.law, Hencky) or isinstance(self.flow, Hardening | Softening):
            raise ValueError(f"joint latent coordinates of {type(self.law).__name__} with "
                             f"{type(self.flow).__name__}: expected Hencky's law, whose stress "
                             "determines the elastic strain, and a flow without hardening or "
                             "softening")

    def on_grid(self, body, samples, t, dt):
        """Return the samples' particles after a step on the grid, their stress carried along by the
        material's own law.
        """
        x, start = samples.particles.x, body.particles      # the samples are its first points
        m = len(x)
        trial = particles_at(x, start.v[:m], start.m[:m], start.V0[:m], transfer="apic")
        trial.F[:] = stretch_of(start.tau[:m], self.law)
        carried = Body("samples", trial, self.law, self.flow, samples.id)
        gather(carried, self.grid(body, samples, t, dt), self.scheme, dt)
        deform_body(carried, dt)
        return trial


def joint_stepper(fields, material, problem, scale, weight=WEIGHT):
    """Return the `JointStepper` of `joint` fields of `MaterialPoints` of the first body of a
    problem, with its grid, gravity, conditions and material.
    """
    body, dx, degree = problem.bodies[0], problem.dx, problem.scheme.degree
    return JointStepper(fields, NumberedPoints(material.m, material.V0, dx, degree),
                        JointInversion(scale, weight), problem.gravity, problem.conditions, "apic",
                        "difference", material.v, law=body.law, flow=body.flow)


def stretch_of(tau, law):
    """Return the elastic left stretches (m, d, d) whose Kirchhoff stresses by Hencky's law are tau
    (m, d, d) [Pa]: exp of (tau - lam tr(tau) / (2 mu + d lam) I) / (2 mu).
    """
    d = tau.shape[1]
    pressure = law.lam * np.trace(tau, axis1=1, axis2=2) / (2.0 * law.mu + d * law.lam)
    strain = (tau - pressure[:, None, None] * np.eye(d)) / (2.0 * law.mu)
    size, axes = np.linalg.eigh(strain)
    return np.einsum("pij,pj,pkj->pik", axes, np.exp(size), axes)
