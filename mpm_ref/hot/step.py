"""The implicit step: backward Euler by minimisation, between the transfers of the explicit step.

Particles to grid (HOT-sec3.1-seq) as in `explicit`; the increment dv of the nodes' velocities that
minimises the incremental potential (HOT-eq1) under the conditions; grid to particles; deformation
and, lagged, the return map.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from ..core.grid import Storage
from ..core.state import Grid
from ..explicit import Stepper, damp, deform_body, gather, scatter
from .constraints import Restraint
from .methods import Options, minimise
from .multigrid.geometric import Geometric, conditions_at
from .norms import characteristic_norms
from .potential import Potential
from .report import together
from .system import System, Unknowns, free_part, unknowns_of

REVISIONS = 20      # of the planes that bear, at most: after that, nodes stay as they are


class Pose(NamedTuple):
    """What an implicit step has to solve."""

    grid: Grid                      # mass and momentum
    unknowns: Unknowns
    potential: Potential
    kappa: np.ndarray               # (n,)  characteristic norms [kg m/s]
    restraint: Restraint | None
    falling: np.ndarray             # (d,)  dt g [m/s]
    geometric: Geometric            # its grids of greater spacings


class ImplicitStepper(Stepper):
    """Advances bodies by implicit steps; used as `explicit.Stepper`. After each step `report` is
    the solver's (see `report`).
    """

    implicit = True             # the particles' speed alone bounds a step (HOT-cfl, HOT-dt)

    def __init__(self, scheme, dx, dim, gravity, conditions=None, options=None):
        super().__init__(scheme, dx, dim, gravity, conditions)
        self.options = Options() if options is None else options
        self.report = None
        self.revisions = 0          # of the planes that bear, in the last solve
        check_scheme(scheme)

    def start(self, bodies):
        """As `explicit.Stepper.start`. Raises ValueError for body forces of particles."""
        super().start(bodies)
        for body in bodies:
            if body.particles.b.ndim == 2:
                raise ValueError(f"body {body.name!r} has body forces b of its own: expected "
                                 "gravity alone with an implicit integrator")

    def step(self, bodies, t, dt):
        """Advance from time t [s] by dt [s]; returns the grid, which holds m and the new v.
        Changes the bodies in place. Raises ValueError unless dt > 0.
        """
        if not 0.0 < dt < np.inf:
            raise ValueError(f"dt = {dt}: expected a positive, finite time in s")
        pose = self.pose(bodies, t, dt)
        put(pose.grid, pose.unknowns, pose.unknowns.v + self.solve(pose))
        for body in bodies:
            gather(body, pose.grid, self.scheme, dt)
            deform_body(body, dt)
            damp(body, self.scheme)
        return pose.grid

    def driven(self, bodies, t, dt):
        """Largest speed [m/s] that moving parts give to nodes with mass from time t to t + dt."""
        if self.conditions is None or not self.conditions.moves:
            return 0.0
        grid = scatter(bodies, self.storage, self.scheme, 0.0)
        return self.conditions.fastest(grid, t + dt, dt)

    def pose(self, bodies, t, dt):
        """`Pose` of the step from time t [s] by dt [s]; the bodies stay as they are."""
        grid = scatter(bodies, self.storage, self.scheme, 0.0)
        unknowns, restraint = self._restrained(grid, self.conditions, t, dt)
        stencil = self.scheme.stencil
        potential = Potential(bodies, unknowns, stencil, dt, self.gravity)
        kappa = characteristic_norms(bodies, unknowns, stencil, dt)
        geometric = Geometric(potential, partial(self.coarser, bodies, t, dt))
        return Pose(grid, unknowns, potential, kappa, restraint, dt * self.gravity, geometric)

    def coarser(self, bodies, t, dt, level):
        """`Unknowns` of the step on a grid of 2^level dx, whose nodes meet the conditions anew; a
        separate plane bears there as it does before the solve.
        """
        factor, conditions = 2**level, self.conditions
        storage = Storage(factor * self.dx, self.scheme.stencil, len(self.gravity))
        grid = scatter(bodies, storage, self.scheme, 0.0)
        conditions = None if conditions is None else conditions_at(conditions, factor)
        return self._restrained(grid, conditions, t, dt)[0]

    def _restrained(self, grid, conditions, t, dt):
        """The unknowns of a grid under conditions, and their `Restraint` or None."""
        unknowns = unknowns_of(grid)
        if conditions is None:
            return unknowns, None
        restraint = Restraint(conditions, grid, unknowns, t + dt, dt)
        return restraint.begin(unknowns, unknowns.v + dt * self.gravity), restraint

    def system(self, pose, near=None):
        """`System` of a pose, for its conditions as they stand. It starts where the options say,
        or at what they admit that is nearest to an increment near (n, d) [m/s].
        """
        q, start = pose.unknowns, pose.unknowns.dv0
        if near is not None:
            start = start + free_part(q, near - start)
        elif self.options.start == "gravity":
            start = start + free_part(q, np.broadcast_to(pose.falling, start.shape))
        return System(pose.potential, q, pose.kappa, start, pose.geometric)

    def solve(self, pose):
        """The increment dv (n, d) [m/s] of a pose; separate planes come and go in between, and each
        solve goes on from the one before.
        """
        dv, reports = None, []
        for self.revisions in range(REVISIONS):
            solution = minimise(self.system(pose, dv), self.options)
            reports.append(solution.report)
            self.report, dv = together(reports), solution.dv
            if not (pose.restraint and self._revised(pose, dv)):
                return dv
            pose = pose._replace(unknowns=pose.restraint.applied(pose.unknowns))
        self.revisions = REVISIONS
        self.report = self.report._replace(converged=False, why=f"separate planes still came or "
                                           f"went after {REVISIONS} solves")
        return dv

    def _revised(self, pose, dv):
        return pose.restraint.revise(pose.unknowns.v + dv, pose.potential.evaluate(dv)[1])


def put(grid, unknowns, v):
    """The velocities v (n, d) of the nodes into the grid; the old ones too where it keeps them."""
    d = grid.m.ndim
    at = np.flatnonzero(unknowns.number.reshape(-1) >= 0)
    if grid.v_old.ndim > 1:
        grid.v_old.reshape(-1, d)[at] = unknowns.v
    nodes = grid.v.reshape(-1, d)
    nodes[:] = 0.0
    nodes[at] = v


def check_scheme(scheme):
    """Raise ValueError where a scheme has no implicit form."""
    if scheme.transfer == "mls":
        raise ValueError("transfer = 'mls' with an implicit integrator: expected 'apic', 'pic' or "
                         "'flip', whose force is the gradient of an energy of the nodes; write "
                         "scheme = { transfer = \"apic\" }")
    if scheme.mass_eps or scheme.gravity_on_empty:
        raise ValueError("mass_eps and gravity_on_empty belong to explicit NCLaw scenes: leave "
                         "them out with an implicit integrator")
