"""The implicit step: backward Euler by minimisation, between the transfers of the explicit step.

Particles to grid (HOT-sec3.1-seq) as in `explicit`; the increment dv of the nodes' velocities that
minimises the incremental potential (HOT-eq1) under the conditions; grid to particles; deformation
and, lagged, the return map.
"""

from dataclasses import replace
from functools import partial
from math import inf
from typing import NamedTuple

import numpy as np

from ..core.grid import Storage
from ..core.heap import keep_freed_memory
from ..core.mls_slopes import mls_stencil
from ..core.state import Grid
from ..explicit import Stepper, scatter
from .constraints import ActiveSet
from .methods import SolverOptions, minimise
from .multigrid.geometric import CoarseGrids, coarse_conditions
from .norms import characteristic_norms
from .potential import Potential
from .report import combined_report
from .return_map import check_return_map
from .system import System, Unknowns, free_part, unknowns_of

MAX_UPDATES = 20      # of the active set; after that, nodes stay as they are
LOAD_UPDATES = 40     # ... and of the loads of friction: stiff blocks in a corner took up to 26
FRICTION_TOLERANCE = 1e-3   # of the displacement in a step with friction [dx]
LOAD_CHANGE = 1e-3    # of the sum of frictions: smaller changes between two solves end the step


class ImplicitProblem(NamedTuple):
    """The minimisation problem of one implicit step."""

    grid: Grid                      # mass and momentum
    unknowns: Unknowns
    potential: Potential
    kappa: np.ndarray               # (n,)  characteristic norms [kg m/s]
    active_set: ActiveSet | None
    gravity_increment: np.ndarray   # (d,)  dt g [m/s]
    coarse_grids: CoarseGrids       # of greater spacings


class ImplicitStepper(Stepper):
    """Advances bodies by implicit steps, with the interface of `explicit.Stepper`.

    After each step, `report` is the `report.SolveReport` of its solve.
    """

    implicit = True             # the particles' speed alone bounds a step (HOT-cfl, HOT-dt)

    def __init__(self, scheme, dx, dim, gravity, conditions=None, options=None):
        super().__init__(scheme, dx, dim, gravity, conditions)
        self.options = options_for(SolverOptions() if options is None else options, conditions)
        self.report = None
        self.active_set_updates = 0         # in the last solve
        check_scheme(scheme)
        check_friction(conditions, self.options)

    def start(self, bodies):
        """Prepare the bodies, as `explicit.Stepper.start`. Raises ValueError for body forces of
        particles, and for a flow without potential where the options ask for one.
        """
        keep_freed_memory()
        super().start(bodies)
        for body in bodies:
            check_return_map(body, self.options.return_map)
            if body.particles.b.ndim == 2:
                raise ValueError(f"body {body.name!r} has body forces b of its own: expected "
                                 "gravity alone with an implicit integrator")

    def new_storage(self):
        """Return storage for dense grids, whose nodes the solvers number."""
        return Storage(self.dx, self.scheme.stencil, len(self.gravity),
                       self.scheme.keeps_old_velocity)

    def advance_grid(self, bodies, t, dt):
        """Return the grid of the step from time t [s] by dt [s], which holds m and the new v. The
        bodies stay as they are. Raises ValueError unless dt > 0.
        """
        if not 0.0 < dt < np.inf:
            raise ValueError(f"dt = {dt}: expected a positive, finite time in s")
        problem = self.problem(bodies, t, dt)
        write_velocities(problem.grid, problem.unknowns, problem.unknowns.v + self.solve(problem))
        return problem.grid

    def driven_speed(self, bodies, t, dt):
        """Largest speed [m/s] that moving parts give to nodes with mass from time t to t + dt."""
        if self.conditions is None or not self.conditions.moves:
            return 0.0
        grid = scatter(bodies, self.storage, self.scheme, 0.0)
        return self.conditions.fastest(grid, t + dt, dt)

    def problem(self, bodies, t, dt):
        """`ImplicitProblem` of the step from time t [s] by dt [s]; the bodies stay as they are."""
        grid = scatter(bodies, self.storage, self.scheme, 0.0)
        unknowns, active_set = self._constrained(grid, self.conditions, t, dt)
        stencil = potential_stencil(self.scheme)
        potential = Potential(bodies, unknowns, stencil, dt, self.gravity, self.options.return_map)
        if active_set is not None:
            impulse = first_impulse(unknowns, dt * self.gravity)
            potential = potential.with_friction(self._friction(active_set, potential, impulse))
        kappa = characteristic_norms(bodies, unknowns, stencil, dt)
        coarse_grids = CoarseGrids(potential, partial(self.coarse_unknowns, bodies, t, dt))
        return ImplicitProblem(grid, unknowns, potential, kappa, active_set, dt * self.gravity,
                               coarse_grids)

    def coarse_unknowns(self, bodies, t, dt, level):
        """`Unknowns` of the step on a grid of 2^level dx, under the conditions at its own
        nodes; separate planes are active there as before the solve.
        """
        factor, conditions = 2**level, self.conditions
        storage = Storage(factor * self.dx, self.scheme.stencil, len(self.gravity))
        grid = scatter(bodies, storage, self.scheme, 0.0)
        conditions = None if conditions is None else coarse_conditions(conditions, factor)
        return self._constrained(grid, conditions, t, dt)[0]

    def _friction(self, active_set, potential, impulse):
        """The `Friction` of a step, or None, of the impulse (n, d) [kg m/s] of the parts."""
        eps = self.options.creep * self.dx / potential.dt
        return active_set.friction(potential.unknowns, impulse, eps)

    def _constrained(self, grid, conditions, t, dt):
        """The unknowns of a grid under conditions, and their `ActiveSet` or None."""
        unknowns = unknowns_of(grid, self.scheme.mass_eps)
        if conditions is None:
            return unknowns, None
        active_set = ActiveSet(conditions, grid, unknowns, t + dt, dt)
        return active_set.initial_unknowns(unknowns, unknowns.v + dt * self.gravity), active_set

    def system(self, problem, near=None):
        """`System` of a problem under its current active set.

        It starts where the options say, or at the admissible increment nearest to near (n, d)
        [m/s].
        """
        q, start = problem.unknowns, problem.unknowns.dv0
        if near is not None:
            start = start + free_part(q, near - start)
        elif self.options.start == "gravity":
            start = start + free_part(q, np.broadcast_to(problem.gravity_increment, start.shape))
        return System(problem.potential, q, problem.kappa, start, problem.coarse_grids)

    def solve(self, problem):
        """Return the increment dv (n, d) [m/s] of a problem.

        The active set of separate planes, and the loads that friction depends on, are updated
        between solves, each of which starts from the result of the one before.
        """
        dv, reports, most = None, [], most_updates(problem.active_set)
        for self.active_set_updates in range(most):
            solution = minimise(self.system(problem, dv), self.options)
            reports.append(solution.report)
            self.report, dv = combined_report(reports), solution.dv
            updated = self._updated(problem, dv)
            if updated is None:
                return dv
            problem = updated
        self.active_set_updates = most
        self.report = self.report._replace(converged=False, message="separate planes or the loads "
                                           f"of friction still changed after {most} solves")
        return dv

    def _updated(self, problem, dv):
        """The problem with the active set and friction of the increment dv; None for no change."""
        active_set, unknowns, potential = problem.active_set, problem.unknowns, problem.potential
        if active_set is None:
            return None
        impulse = potential.evaluate(dv)[1]
        changed = active_set.update(unknowns.v + dv, impulse)
        if changed:
            unknowns = active_set.apply(unknowns)
        if active_set.rubs:
            potential = potential.with_unknowns(unknowns)
            friction = self._friction(active_set, potential, impulse)
            changed = changed or load_change(potential.friction, friction) > LOAD_CHANGE
            potential = potential.with_friction(friction)
        return problem._replace(unknowns=unknowns, potential=potential) if changed else None


