"""Reduced runs with inferred stress whose parameter lies outside those that the fields were made
with, and inside; and how well the distance of latent coordinates from the trained ones tells which
of them are wrong.
"""

from ..common.registry import experiment
from .ldm_runs import BAD, TOLERABLE, record_silent, table_of
from .nsf_runs import ERRORS, Bench, made, scenes

OUTSIDE = {         # trained: speeds 0.3 to 0.5, hardening coefficients 0 to 0.2
    "jelly": {"quick": (0.2, 0.7, 1.0), "standard": (0.1, 0.2, 0.25, 0.6, 0.7, 0.8, 0.9, 1.0)},
    "metal": {"quick": (0.5, 5.0), "standard": (0.25, 0.3, 0.4, 0.6, 1.0, 2.0, 5.0)}}
INSIDE = {"jelly": (0.33, 0.37, 0.43, 0.48), "metal": ()}      # beside tests
BOUNDS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)     # of `beyond`
RATES = ("bound", "false_alarms", "misses", "good", "bad")


@experiment("extremes.nsf.beyond", title="NSF: parameters outside the trained range",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def beyond(run):
    """A run is bad where its error is above BAD times the largest of the tests, and above
    TOLERABLE.
    """
    found, stopped = [], []
    for name, one in scenes(run):
        bench = Bench(name, one)
        found += [bench.named(f"{value:g}", end, bench.count)
                  for value, end in zip(one.study.test, bench.tests, strict=True)]
        inside = INSIDE[name][::run.choose(quick=2, standard=1)]
        for value in run.progress((*inside, *OUTSIDE[name][run.profile]), f"{name}, values"):
            test, said = made(one.study, value)
            if said:
                stopped.append(f"{name} {value:g}")
                continue
            end = bench.ended(value, bench.drawn(bench.count), test)
            found.append(bench.named(f"{value:g}", end, bench.count))
    record_errors(run, found)
    record_false_alarms(run, found)
    record_silent(run, "extremes.nsf.beyond", found, ERRORS, "full-order runs that stopped: "
                  + (", ".join(stopped) or "none"))
    run.table("rates", RATES, rates(found, BOUNDS))
    table_of(run, found)


def is_bad(trial):
    """Whether a run is wrong, as `ldm_runs.End.kind` has it."""
    return not trial.end.error <= max(BAD * trial.usual, TOLERABLE)


def rates(trials, bounds):
    """Rows of RATES: shares of the good runs with latent coordinates farther off than a bound, and
    of the bad ones without, that did not stop either.
    """
    good, bad = ([t for t in trials if is_bad(t) == wrong] for wrong in (False, True))
    return [(bound, sum(not t.end.beyond <= bound for t in good) / max(len(good), 1),
             sum(t.end.beyond <= bound and not t.end.said for t in bad) / max(len(bad), 1),
             len(good), len(bad)) for bound in bounds]


def record_errors(run, trials):
    """Record the error of every run."""
    for t in trials:
        run.record(f"extremes.nsf.beyond.{t.map}.{t.what}", t.end.error, unit="%",
                   comparator="info", scale=f"{t.map}, {t.points} samples, {ERRORS}",
                   note=f"{t.kind}; of the tests at most {t.usual:.3g} %; latent coordinates "
                        f"{t.end.beyond:.3g} times as far off as training runs are from each other")


def record_false_alarms(run, trials):
    """Record the share of the good runs that the watch flagged."""
    good = [t for t in trials if not is_bad(t)]
    flagged = [t for t in good if t.end.flags]
    words = (f"{t.map}, {t.what}: {t.end.flags}, {t.end.error:.3g} %" for t in flagged[:6])
    run.record("extremes.nsf.beyond.false_alarms", len(flagged) / max(len(good), 1),
               comparator="info", scale=f"{ERRORS}, {len(good)} runs that are not bad",
               note="; ".join((f"share flagged in any step; bad: above {BAD:g} times the largest "
                               f"error of the tests, and above {TOLERABLE:g} %", *words)))
