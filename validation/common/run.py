"""Run experiments: the object that an experiment gets, its cache, and the loop over all."""

import csv
import io
import json
import math
import re
import shutil
import time
import traceback
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from .progress import SuiteProgress
from .provenance import provenance
from .record import (
    SAME_SIZE,
    Criterion,
    Measurement,
    finite_ends,
    judge,
    write_records,
    write_whole,
)


class RunSetting(NamedTuple):
    """The settings that all experiments of one run share."""

    profile: str
    folder: Path                    # where results go
    seed: int = 0
    targets: Mapping = MappingProxyType({})     # the papers' printed numbers by id
    commit: str = "unknown"         # of the source that runs
    workers: int = 1                # experiments at a time


class Cache:
    """The finished parts of one experiment, in a folder, so that an interrupted run can go on.

    A part belongs to a commit and a seed. Nothing is cached for a working tree with changes, which
    no commit names. All parts are removed once the experiment has ended well.
    """

    def __init__(self, folder, commit, seed):
        self._folder, self._version = folder, f"{commit}-{seed}"
        self._has_commit = commit != "unknown" and not commit.endswith("+changes")

    def get(self, name, make):
        """Return the cached part, or make(): numbers, texts, lists of them."""
        path = self._folder / f"{name}-{self._version}.json"
        if not self._has_commit:
            return make()
        try:
            return json.loads(path.read_text())
        except (OSError, ValueError):
            text = json.dumps(make())
        write_whole(path, text.encode())
        return json.loads(text)

    def clear(self):
        """Remove all parts."""
        shutil.rmtree(self._folder, ignore_errors=True)


class Run:
    """The run of one experiment: its profile, seed and random numbers, its records and tables.

    Nothing reaches the disk before `finish`, but for what is `cached`.
    """

    def __init__(self, experiment, setting, progress):
        self.experiment, self.profile, self.seed = experiment, setting.profile, setting.seed
        self.rng = np.random.default_rng([setting.seed, zlib.crc32(experiment.id.encode())])
        self._setting, self._progress = setting, progress
        self._drafts, self._tables, self._failed = [], {}, False
        self._cache = Cache(setting.folder / ".parts" / experiment.id, setting.commit, setting.seed)
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    @property
    def folder(self):
        """The folder of the profile's results."""
        return self._setting.folder

    def progress(self, iterable, desc=""):
        """Return a bar over an iterable or a number of rounds; iterate it, or call its `update`."""
        return self._progress.inner(iterable, desc)

    def cached(self, name, make):
        """Return make(), numbers, texts and lists of them, or its value from an interrupted run.

        That run must have had the same commit and seed.
        """
        return self._cache.get(name, make)

    def choose(self, **by_profile):
        """Return the value for the profile, as in `n = run.choose(quick=16, standard=64)`."""
        if self.profile not in by_profile:
            raise ValueError(f"nothing was given for profile {self.profile!r}, only {by_profile}")
        return by_profile[self.profile]

    def record(self, target, value, *, unit=None, scale="", note="", **rule):
        """Record a number and return its verdict.

        Args:
            target: id of the number; if the papers print it, their value and unit are used.
            value: ours; None, NaN and infinity are recorded as misses.
            unit: of both numbers, "1" for a ratio.
            scale: the size it was run at, against the paper's.
            note: a remark for the reader; required where a factor is widened.
            rule: comparator, paper, bound, factor, tolerance: see `record.judge`.
        """
        printed = self._setting.targets.get(target)
        rule = _rule(target, rule, printed)
        if _widened(rule) and not note:
            raise ValueError(f"{target}: factor = {rule.factor} widens it; say why in note=")
        value, remark = _number(value)
        verdict, interval = judge(value, rule)
        self._drafts.append({
            "target": target, "value": value, "unit": _unit(target, unit, printed),
            "paper": rule.paper, "comparator": rule.comparator, "verdict": verdict,
            "bound": finite_ends(interval), "scale": scale,
            "note": "; ".join(filter(None, (remark, note)))})
        return verdict

    def note(self, text):
        """Record a remark on the entire experiment: a record without a value, under its id."""
        self.record(self.experiment.id, None, unit="", comparator="info", note=text)

    def table(self, name, columns, rows):
        """Write `<id>.<name>.csv`. Raises ValueError where a row does not fit the columns."""
        if not re.fullmatch(r"[a-z0-9_-]+", name):
            raise ValueError(f"table {name!r}: expected lower-case letters, digits, _ and -")
        for row in rows:
            if len(row) != len(columns):
                raise ValueError(f"table {name}: {len(row)} entries {row} for columns {columns}")
        self._tables[name] = _csv(columns, rows)

    def fail(self, error):
        """Record that the experiment raised; earlier records stay."""
        self._failed = True
        self.record(self.experiment.id, None, unit="", comparator="runs",
                    note=f"failed: {type(error).__name__}: {error}")

    def finish(self):
        """Write records and tables, remove tables of an earlier run, and return the records."""
        common = {
            "seconds": round(time.perf_counter() - self._wall, 3),
            "cpu_seconds": round(time.process_time() - self._cpu, 3),
            "seed": self.seed, "command": self._command(),
            "workers": self._setting.workers, **provenance(self._setting.commit)}
        records = [Measurement(**draft, **common) for draft in self._drafts]
        self._write_tables()
        write_records(self._setting.folder / f"{self.experiment.id}.json", records)
        if not self._failed:
            self._cache.clear()
        return records

    def _command(self):
        seed = f" --seed {self.seed}" if self.seed else ""
        return f"python -m validation run {self.experiment.id} --profile {self.profile}{seed}"

    def _write_tables(self):
        folder, id = self._setting.folder, self.experiment.id
        for file in folder.glob(f"{id}.*.csv"):
            name = file.stem.removeprefix(f"{id}.")
            if "." not in name and name not in self._tables:
                file.unlink()
        for name, content in self._tables.items():
            write_whole(folder / f"{id}.{name}.csv", content)


