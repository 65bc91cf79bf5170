"""The report of a solve, and the profiler that counts and times while it runs."""

from contextlib import contextmanager
from math import nan
from time import process_time
from typing import NamedTuple

import numpy as np


class SolveReport(NamedTuple):
    """Outcome and cost of a minimisation."""

    method: str
    converged: bool
    message: str            # why it stopped
    iterations: int         # accepted steps
    cg_iterations: int      # on the finest level
    coarse_iterations: int  # of CG on the coarsest level of multigrid
    capped_solves: int      # linear solves, or local steps of ADMM, short of their tolerance
    hessians: int           # matrices assembled, or linearisations without matrix
    restarts: int           # of the method, after a refused direction
    evaluations: int        # passes over the particles for the energy, with the gradient or without
    backtracks: int         # trial steps refused by line searches
    residuals: tuple        # of the start and of every accepted step: ||g^||_2 / sqrt(n)
    cpu_times: tuple        # CPU seconds of the solve when each of them was known
    particle_error: float   # estimated by the last check of `displacement_stop` [dx]; else NaN
    seconds: dict           # CPU seconds of all threads by part; their sum is the whole solve
    stalled: bool = False   # it ended at its start, although free matter was not in balance


COUNTS = ("iterations", "cg_iterations", "coarse_iterations", "capped_solves", "hessians",
          "restarts", "evaluations", "backtracks")


def combined_report(reports):
    """`SolveReport` of successive solves: the sums of counts and times, the rest of the last."""
    sums = {name: sum(getattr(r, name) for r in reports) for name in COUNTS}
    parts = dict.fromkeys(part for r in reports for part in r.seconds)
    seconds = {part: sum(r.seconds.get(part, 0.0) for r in reports) for part in parts}
    return reports[-1]._replace(**sums, seconds=seconds,
                                stalled=all(report.stalled for report in reports))


class Solution(NamedTuple):
    """The accepted increment, and how it was found."""

    dv: np.ndarray      # (n, d) [m/s]
    E: float            # its energy [J]
    report: SolveReport


class Profiler:
    """Counts and CPU times of one solve; the time of a part excludes the parts within it."""

    def __init__(self):
        self.seconds = {}
        self.cg_iterations = self.coarse_iterations = self.capped_solves = 0
        self.hessians = self.restarts = 0
        self.evaluations = self.backtracks = 0
        self.residuals, self.cpu_times, self.particle_error = [], [], nan
        self._parts, self._since = [], 0.0

    @contextmanager
    def part(self, name):
        """Time what runs inside under `name`."""
        self._charge()
        self._parts.append(name)
        try:
            yield
        finally:
            self._charge()
            self._parts.pop()

    def timed(self, name, function):
        """Return the function, timed as a part at every call."""
        def run(*arguments):
            with self.part(name):
                return function(*arguments)
        return run

    def record(self, residual):
        """Append an iterate: the size of its gradient, and the CPU time so far."""
        self._charge()
        self.residuals.append(residual)
        self.cpu_times.append(sum(self.seconds.values()))

    def _charge(self):
        """Add the time since the last call to the part that was running."""
        now = process_time()
        if self._parts:
            part = self._parts[-1]
            self.seconds[part] = self.seconds.get(part, 0.0) + now - self._since
        self._since = now

    def report(self, method, message):
        """`SolveReport` of the solve that has just ended; `message` is None if it converged."""
        return SolveReport(
            method=method,
            converged=message is None,
            message=message or "converged",
            iterations=len(self.residuals) - 1,
            cg_iterations=self.cg_iterations,
            coarse_iterations=self.coarse_iterations,
            capped_solves=self.capped_solves,
            hessians=self.hessians,
            restarts=self.restarts,
            evaluations=self.evaluations,
            backtracks=self.backtracks,
            residuals=tuple(self.residuals),
            cpu_times=tuple(self.cpu_times),
            particle_error=self.particle_error,
            seconds=dict(self.seconds),
        )


class ProfiledSystem:
    """A `System` whose calls are counted and timed, with its methods."""

    def __init__(self, system, profiler):
        self.system, self.profiler = system, profiler
        self.start, self.index, self.kappa, self.n = (
            system.start, system.index, system.kappa, system.n)

    @property
    def potential(self):
        """The `Potential` of the system."""
        return self.system.potential

    def energy(self, dv):
        """Return E(dv) [J]."""
        self.profiler.evaluations += 1
        with self.profiler.part("evaluate"):
            return self.system.energy(dv)

    def evaluate(self, dv):
        """Return E(dv) [J] and its projected gradient (n, d) [kg m/s]."""
        self.profiler.evaluations += 1
        with self.profiler.part("evaluate"):
            return self.system.evaluate(dv)

    def project(self, u):
        """Return B u (n, d)."""
        return self.system.project(u)

    def particle_displacement(self, u):
        """Largest displacement [dx] of a particle in the step by nodal velocities u (n, d)."""
        return self.system.particle_displacement(u)

    def balanced(self, dv):
        """Return dv (n, d) [m/s] with the balance of rigid motions."""
        return self.system.balanced(dv)

    def matrix(self, dv):
        """The projected Hessian, assembled [kg]."""
        self.profiler.hessians += 1
        with self.profiler.part("assembly"):
            return self.system.matrix(dv)

    def matrices(self, dv, levels):
        """The projected Hessian and those on coarser grids, with their nodes."""
        self.profiler.hessians += 1
        with self.profiler.part("assembly"):
            return self.system.matrices(dv, levels)

    def product(self, dv, projected=True):
        """Return u -> B H B u, without a matrix."""
        self.profiler.hessians += 1
        with self.profiler.part("assembly"):
            return self.profiler.timed("product", self.system.product(dv, projected))

    def diagonal(self, dv):
        """Diagonal blocks of the projected Hessian (n, d, d) [kg]."""
        with self.profiler.part("assembly"):
            return self.system.diagonal(dv)
