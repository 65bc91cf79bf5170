"""The stable time step of the explicit method: three bounds, each reported.

* advective: no part of a particle's support crosses more than a cell, dt u + dt^2 |g| < dx with
  u = |v_p| + |L_p| dx (degree + 1)/2;
* elastic: no wave crosses more than a cell, dt c_p < dx, c_p that of `materials.waves` at the
  current stretches; of a law without derivatives, as a learned one, that at rest;
* single particle: the oscillation of a particle through nodes that it has to itself must not grow
  [BaiSchroeder2022]. With K its largest modulus, 2 mu + d lam at rest, 1/D of `inverse_inertia`,

      S_p = max_a sum_i (dw_ip/dx_a)^2/w_ip,

  dt^2 V0 K/m times S, S - 1/(2 D) and 1/D is at most 2, 2 and 4 for PIC and FLIP, APIC and
  MLS-MPM; RPIC damping z makes it S - (1 - z)/(2 - z)/D and 2 (2 - z) for the last two, and
  relaxation 16/9 the 2 of APIC.
  It is the limit of an isolated particle, and no cloud of particles has a smaller one: derived in
  docs/explanation/timestep.md. Linear splines have no such limit (S is infinite at a node); for
  them m_p/m_i with the nodes' masses stands for 1/w_ip, and the bound is necessary, not sufficient.

A viscosity has no bound of its own: return maps relax the elastic stress, and that never shortens
the stable step (docs/explanation/timestep.md).
"""

from math import inf
from typing import NamedTuple

import numpy as np

