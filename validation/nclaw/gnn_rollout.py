"""Runs of graph networks, as far as those of laws: positions in the frames of a problem."""

from math import isclose

from mpm_ref.nclaw.gnn.features import SimulatorFailure
from mpm_ref.nclaw.study.compare import RunBroken

from .simulators import start


def free(problem, simulator):
    """Positions (n, d) [m] of all points at the start and at each frame, of a `Simulator`, which is
    told where they are at the start, how fast, and the walls.

    Nothing keeps them in the problem's clip: the largest printed error of a graph network is past
    what a clip allows (NCLAW-X8). Raises `RunBroken` where a point has no finite place or too many
    crowd together, ValueError for frames unlike those that it has learned.
    """
    clock, learned = problem.clock, simulator.reading.dt
    if not isclose(clock.every * clock.dt, learned, rel_tol=1e-9):
        raise ValueError(f"every = {clock.every}: frames {clock.every * clock.dt:g} s apart; the "
                         f"simulator has learned {learned:g} s: set every = {learned / clock.dt:g}")
    run = simulator.run(*start(problem))
    for step in range(0, clock.steps + 1, clock.every):
        try:
            yield next(run)
        except SimulatorFailure as fault:
            raise RunBroken(step, str(fault)) from None
