"""CPU time of a run of the arm as a function of the number of its particles N, of the full model,
of runs on coarser grids and of reduced models, and from which size on one is cheaper.

    run    = steps * step + states * read * N,      steps ~ N^(1/3), by a fixed CFL number
    step   = fixed + point * points + candidate * candidates
    points = N (1 - exp(-s K / N)),    K = (per_cell width / (1 + loss width N^(-1/3)))^3

A full-order step and one whose samples are all points have points = N and no candidates. Of s
samples drawn at random, points and candidates are those within windows of `width` cells, that
overlap and are cut by the surface. A quadratic spline has width 5; the search has a wider one.

    error(c) = B dx^p (c^p - 1)

is that of a run on a grid c times as coarse, as long as errors are B dx^p of one exact solution.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from .arm import LEVELS, PER_CELL

STATES = LEVELS + 1     # whose positions are read
WIDEST, LARGEST = 30.0, 5.0     # cells of a window; loss by the surface
TRIED = 2001            # values that a fit of points tries
ORDERS = 0.1, 4.0       # between which p is searched
WIDTH = 5.0             # cells in which points share a node of a quadratic spline with a sample


class Windows(NamedTuple):
    """Points in the windows of samples."""

    samples: float
    width: float        # [cells]
    loss: float         # by the surface, times N^(1/3), per cell of width

    def count(self, N):
        """Return the number of points of N."""
        K = (PER_CELL * self.width / (1.0 + self.loss * self.width / np.cbrt(N))) ** 3
        return -N * np.expm1(-self.samples * K / N)


class StepCost(NamedTuple):
    """CPU time of a step."""

    fixed: float        # [s]
    point: float        # [s] of an integration point
    candidate: float    # [s] of a point that is tried as one
    windows: Windows | None = None      # None: all points count
    tried: Windows | None = None

    def seconds(self, N):
        """Return the CPU seconds of a step with N particles."""
        points = self.windows.count(N) if self.windows else N
        candidates = self.tried.count(N) if self.tried else 0.0 * N
        return self.fixed + self.point * points + self.candidate * candidates


class ArmRunCost(NamedTuple):
    """CPU time of a run: its steps, on a grid `coarser` times as coarse, and what it reads."""

    step: StepCost
    steps: float        # over the cube root of the particles
    read: float = 0.0   # [s] of a point in a state
    coarser: float = 1.0

    def seconds(self, N):
        """Return the CPU seconds of a run for N points."""
        n = N / self.coarser**3
        return self.steps * np.cbrt(n) * self.step.seconds(n) + STATES * self.read * N


class GridError(NamedTuple):
    """Error of runs on coarser grids, B dx^p (c^p - 1)."""

    B: float
    p: float

    def value(self, c, dx):
        """Return the error of a run on a grid c times as coarse as dx [m]."""
        return self.B * dx**self.p * (c**self.p - 1.0)

    def coarsest(self, error, dx):
        """Return how many times as coarse as dx [m] a grid with an error is."""
        return (error / (self.B * dx**self.p) + 1.0) ** (1.0 / self.p)


class PowerLaw(NamedTuple):
    """A power law a N^b."""

    a: float
    b: float

    def value(self, N):
        """Return the value for N."""
        return self.a * N**self.b


class Rivals(NamedTuple):
    """Full-order runs, on any grid, that a reduced model is compared with."""

    full: ArmRunCost               # of the transfer that errors are compared with
    other: ArmRunCost              # of the faster transfer
    carry: float                # [s] of a fine point that goes with coarse particles
    error: GridError            # of runs on any coarser grid by the transfer of `full`
    others: dict                # {times as coarse: `PowerLaw` of the error} by the other transfer
    volume: float               # dx^3 N of the body [m^3]

    def cheapest(self, N, error, can_coarsen=True):
        """Return the least CPU seconds of a run for N points (sizes,) within an error."""
        found = [self.full.seconds(N)]
        for c, law in self.others.items():
            if c == 1.0 or can_coarsen:
                found.append(np.where(law.value(N) <= error, self.coarse(self.other, c).seconds(N),
                                      np.inf))
        if can_coarsen:
            c = self.error.coarsest(error, np.cbrt(self.volume / N))
            found.append(self.coarse(self.full, c).seconds(N))
        return np.min(found, axis=0)

    def coarse(self, run, c):
        """Return the `ArmRunCost` of a run on a grid c times as coarse."""
        return run._replace(coarser=c, read=np.where(np.equal(c, 1.0), 0.0, self.carry))


# Fits.

def fit_windows(N, counts, samples):
    """Return the `Windows` of integration points that are nearest to counts (sizes,) of N."""
    return nearest(N, counts, lambda loss: Windows(samples, WIDTH, loss), (0.0, LARGEST))


def fit_tried(N, counts, windows):
    """Return the `Windows` of candidates that are nearest to counts (sizes,) of N, and lose to the
    surface as those of the integration points.
    """
    return nearest(N, counts, lambda width: windows._replace(width=width), (WIDTH, WIDEST))


def nearest(N, counts, make, ends):
    """Return the `Windows` make(y) with the least squares of log counts, y between the ends."""
    found = [make(float(y)) for y in np.linspace(*ends, TRIED)]
    return min(found, key=lambda one: np.sum(np.log(one.count(N) / counts) ** 2))


def fit_step(N, cpu, windows=None, tried=None):
    """Return the `StepCost` with the least squares of relative misfits to cpu (sizes,) [s]; no part
    is negative.
    """
    points = windows.count(N) if windows else N
    parts = [np.ones(len(N)), points, *([tried.count(N)] if tried else [])]
    scale = np.max(parts, axis=1)
    found, _ = nnls(np.transpose(parts) / cpu[:, None] / scale * cpu.mean(), np.ones(len(N)))
    costs = found / scale * cpu.mean()
    return StepCost(*costs, *([] if tried else [0.0]), windows, tried)


def fit_grid_error(c, dx, errors):
    """Return the `GridError` with the least squares of log errors (runs,) of grids c times as
    coarse as dx [m], and the root mean square of what is left.
    """
    def left(p):
        return np.log(errors / (dx**p * (c**p - 1.0)))

    p = float(minimize_scalar(lambda p: left(p).var(), bounds=ORDERS, method="bounded").x)
    return GridError(float(np.exp(left(p).mean())), p), float(left(p).std())


def fit_power(N, values):
    """Return the `PowerLaw` of values (sizes,) by least squares of logs."""
    b, log_a = np.polyfit(np.log(N), np.log(values), 1)
    return PowerLaw(float(np.exp(log_a)), float(b))


# Sizes.

def first_size(N, gain, least):
    """Return the smallest of sizes N (k,) from which on a gain (k,) stays at least so large;
    infinite where it is less at the largest.
    """
    below = np.flatnonzero(~(gain >= least))
    first = below[-1] + 1 if len(below) else 0
    return float(N[first]) if first < len(N) else np.inf


def last_size(N, gain, least):
    """Return the largest of sizes N (k,) at which a gain (k,) is at least so large; 0 if none."""
    return float(np.max(N[gain >= least], initial=0.0))
