"""Gauss-Newton and its first step alone (NSF-eq10, section 5.3): errors, and how many iterations it
takes from the latent coordinates before the step.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.reduced.errors import Errors
from mpm_ref.reduced.inferring import Plan, infer
from mpm_ref.reduced.nsf.evaluate import course, level_of, share
from mpm_ref.reduced.whole import whole
from mpm_ref.rom.inferred import INVERSIONS

from ..registry import experiment
from .studies import jelly, metal
from .tested import FASTER, tested

COLUMNS = ("scene", "value", "inversion", "faster", "origin", "centroid", "displacement", "stress",
           "least", "median", "most")


class Found(NamedTuple):
    """What a reduced run gave."""

    errors: Errors
    stress: float           # of the Kirchhoff stress, over its norm
    iterations: tuple       # of its steps: the least, the median and the most


@experiment("nsf.inversion", title="NSF: Gauss-Newton, and its first step alone",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 200})
def inversion(run):
    """Jelly cube and metal frame, the usual samples drawn at random once, all tests; with the
    scene's own steps and with longer ones.
    """
    studies = run.choose(quick=lambda: (jelly(4), metal(4, train=4)),
                         standard=lambda: (jelly(), metal(2)))()
    rows, scales = [], []
    for name, study in zip(("jelly", "metal"), run.progress(studies, "scenes"), strict=True):
        one = tested(study)
        scales.append(one.scale)
        for kind in INVERSIONS:
            for faster in (1.0, FASTER):
                found = [of_run(one, value, kind, faster) for value in study.test]
                rows += [(name, value, kind, faster, *own.errors, own.stress, *own.iterations)
                         for value, own in zip(study.test, found, strict=True)]
                record(run, f"nsf.inversion.{name}.{kind}.{faster:g}", one.scale, found)
    counts(run, rows, "; ".join(scales))
    run.table("runs", COLUMNS, rows)


def of_run(one, value, kind, faster):
    """`Found` of a reduced run of a `Tested` with an inversion of a kind."""
    scene, fields, test = whole(one.study.run(value)), one.of(value), one.tests[value]
    plan, iterations = Plan(one.study.chosen(scene, one.study.samples, 0), faster, kind), []

    def states():
        for t, at, report in infer(scene, fields, plan, one.rest):
            iterations.extend(() if report is None else (report.iterations,))
            yield level_of(t / test.dt), at.xhat

    own, stress = course(fields, test.x[0], test.tau[0], states())
    spread = tuple(float(a) for a in np.quantile(iterations, (0.0, 0.5, 1.0)))
    return Found(own.errors, share(stress), spread)


def record(run, id, scale, found):
    """Record the mean error of runs."""
    errors = [own.errors for own in found]
    run.record(f"{id}.error", 100.0 * np.mean([one.origin for one in errors]), unit="%",
               comparator="info", scale=scale, note="of the displacement "
               f"{100.0 * np.mean([one.displacement for one in errors]):.3g} %, of the stress "
               f"{100.0 * np.mean([own.stress for own in found]):.3g} %; mean of {len(found)}")


def counts(run, rows, scale):
    """Record the numbers of iterations of Gauss-Newton beside the printed ones: of the runs with
    the scene's own steps, the least and the largest median.
    """
    own = [row for row in rows if row[2:4] == (INVERSIONS[0], 1.0)]
    medians = [row[COLUMNS.index("median")] for row in own]
    most = max(row[COLUMNS.index("most")] for row in own)
    for word, value in (("lo", min(medians)), ("hi", max(medians))):
        run.record(f"nsf.sec5_3.gn_{word}", value, unit="1", scale=scale,
                   note="median of a run's steps, until nothing but round-off is left to gain; the "
                        f"most in any step {most:g}")
