"""The energy budget of explicit steps: which part of a step changes the mechanical energy by how
much.

The energy of the particles is E = T_p + U + G, kinetic, elastic and gravity; that of the grid T_i =
sum_i m_i |v_i|^2 / 2. Let v_s be the nodal velocities of the scattered momenta, v_f those with
forces and gravity, v_c those with the conditions too. An impulse m_i dv_i does the work
m_i dv_i . (v_s + v_c)/2.

    transfer    (T_i of v_s - T_p before) + (T_p after - T_i of v_c): scatter, gather, damping of C
    walls       work of the impulses m_i (v_c - v_f): moving parts, impacts, friction
    plastic     U after the return map - U of the trial strain
    time        work of the impulses m_i (v_f - v_s) + change of U to the trial strain + change of
                G: the error of the time integration, and the work of the body forces b
    clip        change of E between steps, by the box that keeps the particles; not of the last step

The terms are changes of E and add up to its change in the run, but for round-off. They cost one
more scatter and two evaluations of the energy a step.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .core.grid import update
from .core.jit import total
from .core.stencil import inverse_inertia
from .energy import Energy, elastic, energy
from .explicit import Stepper, damp, deform_body, gather, scatter
from .materials import NoFlow


class Terms(NamedTuple):
    """Changes of the mechanical energy by the parts of steps [J]."""

    transfer: float = 0.0
    walls: float = 0.0
    plastic: float = 0.0
    time: float = 0.0
    clip: float = 0.0


NOTHING = Terms()


@dataclass
class EnergyBudget:
    """The sums of the `Terms` of a run, and its energy [J] at the start and now."""

    terms: Terms = NOTHING
    first: float | None = None
    last: float | None = None

    def begin(self, energy):
        """Note the energy [J] before a step, of the first one as that of the start."""
        if self.first is None:
            self.first = self.last = energy

    def add(self, terms, after):
        """Add the `Terms` of a step that left the energy `after` [J]."""
        self.terms = Terms(*(a + b for a, b in zip(self.terms, terms, strict=True)))
        self.last = after

    @property
    def gap(self):
        """Return the change of the energy less the sum of the terms [J]: round-off."""
        return self.last - self.first - sum(self.terms)

    def facts(self):
        """Return terms, first and last energy and gap as a dict; empty before the first step."""
        if self.first is None:
            return {}
        return {"first": self.first, "last": self.last, **self.terms._asdict(), "gap": self.gap}


class Noted(NamedTuple):
    """The energy and the velocities of a step before its particles change."""

    before: Energy          # of the particles
    v_s: np.ndarray         # (n1, .., nd, d)  velocities of the scattered momenta [m/s]
    v_f: np.ndarray         # (n1, .., nd, d)  with forces and gravity [m/s]


class BudgetStepper(Stepper):
    """A `Stepper` with the same bits that adds each step to an `EnergyBudget`.

    Raises ValueError for bodies whose law has no energy.
    """

    def __init__(self, budget, scheme, dx, dim, gravity, conditions=None):
        super().__init__(scheme, dx, dim, gravity, conditions)
        self.budget = budget
        self.momenta = self.new_storage()
        self.inertia = 1.0 / inverse_inertia(dx, scheme.stencil) if scheme.affine else 0.0

    def start(self, bodies):
        """Start as `Stepper.start`. Raises ValueError for a law without energy."""
        super().start(bodies)
        if not np.isfinite(self.mechanical(bodies).sum):
            raise ValueError("energy budget: a body has no finite energy; expected laws by name, "
                             "since learned stresses need not have one")

    def mechanical(self, bodies):
        """Return the `Energy` of the bodies."""
        return energy(bodies, self.gravity, self.inertia)

    def accelerate(self, bodies, dt):
        """Advance the grid, and note the energy before and the velocities."""
        before = self.mechanical(bodies)
        self.budget.begin(before.sum)
        scattered = scatter(bodies, self.momenta, self.scheme, 0.0)
        update(scattered, np.zeros_like(self.gravity), 0.0, self.scheme.mass_eps)
        grid = super().accelerate(bodies, dt)
        self.noted = Noted(before, scattered.v, grid.v.copy())
        return grid

    def update_particles(self, bodies, grid, dt):
        """Update the bodies, and add the terms of the step to the budget."""
        plastic = 0.0
        for body in bodies:
            gather(body, grid, self.scheme, dt)
            deforming = self.deforming(body, dt)
            trial = trial_elastic(deforming, dt)
            deform_body(deforming, dt)
            damp(body, self.scheme)
            if trial is not None:
                plastic += total(elastic(body)) - trial
        self.add(grid, plastic, self.mechanical(bodies))

    def add(self, grid, plastic, after):
        """Add the step to the velocities of a grid, whose return maps changed the energy by
        `plastic` [J] and which left the `Energy` after.
        """
        before, v_s, v_f = self.noted
        forces = work(grid.m, v_f - v_s, v_s + grid.v)
        walls = work(grid.m, grid.v - v_f, v_s + grid.v)
        self.budget.add(Terms(
            transfer=after.kinetic - before.kinetic - forces - walls, walls=walls, plastic=plastic,
            time=forces + after.elastic - plastic - before.elastic + after.gravity - before.gravity,
            clip=before.sum - self.budget.last), after.sum)


def work(m, dv, v):
    """Return sum_i m_i dv_i . v_i / 2 [J] over nodes: of the impulses m dv, where v is the sum of
    the velocities before and after all impulses.
    """
    return 0.5 * total((m[..., None] * dv * v).sum(axis=-1).reshape(-1))


def trial_elastic(body, dt):
    """Return the elastic energy [J] of F_trial = (I + dt L) F, or None without a return map."""
    q = body.particles
    if isinstance(body.flow, NoFlow) or q.F.ndim == 1:
        return None
    trial = q.F + dt * q.L @ q.F
    return total(elastic(body._replace(particles=q._replace(F=trial))))
