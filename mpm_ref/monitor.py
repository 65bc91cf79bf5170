"""When a run has become unstable: the bounds, and the sentence that says where, when and why."""

from dataclasses import dataclass

import numpy as np

from .body import filled
from .core.law import psi
from .energy import Energy, energy
from .materials import stiffness
from .materials.learned.guard import is_guarded
from .materials.learned.strain_range import describe_bounds, describe_strains, farthest

CHECK = 20      # steps between checks, so that a broken bound is reported well within 100 steps
REST = 1e-6     # a strain taken for none: less energy than it stores is round-off


class Unstable(RuntimeError):
    """A run broke a bound: attributes reason, step, t, body, particle, cfl, J, energy say which,
    where and when, advice what may help.
    """

    def __init__(self, reason, **where):
        self.reason = reason
        self.__dict__.update(where)
        super().__init__(
            f"unstable at step {self.step}, t = {self.t:.6g} s: {reason}; body {self.body!r}, "
            f"particle {self.particle}: {self.finite_values()}; "
            + (self.advice if self.step else "the run cannot start from this state")
        )

    def finite_values(self):
        """Return the CFL number, J and energy in words, without those that are not finite."""
        words = {f"CFL number {self.cfl:.3g}": self.cfl, f"J = {self.J:.3g}": self.J,
                 f"energy of the run {self.energy:.6g} J": self.energy}
        finite = [word for word, value in words.items() if np.isfinite(value)]
        return ", ".join(finite) or "nothing of it is finite"


@dataclass(frozen=True)
class Limits:
    """Limits of a healthy run.

    cfl: cells that a particle may cross in one step; J: smallest and largest volume ratio (a law
    that recovers from inversion may go below the smallest); growth: mechanical energy that may
    appear from nothing, relative to the energy that was available, beyond the `swing`.
    """

    cfl: float = 1.0
    J: tuple = (1e-3, 1e3)
    growth: float = 0.5


@dataclass(frozen=True)
class Account:
    """Mechanical energy at the start of a run, and what round-off may add to it [J]."""

    start: Energy
    noise: float

    def allowed(self, now, growth):
        """Return the largest energy still credible: the start's, plus `growth` times what could
        have become motion by now, namely the start's kinetic and elastic energy and the height lost
        since.
        """
        released = max(self.start.gravity - now.gravity, 0.0)
        available = self.start.kinetic + self.start.elastic + released
        return self.start.sum + growth * available + self.noise

    def changed(self, energy, sign, noise):
        """Return the account of a run into which an `Energy` came (sign = 1) or from which it went
        (-1), with the noise [J] of the particles that carry it.
        """
        start = Energy(*(a + sign * b for a, b in zip(self.start, energy, strict=True)))
        return Account(start, self.noise + noise)


def account(problem, bodies):
    """Return the `Account` of a run's first state; None where moving conditions or body forces of
    particles put in energy that it could not know, or a law has no energy.
    """
    driven = any(b.particles.b.ndim > 1 or type(b.law) not in psi.methods for b in bodies)
    if driven or (problem.conditions is not None and getattr(problem.conditions, "moves", True)):
        return None
    return Account(energy(bodies, problem.gravity, problem.inertia),
                   noise_of(problem, bodies) + 1e-300)


def noise_of(problem, bodies):
    """Return what round-off may add to the energy of bodies [J]."""
    mass = sum(float(b.particles.m.sum()) for b in bodies)
    noise = 1e-6 * mass * float(np.linalg.norm(problem.gravity)) * problem.dx
    if problem.scheme.precision == "single":
        noise += sum(rounding_of_heights(b.particles, problem.gravity) for b in bodies)
    return noise + sum(REST**2 * stiffness(b.law) * float(b.particles.V0.sum()) for b in bodies)


def rounding_of_heights(particles, gravity):
    """Return the sum of the rounding errors of m g . x, at most one of each particle [J]."""
    q, eps = particles, float(np.finfo(particles.x.dtype).eps)
    return eps * float(np.abs(q.m[:, None] * q.x * gravity).sum())


def runs_away(problem, state, dt):
    """Return whether a velocity has a component past the CFL limit, or NaN: a cheap test after
    every step, before the grid follows such a particle. A step of no length passes no limit.
    """
    if dt == 0.0:
        return False
    most = problem.limits.cfl * problem.dx / dt
    velocities = (body.particles.v for body in filled(state.bodies))
    return not all(-most <= v.min() and v.max() <= most for v in velocities)


