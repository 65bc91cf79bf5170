"""Run experiments: the object that an experiment gets, its cache, and the loop over all."""

import csv
import io
import json
import math
import re
import shutil
import time
import traceback
from pathlib import Path
from typing import NamedTuple

from . import input_files
from .judge import Criterion, finite_ends, judge
from .progress import SuiteProgress
from .provenance import load_average, occupation, origin_of, provenance
from .record import PRINTED, Measurement, sealed, write_records, write_whole
from .seeding import generator
from .targets import Targets
from .verdicts import VARIANTS, judged, printed_id


class RunSetting(NamedTuple):
    """The settings that all experiments of one run share."""

    profile: str
    folder: Path                    # where results go
    seed: int = 0
    targets: Targets = Targets({})  # the papers' printed numbers
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
        self.rng = generator(setting.seed, experiment.id)
        self._setting, self._progress = setting, progress
        self._drafts, self._tables, self._failed = [], {}, False
        self._cache = Cache(setting.folder / ".parts" / experiment.id, setting.commit, setting.seed)
        self._wall, self._cpu = time.perf_counter(), time.process_time()
        self._load, self._occupied = load_average(), occupation()
        input_files.forget_declared()

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

    def record(self, target, value, *, unit=None, scale="", note="", scatter=None, **rule):
        """Record a number and return its verdict.

        Args:
            target: id of the number; if a paper prints it, its unit and its rule in
                `validation/targets` are used. By another method, or of another body, than the
                paper's, with a word of `verdicts.VARIANTS` behind it.
            value: ours; None, NaN and infinity are recorded as misses.
            unit: of the number, "1" for a ratio.
            scale: the size it was run at, against the paper's.
            note: a remark for the reader; required where a factor is given.
            scatter: by how much another run may differ, relative: see `recheck`.
            rule: of a number that is not printed: comparator, paper (the value that is expected),
                bound, factor, tolerance: see `judge`.
        """
        printed = _printed(target, self._setting.targets, rule)
        value, remark = _number(value)
        self._drafts.append({
            "target": target, "value": value, "unit": _unit(target, unit, printed),
            "scale": scale, "note": "; ".join(filter(None, (remark, note))), "scatter": scatter,
            **(_own_rule(target, rule, note) if printed is None else {"comparator": PRINTED})})
        return self._verdict(self._drafts[-1])

    def _verdict(self, draft):
        """Return the verdict on a draft of a record."""
        nowhere = dict(seconds=0.0, seed=0, command=self._command(), commit="", date="", cores=1)
        return judged(Measurement(**draft, **nowhere), self._setting.targets).verdict

    def note(self, text):
        """Record a remark on the entire experiment: a record without a value, under its id."""
        self.record(self.experiment.id, None, unit="", comparator="remark", note=text)

    def table(self, name, columns, rows):
        """Write `<id>.<name>.csv`. Raises ValueError where a row does not fit the columns."""
        if not re.fullmatch(r"[a-z0-9_-]+", name):
            raise ValueError(f"table {name!r}: expected lower-case letters, digits, _ and -")
        for row in rows:
            if len(row) != len(columns):
                raise ValueError(f"table {name}: {len(row)} entries {row} for columns {columns}")
        self._tables[name] = csv_bytes(columns, rows)

    def fail(self, error):
        """Record that the experiment raised; earlier records stay."""
        self._failed = True
        self.record(self.experiment.id, None, unit="", comparator="runs",
                    note=f"failed: {type(error).__name__}: {error}")

    def finish(self):
        """Write records and tables, remove tables of an earlier run, and return the records.

        The first record has the origin of all, and the seal.
        """
        common = {
            "seconds": round(time.perf_counter() - self._wall, 3),
            "cpu_seconds": round(time.process_time() - self._cpu, 3),
            "seed": self.seed, "command": self._command(),
            "workers": self._setting.workers, **provenance(self._setting.commit)}
        self._drafts[0]["origin"] = origin_of(self.experiment.function, self._load,
                                              self._occupied)
        records = sealed([Measurement(**draft, **common) for draft in self._drafts], self._tables)
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


def _printed(target, targets, rule):
    """Return the printed `Target` of an id, None where none is printed.

    Raises ValueError where a rule is given for a printed number, whose rule is in
    `validation/targets` alone, and where the number repeats another.
    """
    base, _ = printed_id(target, targets)
    if base is None:
        return None
    if rule:
        raise ValueError(f"{target}: {', '.join(rule)} given, but the number is printed: its rule "
                         f"is in validation/targets/; drop it, or put one of {[*VARIANTS]} behind "
                         "the id where the method is not the paper's")
    if targets[base].again:
        raise ValueError(f"{target} repeats {targets[base].again}: record that one alone")
    return targets[base]


def _own_rule(target, rule, note):
    """Return the fields of a record that judge a check of our own."""
    if "comparator" not in rule:
        raise ValueError(f"{target} is no printed target: comparator= must be given")
    criterion = Criterion(**rule)
    if criterion.factor is not None and not note:
        raise ValueError(f"{target}: factor = {criterion.factor} widens it; say why in note=")
    _, interval = judge(0.0, criterion)
    return {"comparator": criterion.comparator, "paper": criterion.paper,
            "bound": finite_ends(interval)}


def _unit(target, unit, printed):
    if printed is None:
        return "1" if unit is None else unit
    if unit not in (None, printed.unit):
        raise ValueError(f"{target}: unit {unit!r}, but the paper's number is in {printed.unit!r}")
    return printed.unit


def _number(value):
    """Return the value as JSON can hold it, and a remark where it cannot."""
    if value is None:
        return None, ""
    value = value.item() if hasattr(value, "item") else value
    if not math.isfinite(value):
        return None, f"the run gave {value}"
    return value, ""


def csv_bytes(columns, rows):
    """Return a table as the content of a CSV file."""
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
    return ExperimentOutcome(experiment.id, _summary(run.finish(), setting.targets, raised), raised)


def _summary(records, targets, raised):
    verdicts = [judged(record, targets).verdict for record in records]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}"
                       for verdict in ("pass", "better", "miss"))
    return f"{'FAILED' if raised else 'done'} in {records[0].seconds:.1f} s, {counts}"