from .core.jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .core.law import kirchhoff_hat
from .core.precision import with_rounded_spacing
from .core.spectral import svd
from .core.stencil import (
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
from .core.tensor import dot, fill, lin, mat, mul, mv, total_of, vec
from .explicit import scatter
from .materials.principal import dpk1_hat
from .materials.waves import moduli_at_rest, wave_modulus


class TooLarge(ValueError):
    """A fixed time step is past its bound, or an adaptive one so small that time stands still."""


class TimeStep(NamedTuple):
    """Bounds of dt [s], each by itself."""

    advective: float
    elastic: float
    single_particle: float

    @property
    def dt(self):
        """The smallest bound; NaN if any of them is."""
        return float(np.min(self))

    def sentence(self):
        """Return the bounds in words, without those that are infinite."""
        terms = [(name, bound) for name, bound in self._asdict().items() if bound != inf]
        return ", ".join(f"{name.replace('_', ' ')} {bound:.3g} s" for name, bound in terms)


@kernel
def dilation_modulus(s, law):
    """Return K = d(tr tau)/dh / d under s -> s (1 + h) [Pa]: (s . A s + tr tau)/d, A =
    dpk1_hat(s).
    """
    return (dot(s, mv(dpk1_hat(s, law), s)) + total_of(kirchhoff_hat(s, law))) / len(s)


@kernel
def largest_modulus(s, law):
    """Return K [Pa] of the single-particle bound: no velocity gradient meets more stiffness.

    In principal axes the tangent falls into the matrix s_i s_j A_ij, here bounded by its rows, and
    the pairs of `wave_modulus`. At rest it is 2 mu + d lam, that of uniform dilation.
    """
    A = dpk1_hat(s, law)
    K = max(wave_modulus(s, law), dilation_modulus(s, law))
    for i in range(len(s)):
        row = 0.0
        for j in range(len(s)):
            row += abs(s[i] * s[j] * A[i][j])
        K = max(K, row)
    return K


@kernel
def _solid_moduli(F, law, wave, largest, like, bounds):
    for p in range(bounds[0], bounds[1]):
        _, s, _, _ = svd(mat(F, p, like))
        wave[p] = wave_modulus(s, law)
        largest[p] = largest_modulus(s, law)


@kernel
def _fluid_moduli(J, law, wave, largest, like, bounds):
    for p in range(bounds[0], bounds[1]):
        s = fill(J[p] ** (1.0 / len(like)), like)
        wave[p] = wave_modulus(s, law)
        largest[p] = largest_modulus(s, law)


@parallel_if_many
def _all_solid_moduli(F, law, wave, largest, like):
    for c in prange(CHUNKS):
        _solid_moduli(F, law, wave, largest, like, chunk(c, len(wave)))


@parallel_if_many
def _all_fluid_moduli(J, law, wave, largest, like):
    for c in prange(CHUNKS):
        _fluid_moduli(J, law, wave, largest, like, chunk(c, len(wave)))


def moduli(body):
    """Return the modulus of the fastest wave and `largest_modulus` of a body's particles, two (N,)
    [Pa].
    """
    q = body.particles
    like = tuple(range(q.x.shape[1]))
    if type(body.law) in moduli_at_rest.methods:
        return tuple(np.full(len(q.x), K) for K in moduli_at_rest(body.law))
    wave, largest = np.empty(len(q.x)), np.empty(len(q.x))
    run = _all_fluid_moduli if q.F.ndim == 1 else _all_solid_moduli
    run(q.F, body.law, wave, largest, like)
    return wave, largest


@kernel
def _coupling(particles, grid, stencil, S, bounds):
    """Compute S_p of the module's text [1/m^2]."""
    d = grid.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s = locate(vec(particles.x, p, d), grid, stencil)
        w, dw = weights_per_axis(s, stencil), slopes_per_axis(s, stencil)
        sums = fill(0.0, d)
        for c in range(columns(s, stencil)):
            k = column(c, stencil, d)
            for l in range(len(stencil)):
                w_ip = product(k, l, w)
                if w_ip > 0.0:
                    own = share(w_ip, particles.m[p], grid.m[node(base, k, l)], stencil)
                    dw_ip = gradient(k, l, w, dw, grid.dx)
                    sums = lin(1.0, sums, own, mul(dw_ip, dw_ip))
        S[p] = largest_of(sums)


@kernel
def share(w_ip, m_p, m_i, stencil):
    """Return 1/w_ip; for linear splines m_p/m_i."""
    if len(stencil) == 2:
        return m_p / m_i
    else:
        return 1.0 / w_ip


@kernel
def largest_of(a):
    """Return the largest entry of a vector."""
    most = a[0]
    for a_i in a:
        most = max(most, a_i)
    return most


@parallel_if_many
def _couplings(particles, grid, stencil, S):
    for c in prange(CHUNKS):
        _coupling(particles, grid, stencil, S, chunk(c, len(S)))


def single_particle_limit(particles, grid, scheme, stiffness):
    """Return the smallest dt limit of any particle's own oscillation [s]; stiffness (N,) is V0_p
    K_p / m_p.
    """
    own, kept = inverse_inertia(grid.dx, scheme.stencil), 1.0 - scheme.rpic
    if scheme.transfer == "mls":
        return _limit(stiffness * own, 2.0 * (1.0 + kept))
    S = np.empty(len(particles.x))
    _couplings(particles, grid, scheme.stencil, S)
    memory = kept / (1.0 + kept) * own if scheme.transfer == "apic" else 0.0
    return _limit(stiffness * (S - memory), 16.0 / 9.0 if scheme.relaxation else 2.0)


def _limit(load, most):
    """Return the largest dt with dt^2 load <= most for every particle; infinite where there is no
    load.
    """
    with np.errstate(divide="ignore"):
        return float(np.sqrt(most / np.max(load)))


def stable_dt(bodies, stepper):
    """Return the `TimeStep` of the bodies' state under a `Stepper`'s scheme and grid spacing. An
    implicit step is bound by its particles' speed alone (HOT-cfl).
    """
    scheme = stepper.scheme
    if stepper.implicit:
        particles = (body.particles for body in bodies)
        bounds = [advective(q, stepper.dx, 0.0, stepper.gravity) for q in particles]
        return TimeStep(min(bounds), inf, inf)
    if scheme.degree == 1:
        grid = scatter(bodies, stepper.storage, scheme, 0.0)
    else:
        grid = stepper.storage.cover([body.particles.x for body in bodies])
    grid = with_rounded_spacing(grid)
    bounds = [_body_dt(body, grid, scheme, stepper.gravity) for body in bodies]
    return TimeStep(*map(float, np.min(bounds, axis=0)))


def _body_dt(body, grid, scheme, gravity):
    q, dx = body.particles, grid.dx
    wave, largest = moduli(body)
    return (
        advective(q, dx, 0.5 * (scheme.degree + 1) * dx, gravity),
        _limit(np.maximum(wave, 0.0) * q.V0 / q.m, dx**2),
        single_particle_limit(q, grid, scheme, np.maximum(largest, 0.0) * q.V0 / q.m),
    )


def advective(particles, dx, distance, gravity):
    """Return the largest dt in which no particle, nor a point at a distance [m] that moves with its
    velocity gradient, crosses a cell: dt u + dt^2 g = dx with the largest such speed u.
    """
    q = particles
    u = np.sqrt(np.einsum("pa,pa->p", q.v, q.v))
    if distance:
        u += distance * np.sqrt(np.einsum("pab,pab->p", q.L, q.L))
    u, g = float(np.max(u)), float(np.linalg.norm(gravity))
    if q.b.ndim == 2:
        g += float(np.sqrt(np.max(np.einsum("pa,pa->p", q.b, q.b))))
    return float(np.float64(2.0 * dx) / (u + np.sqrt(u * u + 4.0 * g * dx))) if u or g else inf


def refuse(dt, terms, step=0):
    """Raise `TooLarge` if dt is past the bound, with all finite terms. Once the run has begun, only
    the elastic and single-particle terms refuse it: whether particles cross cells is watched
    itself.
    """
    if dt > (terms.dt if step == 0 else min(terms.elastic, terms.single_particle)):
        raise TooLarge(
            f"dt = {dt:.6g} s is past the stable time step {terms.dt:.6g} s, {dt / terms.dt:.4g} "
            f"times it, at step {step} "
            f"({terms.sentence()}); "
            'take a smaller dt, or let the scene say unstable = "allow"'
        )
