"""Calibration of the bound on `departure` in NSF's runs (see `mpm_ref.rom.study.monitor`).

The runs are of coarser scenes than those that the bound is judged by, with other draws of the
samples and other values of the parameters.
"""

from mpm_ref.rom.study.monitor import FIELD_DEPARTURE

from ..common.registry import experiment
from ..nsf.reduced_runs import fit_study
from ..nsf.studies import ball, jelly, metal, sand
from .nsf_runs import FieldBench, simulate_test
from .nsf_samples import clustered, corners
from .verdicts import record_bound, trial_table

COUNTS = {"quick": (4, 20), "standard": (2, 3, 4, 6, 8, 10, 15, 20, 30, 50)}
DRAWS = {"quick": (11,), "standard": (11, 12, 13)}
CLUSTERED = 6, 20, 100
VALUES = {"jelly": (.15, .22, .28, .35, .47, .55, .65, .75),
          "metal": (.05, .1, .15, .22, .24, .27, .35),
          "ball": (8., 12., 14., 17., 23., 27., 30., 35.), "sand": (17., 20., 25., 30., 40., 43.)}


@experiment("extremes.nsf.bound", title="NSF: calibration of the bound on departure",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 100})
def calibration(run):
    """Record the errors of the bound, and the table `curve` of other bounds."""
    scenes = {"jelly": jelly(2), "metal": metal(3, train=5), "ball": ball(4),
              "sand": sand(4, train=4)}
    names = run.choose(quick=("jelly",), standard=tuple(scenes))
    trials = [t for name in run.progress(names, "scenes")
              for t in calibration_trials(run, name, scenes[name])]
    record_bound(run, "extremes.nsf.bound", trials, lambda t: t.end.departure, FIELD_DEPARTURE)
    trial_table(run, trials)


def calibration_trials(run, name, study):
    """Return the `ReducedTrial`s of a scene: usual, few samples, samples in a corner, and other
    values of its parameter.
    """
    study = study._replace(test=study.test[:1], column=None, later=None)
    bench = FieldBench(name, fit_study(study))
    trials = [bench.trial_of("usual", bench.tests[0], bench.count)]
    trials += [bench.trial(f"draw {draw}", bench.drawn(count, draw))
               for count in COUNTS[run.profile] for draw in DRAWS[run.profile]]
    X = bench.tested.fields.X
    trials += [bench.trial(f"at the {place} corner", clustered(X, corner, count))
               for place, corner in corners(X).items() for count in CLUSTERED]
    for value in VALUES[name][::run.choose(quick=3, standard=1)]:
        test, message = simulate_test(study, value)
        if not message:
            end = bench.end(value, bench.drawn(bench.count), test)
            trials.append(bench.trial_of(f"{value:g}", end, bench.count))
    return trials
