"""The stable time step of the explicit method: four bounds, each reported.

* advective: no part of a particle's support crosses more than a cell, dt (|v_p| + |L_p| dx
  (degree + 1)/2) < dx;
* elastic: no wave crosses more than a cell, dt c_p < dx, c_p that of `materials.waves` at the
  current stretches;
* viscous: none of the shipped laws has an explicit viscosity (Bingham flow is integrated
  implicitly), so it is infinite;
* single particle: a particle's own oscillation through the nodes it reaches must not grow
  [BaiSchroeder2022]. With K its modulus against uniform dilation (2 mu + d lam at rest) and the
  node masses m_i of the whole state,

      S_p = sum_i |dw_ip|^2 m_p/m_i / d,    R_p = sum_i |D^-1 w_ip r_ip|^2 m_p/m_i / d,

  linear stability of the one-particle recurrence gives dt^2 V0 K/m times S, 2 S - R and R at most
  2, 4 and 4 for PIC and FLIP, APIC and MLS-MPM; derived in docs/timestep.md. It is the exact
  limit for an isolated particle.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from .core.jit import CHUNKS, chunk, kernel, parallel, prange
from .core.law import kirchhoff_hat, pressure
from .core.spectral import svd
from .core.stencil import (
    arm,
    column,
    columns,
    gradient,
    inverse_inertia,
    locate,
    node,
    product,
    slopes_per_axis,
    weights_per_axis,
)
from .core.tensor import dot, mat, mv, total_of, vec
from .explicit import scatter
from .materials.principal import dpk1_hat
from .materials.waves import wave_modulus

STRAIN = 1e-5     # of the differences of a fluid's pressure


class TooLarge(ValueError):
    """A fixed time step is past its bound."""


class TimeStep(NamedTuple):
    """Bounds of dt [s], each by itself."""

    advective: float
    elastic: float
    viscous: float
    single_particle: float

    @property
    def dt(self):
        """The smallest bound."""
        return min(self)

    def sentence(self):
        """The bounds in words."""
        terms = self._asdict().items()
        return ", ".join(f"{name.replace('_', ' ')} {bound:.3g} s" for name, bound in terms)


@kernel
def dilation_modulus(s, law):
    """K = d(tr tau)/dh / d under s -> s (1 + h) [Pa]: (s . A s + tr tau)/d, A = dpk1_hat(s)."""
    return (dot(s, mv(dpk1_hat(s, law), s)) + total_of(kirchhoff_hat(s, law))) / len(s)


@kernel
def _solid_moduli(F, law, wave, dilation, like, bounds):
    for p in range(bounds[0], bounds[1]):
        _, s, _, _ = svd(mat(F, p, like))
        wave[p] = wave_modulus(s, law)
        dilation[p] = dilation_modulus(s, law)


@kernel
def _fluid_moduli(J, law, wave, dilation, dim, bounds):
    for p in range(bounds[0], bounds[1]):
        more, less = pressure(J[p] * (1.0 + STRAIN), law), pressure(J[p] * (1.0 - STRAIN), law)
        slope = (more - less) / (2.0 * STRAIN)
        wave[p] = max(slope - pressure(J[p], law), 0.0)
        dilation[p] = dim * slope


@parallel
def _all_solid_moduli(F, law, wave, dilation, like):
    for c in prange(CHUNKS):
        _solid_moduli(F, law, wave, dilation, like, chunk(c, len(wave)))


@parallel
def _all_fluid_moduli(J, law, wave, dilation, dim):
    for c in prange(CHUNKS):
        _fluid_moduli(J, law, wave, dilation, dim, chunk(c, len(wave)))


def moduli(body):
    """Wave and dilation modulus of every particle of a body, two arrays (N,) [Pa]."""
    q = body.particles
    dim = q.x.shape[1]
    wave, dilation = np.empty(len(q.x)), np.empty(len(q.x))
    if q.F.ndim == 1:
        _all_fluid_moduli(q.F, body.law, wave, dilation, dim)
    else:
        _all_solid_moduli(q.F, body.law, wave, dilation, tuple(range(dim)))
    return wave, dilation


@kernel
def _coupling(particles, grid, stencil, S, R, bounds):
    """S_p and R_p of the module's text."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        S[p] = 0.0
        R[p] = 0.0
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                w_ip = product(k, l, w)
                if w_ip > 0.0:
                    share = particles.m[p] / (len(d) * grid.m[node(base, k, l)])
                    dw_ip = gradient(k, l, w, dw, grid.dx)
                    r = arm(k, l, s, grid.dx)
                    S[p] += share * dot(dw_ip, dw_ip)
                    R[p] += share * dot(r, r) * (w_ip * inverse_inertia(grid.dx, stencil)) ** 2


@parallel
def _couplings(particles, grid, stencil, S, R):
    for c in prange(CHUNKS):
        _coupling(particles, grid, stencil, S, R, chunk(c, len(S)))


def single_particle_limit(particles, grid, scheme, stiffness):
    """Smallest dt limit of any particle's own oscillation [s]; stiffness (N,) is V0_p K_p / m_p."""
    S, R = np.empty(len(particles.x)), np.empty(len(particles.x))
    _couplings(particles, grid, scheme.stencil, S, R)
    load, most = {"mls": (R, 4.0), "apic": (2.0 * S - R, 4.0)}.get(scheme.transfer, (S, 2.0))
    return sqrt(most / max(float(np.max(stiffness * load)), 1e-300))


def stable_dt(bodies, stepper):
    """`TimeStep` of the bodies' state under a `Stepper`'s scheme and grid spacing."""
    scheme, dx = stepper.scheme, stepper.dx
    grid = scatter(bodies, stepper.store, scheme, 0.0)
    bounds = [_body_dt(body, grid, scheme, dx) for body in bodies]
    return TimeStep(*(min(terms) for terms in zip(*bounds, strict=True)))


def _body_dt(body, grid, scheme, dx):
    q = body.particles
    wave, dilation = moduli(body)
    reach = 0.5 * (scheme.degree + 1) * dx
    spread = reach * np.sqrt(np.einsum("pab,pab->p", q.L, q.L))
    fastest = np.max(np.linalg.norm(q.v, axis=1) + spread)
    c = sqrt(max(float(np.max(wave * q.V0 / q.m)), 0.0))
    return (
        dx / float(fastest) if fastest > 0.0 else inf,
        dx / c if c > 0.0 else inf,
        inf,
        single_particle_limit(q, grid, scheme, np.maximum(dilation, 0.0) * q.V0 / q.m),
    )


def refuse(dt, terms, step=0):
    """Raise `TooLarge` if dt is past the bound, with all terms."""
    if dt > terms.dt:
        raise TooLarge(
            f"dt = {dt:.6g} s is past the stable time step {terms.dt:.3g} s at step {step} "
            f"({terms.sentence()}); "
            'take a smaller dt, or let the scene say unstable = "allow"'
        )
