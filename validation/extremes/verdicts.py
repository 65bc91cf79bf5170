"""The verdict on a run at an extreme: it stopped with a sentence; the monitor flagged it in some
step; it is fine; or it is silent: wrong, and neither stopped nor flagged. No run should be silent.

A trial is a record whose last field `end` has the fields `message` and `flags`.
"""

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
