"""The input of a run in memory: bodies, scheme, conditions, clock."""

from dataclasses import dataclass, field

import numpy as np

from .body_contact import ContactStepper, check_contacts
from .core.stencil import inverse_inertia
from .energy_budget import BudgetStepper, EnergyBudget
from .explicit import Scheme, Stepper
from .hot.methods import SolverOptions
from .hot.step import ImplicitStepper
from .materials import recovers
from .monitor import Limits
from .streams import check_streams


@dataclass(frozen=True)
class Clock:
    """The times of a run's steps, frames and end.

    dt [s] is fixed, or None: then `cfl` times the stable time step (see `timestep`), at most
    `longest` [s]. The run ends after `steps` steps or at time `end` [s], whichever is given; it
    shows a frame every `every` steps, or every `interval` seconds.
    """

    dt: float | None = None
    cfl: float = 0.5
    steps: int | None = None
    end: float | None = None
    every: int | None = None
    interval: float | None = None
    longest: float = np.inf

    def __post_init__(self):
        if (self.steps is None) == (self.end is None):
            raise ValueError(f"steps = {self.steps}, end = {self.end}: give one of the two")
        if self.every is not None and self.interval is not None:
            raise ValueError(f"every = {self.every}, interval = {self.interval}: give at most one")
        for name in ("dt", "cfl", "steps", "end", "every", "interval"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise ValueError(f"{name} = {value}: expected a positive, finite number")
        if not self.longest > 0.0:
            raise ValueError(f"longest = {self.longest}: expected a positive time step")
        if self.dt is not None and self.interval is not None and self.interval < self.dt:
            raise ValueError(f"interval = {self.interval}: expected at least dt = {self.dt}")


@dataclass(frozen=True)
class Problem:
    """Initial state and rules of a run, for one run: it changes the arrays of the bodies."""

    bodies: tuple                       # of Body
    dx: float                           # grid spacing [m]
    clock: Clock
    gravity: np.ndarray                 # (d,) acceleration [m/s^2]
    scheme: Scheme = field(default_factory=Scheme)
    conditions: object = None           # with apply(grid, t, dt); see core.boundary
    clip: tuple | None = None           # (low, high), (d,) each: box that keeps the particles
    limits: Limits = field(default_factory=Limits)
    allow_unstable: bool = False        # run on although dt is past its bound
    title: str = ""
    source: str = ""                    # canonical text of the scene, "" if built in Python
    integrator: str = "explicit"        # or "implicit"
    solver: SolverOptions | None = None     # of an implicit step; None: HOT's
    strain_bounds: dict = field(default_factory=dict)   # {body: strains of its laws' training}
    budget: EnergyBudget | None = None  # to which an explicit run adds its steps
    contacts: tuple = ()                # of BodyContact between bodies
    sources: tuple = ()                 # of streams.ParticleSource, from which particles enter
    sinks: tuple = ()                   # of streams.ParticleSink, where they leave

    def __post_init__(self):
        if not self.bodies:
            raise ValueError("bodies = (): expected at least one body")
        if self.clock.dt is None and self.clock.cfl > 1.0 and not self.allow_unstable:
            raise ValueError(
                f"cfl = {self.clock.cfl}: expected at most 1, the bound of the time step; past it "
                "a run must say that it may be unstable"
            )
        if self.budget is not None and self.integrator != "explicit":
            raise ValueError(f"energy budget with the integrator {self.integrator!r}: expected "
                             "'explicit'")
        self._check_contacts()
        check_streams(self)

    def _check_contacts(self):
        if not self.contacts:
            return
        check_contacts(self.contacts, [body.name for body in self.bodies], self.scheme)
        if self.integrator != "explicit":
            raise ValueError(f"contacts with the integrator {self.integrator!r}: expected "
                             "'explicit', since their forces have no potential")
        if self.budget is not None:
            raise ValueError("energy budget with contacts of bodies: it has no term for their "
                             "work; expected a run without it")

    def stepper(self):
        """Return a new stepper of the integrator. Raises ValueError for one that does not exist."""
        what = self.scheme, self.dx, self.dim, self.gravity, self.conditions
        if self.budget is not None:
            return BudgetStepper(self.budget, *what)
        if self.contacts:
            return ContactStepper(self.contacts, self.scheme, self.dx, self.gravity,
                                  self.conditions)
        if self.integrator == "explicit":
            return Stepper(*what)
        if self.integrator == "implicit":
            return ImplicitStepper(*what, self.solver)
        raise ValueError(f"integrator = {self.integrator!r}: expected 'explicit' or 'implicit'")

    @property
    def inertia(self):
        """D of the affine motion [m^2] (`core.stencil`); 0 where no affine field is carried."""
        affine = self.scheme.affine
        return 1.0 / inverse_inertia(self.dx, self.scheme.stencil) if affine else 0.0

    def may_invert(self, body):
        """Return whether the body's law recovers from det F <= 0."""
        return recovers(body.law)

    @property
    def dim(self):
        """Number of space dimensions d."""
        return self.bodies[0].particles.x.shape[1]
