"""Numbers of learned laws as tables: errors of frames, stresses along paths."""

import csv

from ...store.atomic import replacing


def write_errors(errors, clock, out):
    """Write the errors of frames [m^2] as CSV, with their steps and times [s]."""
    rows = ((k, k * clock.every, k * clock.every * clock.dt, error)
            for k, error in enumerate(errors))
    write_rows(("frame", "step", "t", "error"), rows, out)


def write_curves(found, out):
    """Write `curves.Curve`s as CSV: a row for each time level. Stresses are in Pa; `seen` is 1 or
    0, empty where it is not known.
    """
    rows = ((curve.path.name, k * curve.dt, curve.path.strain[k], curve.path.symbol,
             curve.truth[k], curve.learned[k], "" if curve.seen is None else int(curve.seen[k]))
            for curve in found for k in range(len(curve.truth)))
    write_rows(("path", "t", "strain", "stress", "truth", "learned", "seen"), rows, out)


def write_rows(columns, rows, out):
    """Write rows as CSV, whole or not at all. Raises NotWritten."""
    with replacing(out) as part, open(part, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(rows)
