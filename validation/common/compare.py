"""Compare two sets of records: verdicts that changed, and numbers that moved by more than their
scatter.

Printed numbers of both sets are judged by the rules of today, and a check of our own by the rule of
the new set's record, so that a change of verdict is one of the number.
"""

import subprocess
import tarfile
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec

from .recheck import allowed, relative_difference
from .results import ROOT, ProfileResults
from .verdicts import judged

RANK = {"miss": 0, "uncredited": 1, "chosen": 1, "pass": 2, "better": 3}    # of a judged number
UNJUDGED = ("info", "chosen", "uncredited")     # verdicts that are no improvement of a miss
KINDS = ("worse", "improved", "other verdict", "lost", "new", "moved")
COLUMNS = ("kind", "experiment", "target", "old", "new", "relative", "old_verdict", "new_verdict",
           "old_commit", "new_commit")


class ChangedRecord(NamedTuple):
    """A number that two sets of records have otherwise; None where a set has none."""

    kind: str               # of KINDS
    experiment: str
    target: str
    values: tuple           # of the old set and the new one
    relative: float         # |new - old| over the larger; infinite where one of both is missing
    verdicts: tuple
    commits: tuple

    @property
    def row(self):
        """The row of a table with COLUMNS."""
        return (self.kind, self.experiment, self.target, *self.values, self.relative,
                *self.verdicts, *self.commits)

    @property
    def sentence(self):
        """The change in a line."""
        (a, b), (c, d), (e, f) = (tuple("none" if one is None else
                                        f"{one:.6g}" if isinstance(one, float) else str(one)
                                        for one in pair)
                                  for pair in (self.values, self.verdicts, self.commits))
        verdict = c if c == d else f"{c} -> {d}"
        return f"{self.target}: {a} -> {b} ({verdict}; {e}..{f})"


@contextmanager
def stored_results(where, profile):
    """Give the `ProfileResults` of a folder that holds profiles, or those of a commit of the
    repository. Raises ValueError where it is neither, or has no records of the profile.
    """
    with TemporaryDirectory() as scratch:
        folder = Path(where) if Path(where).is_dir() else results_of_commit(where, profile, scratch)
        stored = ProfileResults(folder / profile)
        if not stored.ids():
            raise ValueError(f"{where} has no records of the profile {profile!r}: expected a "
                             "folder like results/, or a commit that has some")
        yield stored


def results_of_commit(commit, profile, scratch):
    """Unpack the records of a commit into a folder `scratch` and return the folder of profiles."""
    command = ["git", "archive", "--format=tar", "--end-of-options", commit, f"results/{profile}"]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True)
    except OSError as fault:
        raise ValueError(f"{commit} is no folder, and git, which has commits, cannot be run: "
                         f"{fault}") from None
    if done.returncode:
        raise ValueError(f"{commit} is neither a folder nor a commit with results/{profile}: "
                         f"{done.stderr.decode().strip()}")
    with tarfile.open(fileobj=BytesIO(done.stdout)) as archive:
        archive.extractall(scratch, filter="data")
    return Path(scratch) / "results"


def changes(old, new, targets):
    """Return the `ChangedRecord`s of two `ProfileResults`, by kind, those of the largest change
    first; targets: the `Targets` that judge both. A number that another experiment records now is
    the same number.
    """
    old, new = numbers_of(old), numbers_of(new)
    found = (changed_record(target, (old.get(target), new.get(target)), targets)
             for target in {*old, *new})
    return sorted((one for one in found if one),
                  key=lambda one: (KINDS.index(one.kind), -one.relative, one.target))


def numbers_of(results):
    """Return {target: (experiment, `Measurement`)} of all numbers of a set of records."""
    return {record.target: (experiment, record) for experiment in results.ids()
            for record in results.records(experiment) if not is_remark(record)}


def is_remark(record):
    """Return whether a record is a sentence on its experiment, for which older ones have no word of
    their own; that of an experiment that raised is none.
    """
    if record.comparator == "runs":
        return False
    return record.comparator == "remark" or (record.value is None and not record.unit)


def changed_record(target, pair, targets):
    """Return the `ChangedRecord` of a number from (experiment, `Measurement`) of both sets, None
    where a set has none; None where nothing changed.
    """
    experiments, records = zip(*(one or (None, None) for one in pair), strict=True)
    rule = records[1] or records[0]
    values, verdicts, commits = zip(*(
        (one.value, verdict_by(rule, one.value, targets), one.commit) if one else (None, None, None)
        for one in records), strict=True)
    relative = relative_difference(*values, all(records))
    failed = records[1] is not None and records[1].comparator == "runs"
    kind = "worse" if failed else kind_of(verdicts, relative > allowed(rule))
    return kind and ChangedRecord(kind, experiments[1] or experiments[0], target, values, relative,
                                  verdicts, commits)


def verdict_by(rule, value, targets):
    """Return the verdict on a value by the rule of a `Measurement`."""
    return judged(msgspec.structs.replace(rule, value=value), targets).verdict


def kind_of(verdicts, is_different):
    """Return one of KINDS from the verdicts of the old set and the new one, None where a set has
    no such number, and whether the values differ by more than their scatter; None where nothing
    changed.
    """
    before, after = verdicts
    if after is None:
        return "lost"
    if before is None:
        return "new"
    if before == after:
        return "moved" if is_different else None
    if after == "miss":
        return "worse"
    rank = RANK.get(after, 0) - RANK.get(before, 0)
    if "info" in verdicts or rank == 0 or (rank > 0 and after in UNJUDGED):
        return "other verdict"
    return "improved" if rank > 0 else "worse"


def changes_text(records):
    """Return `ChangedRecord`s as text: for each kind their number, and a line each."""
    lines = []
    for kind in KINDS:
        group = [one for one in records if one.kind == kind]
        lines += [f"{kind}: {len(group)}", *(f"  {one.sentence}" for one in group)]
    return "\n".join(lines)
