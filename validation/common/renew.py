"""Run again the experiments whose records are not of today's source, the cheapest first.

Each runs in a process of its own, and its records replace the old ones when it has ended, so that
a renewal that is interrupted goes on where it stopped. Experiments with judged times are another
renewal: each waits until other processes leave the machine alone.
"""

import json
import subprocess
import textwrap
import time
from typing import NamedTuple

import msgspec

from .parallel import experiment_of, run_in_pool
from .provenance import busy_cores, occupation
from .record import write_whole
from .standing import HEADING, MARKERS, QUIET, MarkerFile, is_judged_time, state_of
from .verdicts import judged

WIDTH = 100             # columns of results/stale.toml
WINDOW = 5.0            # [s] over which the work of other processes is measured
BETWEEN = 1200.0        # [s] between commits


class DueExperiment(NamedTuple):
    """An experiment to run again, and its CPU seconds, as far as they are known."""

    experiment: object
    seconds: float


def due(stored, experiments, profile, targets, *, timed):
    """Return the `DueExperiment`s of a profile, the cheapest first.

    Args:
        stored: the `ProfileResults`.
        experiments: those to choose from.
        profile: of the records.
        targets: the papers' printed numbers.
        timed: whether to return those with judged times, or the others.
    """
    found = []
    for one in experiments:
        records = stored.records(one.id) if one.id in stored.ids() else []
        if (profile in one.profiles and has_judged_time(records, targets) is timed
                and not (records and is_current(stored, one))):
            found.append(DueExperiment(
                one, records[0].cpu_seconds if records else one.seconds(profile)))
    return sorted(found, key=lambda entry: (entry.seconds, entry.experiment.id))


def is_current(stored, experiment):
    """Return whether the records of an experiment are of today's source."""
    return state_of(stored, experiment.id, experiment) == "current"


def has_judged_time(records, targets):
    """Return whether one of the records is a time, or a ratio of times, with a verdict."""
    return any(is_judged_time(record, judged(record, targets)) for record in records)


def affordable(entries, seconds):
    """Return the leading `DueExperiment`s whose CPU seconds fit into so many; all if None."""
    if seconds is None:
        return list(entries)
    chosen, total = [], 0.0
    for one in entries:
        total += one.seconds
        if total > seconds:
            break
        chosen.append(one)
    return chosen


def renew_all(experiments, setting, progress, *, timed, commit, find=experiment_of):
    """Run experiments, one at a time, and return the ids of those that raised.

    Args:
        experiments: a list of `Experiment`s.
        setting: the `RunSetting`.
        progress: a `SuiteProgress`.
        timed: whether each waits for a quiet machine.
        commit: called with the ids of experiments whose records are new: every BETWEEN seconds,
            and at the end, an interruption included.
        find: see `run_side_by_side`.
    """
    failed, new, last = [], [], time.monotonic()
    try:
        for one in experiments:
            if timed:
                wait_for_quiet(progress.say)
            raised = run_in_pool([one], setting, find, progress)
            if raised:
                failed += raised
                continue
            drop_marker(setting.folder.parent / MARKERS, setting.profile, one.id)
            new.append(one.id)
            if time.monotonic() - last > BETWEEN:
                commit(new)
                new, last = [], time.monotonic()
    finally:
        if new:
            commit(new)
    return failed


def wait_for_quiet(say, window=WINDOW):
    """Return when other processes keep at most QUIET cores busy; say so while they do not."""
    waits = False
    while True:
        before = occupation()
        time.sleep(window)
        busy = busy_cores(before, occupation())
        if busy is None or busy <= QUIET:
            return
        if not waits:
            say(f"other processes keep {busy:.1f} cores busy: waiting until they end")
        waits = True


def drop_marker(file, profile, experiment_id):
    """Remove the id of an experiment from the markers of a profile in a file, and a marker that
    has no other id.
    """
    if not file.is_file():
        return
    text = file.read_text()
    kept = []
    for one in msgspec.toml.decode(text, type=MarkerFile).marker:
        ids = [id for id in one.ids if (one.profile, id) != (profile, experiment_id)]
        if ids:
            kept.append(marker_text(msgspec.structs.replace(one, ids=ids)))
    write_whole(file, "\n".join([text.partition(HEADING)[0].rstrip() + "\n", *kept]).encode())


def marker_text(marker):
    """Return a `Marker` as TOML."""
    ids = ", ".join(json.dumps(id) for id in marker.ids)
    line = f"ids = [{ids}]"
    if len(line) > WIDTH:
        lines = textwrap.fill(ids, WIDTH, initial_indent="    ", subsequent_indent="    ",
                              break_on_hyphens=False)
        line = f"ids = [\n{lines}\n]"
    return (f"{HEADING}\nprofile = {json.dumps(marker.profile)}\n{line}\n"
            f"reason = {json.dumps(marker.reason, ensure_ascii=False)}\n")


def commit_records(root, setting, ids):
    """Commit the records and tables of experiments, and the markers that are left.

    Raises subprocess.CalledProcessError; git has said why.
    """
    files = [setting.folder / f"{id}.*" for id in ids]
    if (markers := setting.folder.parent / MARKERS).is_file():
        files.append(markers)
    for arguments in (("add", "--all", "--", *files),
                      ("commit", "--quiet", "--message", f"Records of {counted(ids)}",
                       "--message", ", ".join(ids))):
        subprocess.run(["git", *arguments], cwd=root, check=True)


def counted(ids):
    """Return the id of a single experiment, else how many there are."""
    return ids[0] if len(ids) == 1 else f"{len(ids)} experiments"


def require_clean(source):
    """Raise ValueError where a commit does not name the source."""
    if source == "unknown" or source.endswith("+changes"):
        raise ValueError(f"the source is {source}: records that replace published ones need a "
                         "commit; commit the changes, or put them aside, and try again")
