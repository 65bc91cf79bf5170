"""Records of position errors, LDM's and NSF's measure of a reduced run."""

import numpy as np


def record_position_errors(run, name, errors, scale, note, **rule):
    """Record `PositionErrors` in per cent: that from the origin, as the papers measure it; the note
    goes on with those from the centroid and of the displacement. Beside a printed number, for which
    no rule is given, the error relative to the displacement is judged as well: positions are mostly
    distance from the origin, which no model has to find.
    """
    origin, centroid, displacement = (100.0 * error for error in errors)
    run.record(name, origin, unit="%", scale=scale, note=f"{note}; from the centroid "
               f"{centroid:.3g} %, of the displacement {displacement:.3g} %", **rule)
    if not rule:
        run.record(f"{name}.displacement", displacement, unit="%", scale=scale, note=note)


def mean_errors(errors, noun):
    """Return the mean of several `PositionErrors`, and a note on how many of them there are."""
    worst = 100.0 * max(one.origin for one in errors)
    mean = type(errors[0])(*np.mean(errors, axis=0))
    return mean, f"mean of {len(errors)} {noun}, the largest {worst:.3g} %"
