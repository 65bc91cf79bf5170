"""Run stored experiments again and compare the numbers, each within the scatter that is stated.

A number of the same seed and source is expected to be the same to SAME, which allows for other
processors; a time, or a ratio of times, to TIMED; memory to MEMORY. A record may state a scatter of
its own. Numbers under ROUND_OFF are the rounding errors of a processor: any two of them count as
the same.
"""

import re
from math import inf
from pathlib import Path
from random import Random
from typing import NamedTuple

from .results import ProfileResults
from .run import RunSetting, run_all

SAME = 1e-5         # relative
ROUND_OFF = 1e-12
TIMED = 0.5         # relative to the larger: a machine that does other work too may take twice
                    # as long
MEMORY = 0.2        # relative: of a process, with its libraries and caches
TIME_UNITS = {"s", "us", "h", "CPU s", "s/frame", "s/100 frames", "s/s", "x"}
TIME_NOTE = re.compile(r"\bCPU\b|\bwall time|\bms a step\b")


class ChangedNumber(NamedTuple):
    """A number that came out otherwise; None where there was none."""

    target: str
    stored: float | None
    new: float | None
    relative: float


def sample(results, experiments, count, seed=None):
    """Return `count` experiments that have records: the cheapest, or drawn with a seed."""
    stored = [id for id in results.ids() if id in experiments]
    stored.sort(key=lambda id: results.records(id)[0].seconds)
    if seed is not None:
        Random(seed).shuffle(stored)
    return [experiments[id] for id in stored[:count]]


def recheck(experiment, results, setting, folder):
    """Run an experiment again into a folder, with the seed of its records, and return the
    `ChangedNumber`s; setting: the `RunSetting` of the profile.
    """
    seed = results.records(experiment.id)[0].seed
    run_all([experiment], RunSetting(setting.profile, Path(folder), seed, setting.targets,
                                     setting.commit))
    return differences(results.records(experiment.id),
                       ProfileResults(folder).records(experiment.id))


def differences(stored, new):
    """Return the `ChangedNumber`s of two lists of records."""
    old, again = ({r.target: r for r in records if r.comparator != "remark"}
                  for records in (stored, new))
    found = []
    for target in sorted({*old, *again}):
        a, b = (records[target].value if target in records else None for records in (old, again))
        relative = relative_difference(a, b, target in old and target in again)
        if relative > allowed(old.get(target) or again[target]):
            found.append(ChangedNumber(target, a, b, relative))
    return found


def relative_difference(a, b, both):
    """Return |a - b| over the larger, 0 for two rounding errors; infinite where one of both is
    missing.
    """
    if not both or (a is None) != (b is None):
        return inf
    if a == b or max(abs(a), abs(b)) < ROUND_OFF:
        return 0.0
    return abs(a - b) / max(abs(a), abs(b))


def allowed(record):
    """Return the relative scatter of a record's number."""
    if record.scatter is not None:
        return record.scatter
    if record.unit == "GB":
        return MEMORY
    return TIMED if is_timed(record) else SAME


def is_timed(record):
    """Return whether a record's number is a time or a ratio of times."""
    if record.unit == "%":
        return False
    return record.unit in TIME_UNITS or bool(TIME_NOTE.search(record.note))