def _rule(target, given, printed):
    """Return the rule, completed by the printed number."""
    if printed is None:
        if "comparator" not in given:
            raise ValueError(f"{target} is no printed target: comparator= must be given")
        return Criterion(**given)
    if given.get("paper", printed.value) != printed.value:
        raise ValueError(f"{target}: paper = {given['paper']}, but it prints {printed.value}")
    return Criterion(**{"comparator": printed.comparator, **given, "paper": printed.value})


def _unit(target, unit, printed):
    if printed is None:
        return "1" if unit is None else unit
    if unit not in (None, printed.unit):
        raise ValueError(f"{target}: unit {unit!r}, but the paper's number is in {printed.unit!r}")
    return printed.unit


def _widened(rule):
    return rule.factor is not None and rule.factor > (SAME_SIZE if rule.comparator == "~" else 1.0)


def _number(value):
    """Return the value as JSON can hold it, and a remark where it cannot."""
    if value is None:
        return None, ""
    value = value.item() if hasattr(value, "item") else value
    if not math.isfinite(value):
        return None, f"the run gave {value}"
    return value, ""


def _csv(columns, rows):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue().encode()


class ExperimentOutcome(NamedTuple):
    """The outcome of an experiment."""

    id: str
    summary: str                    # for a reader: seconds, numbers of verdicts
    raised: str | None              # the traceback, if it raised


def run_all(experiments, setting):
    """Run experiments one after the other and write their results.

    Returns the ids of those that raised; the others ran all the same.
    """
    failed = []
    with SuiteProgress([e.seconds(setting.profile) for e in experiments]) as progress:
        for experiment in experiments:
            progress.begin(experiment.id, experiment.seconds(setting.profile))
            outcome = attempt(experiment, setting, progress)
            if outcome.raised:
                progress.say(outcome.raised)
                failed.append(outcome.id)
            progress.end(outcome.summary)
    return failed


def attempt(experiment, setting, progress):
    """Run an experiment and return its `ExperimentOutcome`; its records are written in any case."""
    run, raised = Run(experiment, setting, progress), None
    run.note(experiment.title)
    try:
        experiment.function(run)
    except Exception as error:
        raised = "".join(traceback.format_exception(error))
        run.fail(error)
    return ExperimentOutcome(experiment.id, _summary(run.finish(), raised), raised)


def _summary(records, raised):
    counts = {verdict: sum(r.verdict == verdict for r in records) for verdict in ("pass", "miss")}
    outcome = "FAILED" if raised else "done"
    return f"{outcome} in {records[0].seconds:.1f} s, {counts['pass']} pass, {counts['miss']} miss"