def swing(dt, bound):
    """Return the mechanical energy that symplectic Euler may show in excess, as a share of the true
    one.

    Of a vibration it keeps H - (dt/2) dU/dt, where |(dt/2) dU/dt| <= r H with r = dt/bound, so that
    H itself swings between its smallest value and (1 + r)/(1 - r) times that. Near the bound, and
    past it, where nothing is kept, r is taken for 0.9.
    """
    r = min(dt / bound, 0.9)
    return 2.0 * r / (1.0 - r)


def speed(particles):
    """Return |v_p| (N,) [m/s]."""
    return np.sqrt(np.einsum("pa,pa->p", particles.v, particles.v))


def volume_ratio(particles):
    """Return J = det F (N,)."""
    return particles.F if particles.F.ndim == 1 else np.linalg.det(particles.F)


@np.errstate(invalid="ignore", over="ignore")      # what is not finite is said below
def check(problem, state, dt):
    """Raise `Unstable` if the state breaks a limit; NaN breaks all of them."""
    for body in state.bodies:
        low, high = problem.limits.J
        J = volume_ratio(body.particles)
        low = -high if problem.may_invert(body) else low
        if is_guarded(body.law):            # it reads no J of a point that is out of its training
            low, high = -np.inf, np.inf
        _stop_where(problem, state, body, dt, ~((low <= J) & (J <= high)),
                    f"J is outside [{low:g}, {high:g}]")
        cfl = speed(body.particles) * (dt / problem.dx)
        astray = ~(np.isfinite(cfl) & np.isfinite(body.particles.x).all(axis=1))
        _stop_where(problem, state, body, dt, astray, "a position or velocity is not finite")
        _stop_where(problem, state, body, dt, ~(cfl <= problem.limits.cfl),
                    f"a particle crosses more than {problem.limits.cfl:g} dx in a step")
    if state.account is not None and filled(state.bodies):
        now = energy(state.bodies, problem.gravity, problem.inertia)
        growth = problem.limits.growth + swing(dt, state.bound)
        allowed = state.account.allowed(now, growth)
        if not now.sum <= allowed:
            raise lost(problem, state, dt, f"energy exceeds {allowed:.6g} J")


def _stop_where(problem, state, body, dt, broken, reason):
    """Raise for the first particle of the mask, if there is one."""
    if broken.any():
        raise unstable(problem, state, body, int(np.argmax(broken)), dt, reason)


def lost(problem, state, dt, reason):
    """Return an `Unstable` for a reason that concerns the run as a whole: its fastest particle is
    named.
    """
    body = max(filled(state.bodies), key=lambda b: speed(b.particles).max())
    return unstable(problem, state, body, int(np.argmax(speed(body.particles))), dt, reason)


def advice(problem, solve, body):
    """Return advice for a run whose last implicit step, if it was one, has the report `solve`, and
    in which this body broke a bound.
    """
    if body.name in problem.strain_bounds:
        p, strains, out = farthest(body.particles.F, problem.strain_bounds[body.name])
        if out > 0.0:
            return learned_law_advice(problem, body, int(body.id[p]), strains)
    if solve is None or solve.converged:
        return "take a smaller dt, or look at the last checkpoint"
    options, key = problem.solver, "eps"
    if options is not None and solve.iterations >= options.max_iterations:
        key = "max_iterations"
    elif options is not None and options.displacement_tolerance > 0.0:
        key = "displacement_tolerance"
    return f"give the solver a larger `{key}`, or take a smaller dt"


def learned_law_advice(problem, body, p, strains):
    """Return advice for a run whose particle p has strains beyond the training of its law."""
    guard = ("" if is_guarded(body.law) else
             "let its material say guard = true, which cuts strains to those of training, or ")
    return (f"the learned law of {body.name!r} has particle {p} at {describe_strains(strains)}, "
            "outside its training, which had "
            f"{describe_bounds(problem.strain_bounds[body.name])}: {guard}train on a run that "
            "strains as much")


def unstable(problem, state, body, p, dt, reason):
    """Return an `Unstable` with the reason and the state of particle p of a body."""
    return Unstable(
        reason,
        advice=advice(problem, state.solve, body),
        step=state.step,
        t=state.t,
        body=body.name,
        particle=int(body.id[p]),
        cfl=float(speed(body.particles)[p] * dt / problem.dx),
        J=float(volume_ratio(body.particles)[p]),
        energy=energy(state.bodies, problem.gravity, problem.inertia).sum,
    )
