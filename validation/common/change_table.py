"""The table of `compare` that is published, `results/changes.csv`, and why its verdicts got worse,
`results/changes.toml`.
"""

import csv
from fnmatch import fnmatchcase
from pathlib import Path

import msgspec

from .compare import COLUMNS, ChangedRecord
from .results import RESULTS

TABLE, REASONS = RESULTS / "changes.csv", RESULTS / "changes.toml"


class Reason(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Why the verdicts on some numbers got worse; ids: patterns."""

    ids: list[str]
    why: str


class ReasonFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of `results/changes.toml`."""

    old: str                    # commit with which today's records are compared
    reason: list[Reason] = []

    def of_target(self, target):
        """Return why the verdict on a number got worse; None where no reason has it."""
        return next((one.why for one in self.reason
                     if any(fnmatchcase(target, pattern) for pattern in one.ids)), None)

    def unused(self, targets):
        """Return the patterns that match none of some ids."""
        return [pattern for one in self.reason for pattern in one.ids
                if not any(fnmatchcase(target, pattern) for target in targets)]


def read(path=TABLE):
    """Return the `ChangedRecord`s of a table as `compare --table` writes it. Raises ValueError for
    one with other columns.
    """
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        header = tuple(next(rows, ()))
        if header != COLUMNS:
            raise ValueError(f"{Path(path).name} has the columns {header}: expected {COLUMNS}, as "
                             "`python -m validation compare OLD --table FILE` writes them")
        return [record_of(row) for row in rows]


def record_of(row):
    """Return the `ChangedRecord` of a row with COLUMNS."""
    kind, experiment, target, *values, relative = row[:6]
    verdicts, commits = (tuple(text or None for text in pair) for pair in (row[6:8], row[8:]))
    values = tuple(float(text) if text else None for text in values)
    return ChangedRecord(kind, experiment, target, values, float(relative), verdicts, commits)


def read_reasons(path=REASONS):
    """Return the `ReasonFile`."""
    return msgspec.toml.decode(Path(path).read_bytes(), type=ReasonFile)