def most_updates(active_set):
    """Return how often a step may update its `ActiveSet` or None, with the loads if a part rubs."""
    return LOAD_UPDATES if active_set is not None and active_set.rubs else MAX_UPDATES


def potential_stencil(scheme):
    """Return the stencil of force and velocity gradient of a scheme: that of their MLS form, whose
    slopes belong to a potential of their own, or that of the splines.
    """
    return mls_stencil(scheme.degree) if scheme.transfer == "mls" else scheme.stencil


def first_impulse(unknowns, gravity_increment):
    """Return the impulse (n, d) [kg m/s] by which conditions change free fall."""
    free = np.broadcast_to(gravity_increment, unknowns.v.shape)
    admitted = unknowns.dv0 + free_part(unknowns, free - unknowns.dv0)
    return unknowns.m[:, None] * (admitted - free)


def load_change(old, new):
    """Return the sum of the changes of w in two `Friction` or None over the sum of the new one."""
    if old is None or new is None:
        return 0.0 if old is new else inf
    size = max(old.node.max(), new.node.max()) + 1
    w = [np.bincount(friction.node, friction.w, size) for friction in (old, new)]
    return float(np.abs(w[1] - w[0]).sum() / w[1].sum())


def write_velocities(grid, unknowns, v):
    """Write the velocities v (n, d) of the nodes into the grid, and the old ones where it has an
    array for them.
    """
    d = grid.m.ndim
    at = np.flatnonzero(unknowns.number.reshape(-1) >= 0)
    if grid.v_old.ndim > 1:
        grid.v_old.reshape(-1, d)[at] = unknowns.v
    nodes = grid.v.reshape(-1, d)
    nodes[:] = 0.0
    nodes[at] = v


def has_friction(conditions):
    """Return whether a part of conditions, or None, rubs."""
    return any(part.friction for part in getattr(conditions, "rules", ()))


def options_for(options, conditions):
    """Return the `SolverOptions` of a step under conditions: with friction the error of the
    displacement is bounded, by `FRICTION_TOLERANCE` where the options have no bound, since the
    loads of stiff bodies are lost in the tolerance of the gradient.
    """
    if not has_friction(conditions) or options.displacement_tolerance:
        return options
    return replace(options, displacement_tolerance=FRICTION_TOLERANCE)


def check_friction(conditions, options):
    """Raise ValueError for friction with a method that has no place for it."""
    if has_friction(conditions) and options.descent == "admm":
        raise ValueError("friction with the method 'admm': its splitting knows inertia and "
                         "elasticity alone; expected another method, such as 'hot-plus'")


def check_scheme(scheme):
    """Raise ValueError where a scheme has no implicit form."""
    if scheme.relaxation:
        raise ValueError(f"relaxation = {scheme.relaxation} with an implicit integrator: it "
                         "belongs to explicit steps; leave it out")
    if scheme.gimp:
        raise ValueError(f"gimp = {scheme.gimp} with an implicit integrator: its matrices are "
                         "those of splines; expected gimp = 0, or integrator = \"explicit\"")
    if scheme.precision != "double":
        raise ValueError(f"precision = {scheme.precision!r} with an implicit integrator: expected "
                         "'double', which its sums of energies need")
    if scheme.f_bar:
        raise ValueError("f_bar = true with an implicit integrator: its energy has no averaged "
                         "volumes; expected f_bar = false, or integrator = \"explicit\"")
