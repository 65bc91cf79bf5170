"""Reduced runs of a study beside the full-order runs."""

from math import inf

import threadpoolctl

from mpm_ref.rom.projection import project_position
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.run import ldm_run

from ..common.scenes import threads_for


def compared(cases, references, map, way, rest, seed=0):
    """`PositionErrors` over runs: of `Case`s beside the full model's x (k + 1, n, d) of each;
    infinite where a run did not reach its end.
    """
    sums = Squares(cases[0].X)
    with threads_for((cases[0].problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
        for k, (one, x) in enumerate(zip(cases, references, strict=True)):
            states = ldm_run(one, map, way, rest, seed + k).states()
            try:
                for state, reference in zip(states, x, strict=True):
                    sums.add(map.place(one.X, state.latent.xhat), reference)
            except BREAKDOWNS:
                return PositionErrors(inf, inf, inf)
    return sums.errors


def reconstructed(X, references, map, rest):
    """`PositionErrors` of the nearest states of a map, without any dynamics: what no reduced run on
    it is expected to beat.
    """
    sums = Squares(X)
    for x in references:
        xhat = rest
        for reference in x:
            xhat = project_position(map, X, reference, xhat).y
            sums.add(map.place(X, xhat), reference)
    return sums.errors
