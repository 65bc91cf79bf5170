"""Gauss-Newton and its first step alone (NSF-eq10, section 5.3): errors, and the number of
iterations from the latent coordinates before the step.
"""

import numpy as np

from mpm_ref.rom.projection import INVERSIONS

from ..common.registry import experiment
from .errors import MODES
from .reduced_runs import FASTER, fit_study
from .studies import jelly, metal

COLUMNS = ("scene", "value", "draw", "inversion", "faster", "origin", "centroid", "displacement",
           "stress", "least", "median", "most")
GAUSS_NEWTON, DRAWS = INVERSIONS[0], 3


@experiment("nsf.inversion", title="NSF: Gauss-Newton, and its first step alone",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 400})
def inversion(run):
    """Jelly cube and metal frame, the usual samples drawn at random, all tests; with the scene's
    own steps and with longer ones.
    """
    studies = run.choose(quick=lambda: (jelly(4), metal(4, train=4)),
                         standard=lambda: (jelly(), metal(2)))()
    rows, scales, draws = [], [], range(run.choose(quick=1, standard=DRAWS))
    for name, study in zip(("jelly", "metal"), run.progress(studies, "scenes"), strict=True):
        one = fit_study(study)
        scales.append(one.scale)
        for kind in INVERSIONS:
            for dt_factor in (1.0, FASTER):
                runs = runs_of(one, kind, dt_factor, draws)
                rows += [(name, *key, kind, dt_factor, *errors.errors, errors.stress,
                          *iteration_quantiles(errors)) for key, errors in runs.items()]
                record(run, f"nsf.inversion.{name}.{kind}.x{dt_factor:g}", one.scale,
                       list(runs.values()))
    record_iterations(run, rows, "; ".join(scales))
    run.table("runs", COLUMNS, rows)


def runs_of(one, kind, dt_factor, draws):
    """Return {(value, draw): `RunErrors`} of all tests of a `FittedStudy`, with an inversion of a
    kind and the usual samples.
    """
    one = one._replace(inversion=kind)
    return {(value, draw): one.errors(value, one.study.samples, draw, dt_factor)
            for value in one.study.test for draw in draws}


def iteration_quantiles(errors):
    """Return the least number of iterations in a step of a run, the median and the most."""
    return [float(a) for a in np.quantile(errors.iterations, (0.0, 0.5, 1.0))]


def record(run, target, scale, runs):
    """Record the mean error of runs, each as `RunErrors`."""
    errors = [one.errors for one in runs]
    run.record(f"{target}.error", 100.0 * np.mean([one.origin for one in errors]), unit="%",
               comparator="info", scale=scale, note="of the displacement "
               f"{100.0 * np.mean([one.displacement for one in errors]):.3g} %, of the stress "
               f"{100.0 * np.mean([one.stress for one in runs]):.3g} %; mean of {len(runs)}")


def record_iterations(run, rows, scale):
    """Record the numbers of iterations of Gauss-Newton beside the printed ones: of the runs with
    the scene's own steps, the least and the largest median.
    """
    entries = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
    printed = [one for one in entries if (one["inversion"], one["faster"]) == (GAUSS_NEWTON, 1.0)]
    medians, most = [one["median"] for one in printed], max(one["most"] for one in printed)
    for word, value in (("lo", min(medians)), ("hi", max(medians))):
        run.record(f"nsf.sec5_3.gn_{word}.{MODES}", value, unit="1", scale=scale,
                   note="median of a run's steps, until nothing but round-off is left to gain; the "
                        f"most in any step {most:g}")
