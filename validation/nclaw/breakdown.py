"""Printed errors that a run which breaks down would have, whatever its law.

The authors' release goes on where a point has no finite place: all points are then clipped to the
upper corner of their box (NCLAW-eval, `evaluate`). The error of such a run depends on the true run
and on the frame of the breakdown alone, so that two printed errors of one law, of the training run
and of its continuation in task (a), each determine the frame. They agree if the law broke down.
Before the breakdown the error is taken as zero.
"""

import numpy as np

from mpm_ref.nclaw.bodies import copy_body
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import build

from ..common import targets
from ..common.registry import experiment
from .printed_ids import RELEASED, error_id
from .tasks import reconstruction, time

SUSPECTS = {        # methods and environments whose printed errors are about the size of the box
    "sand": (f"spline{RELEASED}", "labeled"), "jelly": (f"spline{RELEASED}",),
    "plasticine": (f"spline{RELEASED}", f"neural{RELEASED}"), "water": (f"spline{RELEASED}",)}
DIGITS = 2          # of a printed error


@experiment("nclaw.breakdown", title="NCLaw: printed errors of runs that break down",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 30})
def breakdown(run):
    """Record how many frames of a breakdown explain both printed errors of a law."""
    printed, rows = targets.load(), []
    names = run.choose(quick=("sand",), standard=tuple(SUSPECTS))
    for name in run.progress(names, "environments"):
        errors = [errors_by_breakdown(task(name)) for task in (reconstruction, time)]
        for method in SUSPECTS[name]:
            ids = (error_id("nclaw.table1", method, name, "reconstruction"),
                   error_id("nclaw.table2", method, name, "time"))
            frames = [agreeing(e, printed[id].value) for e, id in zip(errors, ids, strict=True)]
            record(run, name, method.removesuffix(RELEASED), frames, len(errors[0]))
            rows += [(name, id, printed[id].value, *ends(f))
                     for id, f in zip(ids, frames, strict=True)]
    run.table("frames", ("environment", "number", "printed", "first", "last"), rows)


def record(run, name, method, frames, count):
    """Record the number of frames that explain both numbers."""
    both = np.intersect1d(*frames)
    texts = [" to ".join(map(str, ends(f))) if len(f) else "none" for f in frames]
    run.record(f"nclaw.breakdown.{method}.{name}", len(both), unit="frames", comparator=">=",
               bound=1, scale=f"{count - 1} frames of the training run",
               note=f"frames of a breakdown that give both printed errors to {DIGITS} digits; "
               f"reconstruction alone {texts[0]}, time alone {texts[1]}")


def errors_by_breakdown(scene):
    """Return the error [m^2] of a run that breaks down in frame k, for every frame k of a scene."""
    problem = build(scene)
    corner = problem.clip[1]
    away = [np.mean((x - corner)**2)
            for x in positions(problem, tuple(map(copy_body, problem.bodies)))]
    return np.cumsum(away[::-1])[::-1] / len(away)


def agreeing(errors, printed):
    """Return the frames whose error rounds to a printed one of DIGITS digits."""
    half = 0.5 * 10.0**(np.floor(np.log10(printed)) - DIGITS + 1)
    return np.flatnonzero(np.abs(errors - printed) <= half)


def ends(frames):
    """Return the first and the last of some frames, None where there are none."""
    return (int(frames[0]), int(frames[-1])) if len(frames) else (None, None)
