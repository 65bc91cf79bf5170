"""The verdict on a run at an extreme: it stopped with a sentence; the monitor flagged it in some
step; it is fine; or it is silent: wrong, and neither stopped nor flagged. No run should be silent.

A trial is a record whose last field `end` has the fields `message` and `flags`.
"""

import numpy as np

STOPPED, FLAGGED, FINE, SILENT = "stopped", "flagged", "fine", "silent"


def verdict(end, is_bad):
    """Return the verdict on the end of a run, given whether its error is bad."""
    if end.message:
        return STOPPED
    if end.flags:
        return FLAGGED
    return SILENT if is_bad else FINE


def verdict_counts(trials):
    """Return as text how many trials stopped, were flagged and are fine."""
    return ", ".join(f"{sum(t.kind == kind for t in trials)} {kind}"
                     for kind in (STOPPED, FLAGGED, FINE))


def trial_table(run, trials):
    """Write the table of trials: their fields, their verdict and the fields of their ends."""
    run.table("runs", (*trials[0]._fields[:-1], "kind", *trials[0].end._fields),
              [(*t[:-1], t.kind, *t.end) for t in trials])


def flag_history(checks):
    """Return the first index of the checks that is out of bounds, -1 for none, and all flags."""
    flagged = [k for k, check in enumerate(checks) if check.out_of_bounds]
    flags = dict.fromkeys(flag for check in checks for flag in check.out_of_bounds)
    return flagged[0] if flagged else -1, " ".join(flags)


# Calibration: a bound on one measure of runs that are not those it is judged by.

CURVE = ("bound", "misses", "false_alarms", "wrong", "good")


def rates_at(trials, measure, bound):
    """Return the share of wrong trials whose measure is not above a bound, that of good ones whose
    measure is, and both numbers of trials.
    """
    above = {True: [], False: []}
    for t in trials:
        above[t.is_bad].append(not measure(t) <= bound)
    wrong, good = above[True], above[False]
    return (wrong.count(False) / max(len(wrong), 1), sum(good) / max(len(good), 1), len(wrong),
            len(good))


def record_bound(run, name, trials, measure, bound):
    """Record how often a bound of `measure` errs on calibration trials, and write the table `curve`
    of other bounds: the values of the wrong trials.
    """
    misses, alarms, wrong, good = rates_at(trials, measure, bound)
    for what, share, count in (("misses", misses, f"{wrong} wrong runs that are not above"),
                               ("false_alarms", alarms, f"{good} good runs that are above")):
        run.record(f"{name}.{what}", share, comparator="info",
                   scale=f"{len(trials)} calibration runs", note=f"share of the {count} the bound "
                   f"{bound:g}")
    values = sorted({measure(t) for t in trials if t.is_bad and np.isfinite(measure(t))})
    run.table("curve", CURVE, [(value, *rates_at(trials, measure, value)) for value in values])
