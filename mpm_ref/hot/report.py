"""What a solve has to say about itself, and the watch that counts and times while it runs."""

from contextlib import contextmanager
from math import nan
from time import process_time
from typing import NamedTuple

import numpy as np

REST = "other"      # the part of what no other part claims


class Report(NamedTuple):
    """How a minimisation went."""

    method: str
    converged: bool
    why: str            # it stopped
    iterations: int     # accepted steps
    inner: int          # CG iterations on the finest level
    coarse: int         # CG iterations on the coarsest level of multigrid
    capped: int         # linear solves, or local steps of ADMM, short of their tolerance
    builds: int         # tangents taken: matrices assembled, or linearisations without matrix
    refreshes: int      # times the method had to start afresh after a refused direction
    evaluations: int    # passes over the particles for the energy, with the gradient or without
    backtracks: int     # trial steps refused by line searches
    residuals: tuple    # of the start and of every accepted step: ||g^||_2 / sqrt(n)
    clock: tuple        # CPU seconds of the solve when each of them was known
    off: float          # estimate of the particles' error by the last check of
                        # `displacement_stop` [dx]; else NaN
    seconds: dict       # CPU seconds of all threads by part; their sum is the whole solve


COUNTS = ("iterations", "inner", "coarse", "capped", "builds", "refreshes", "evaluations",
          "backtracks")


def together(reports):
    """`Report` of solves that follow each other: counts and times of all, the rest of the last."""
    sums = {name: sum(getattr(r, name) for r in reports) for name in COUNTS}
    parts = dict.fromkeys(part for r in reports for part in r.seconds)
    seconds = {part: sum(r.seconds.get(part, 0.0) for r in reports) for part in parts}
    return reports[-1]._replace(**sums, seconds=seconds)


class Solution(NamedTuple):
    """The accepted increment, and how it was found."""

    dv: np.ndarray      # (n, d) [m/s]
    E: float            # its energy [J]
    report: Report


class Watch:
    """Counts and CPU times of one solve; a part's time does not contain that of parts within it."""

    def __init__(self):
        self.seconds = {}
        self.inner = self.coarse = self.capped = self.builds = self.refreshes = 0
        self.evaluations = self.backtracks = 0
        self.residuals, self.clock, self.off = [], [], nan
        self._parts, self._since = [], 0.0

    @contextmanager
    def part(self, name):
        """Time what runs inside under `name`."""
        self._turn()
        self._parts.append(name)
        try:
            yield
        finally:
            self._turn()
            self._parts.pop()

    def timed(self, name, function):
        """`function`, timed as a part whenever it is called."""
        def run(*arguments):
            with self.part(name):
                return function(*arguments)
        return run

    def note(self, residual):
        """Count in an iterate by the size of its gradient."""
        self._turn()
        self.residuals.append(residual)
        self.clock.append(sum(self.seconds.values()))

    def _turn(self):
        """Book the time since the last turn on the part that was running."""
        now = process_time()
        if self._parts:
            part = self._parts[-1]
            self.seconds[part] = self.seconds.get(part, 0.0) + now - self._since
        self._since = now

    def report(self, method, why):
        """`Report` of the solve that has just ended; `why` is None if it converged."""
        return Report(
            method=method,
            converged=why is None,
            why=why or "converged",
            iterations=len(self.residuals) - 1,
            inner=self.inner,
            coarse=self.coarse,
            capped=self.capped,
            builds=self.builds,
            refreshes=self.refreshes,
            evaluations=self.evaluations,
            backtracks=self.backtracks,
            residuals=tuple(self.residuals),
            clock=tuple(self.clock),
            off=self.off,
            seconds=dict(self.seconds),
        )


class Watched:
    """A `System` whose calls are counted and timed; same names, same values."""

    def __init__(self, system, watch):
        self.system, self.watch, self.potential = system, watch, system.potential
        self.start, self.index, self.kappa, self.n = (
            system.start, system.index, system.kappa, system.n)

    def energy(self, dv):
        """E(dv) [J]."""
        self.watch.evaluations += 1
        with self.watch.part("evaluate"):
            return self.system.energy(dv)

    def evaluate(self, dv):
        """E(dv) [J] and its gradient on what is free (n, d) [kg m/s]."""
        self.watch.evaluations += 1
        with self.watch.part("evaluate"):
            return self.system.evaluate(dv)

    def free(self, u):
        """What of u (n, d) is free."""
        return self.system.free(u)

    def cells(self, u):
        """How far u moves the particles in the step, at most [dx]."""
        return self.system.cells(u)

    def matrix(self, dv):
        """The Hessian on what is free, assembled [kg]."""
        self.watch.builds += 1
        with self.watch.part("assembly"):
            return self.system.matrix(dv)

    def matrices(self, dv, levels):
        """The Hessian and those on coarser grids, with their nodes."""
        self.watch.builds += 1
        with self.watch.part("assembly"):
            return self.system.matrices(dv, levels)

    def product(self, dv):
        """u -> H u on what is free, without a matrix."""
        self.watch.builds += 1
        with self.watch.part("assembly"):
            return self.watch.timed("product", self.system.product(dv))

    def diagonal(self, dv):
        """Diagonal blocks of the Hessian on what is free (n, d, d) [kg]."""
        with self.watch.part("assembly"):
            return self.system.diagonal(dv)
