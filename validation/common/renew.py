"""Run again the experiments whose records are not of today's source, the cheapest first.

Each runs in a process of its own. Its records replace the old ones if it ends well, and are put
back if not, so that a renewal that is interrupted goes on where it stopped. Experiments with judged
times are another renewal: each waits until other processes leave the machine alone.
"""

import json
import subprocess
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import NamedTuple

import msgspec

from .parallel import experiment_of, run_in_pool
from .provenance import busy_cores, occupation
from .record import write_whole
from .standing import (
    HEADING,
    MARKERS,
    QUIET,
    MarkerFile,
    is_judged_time,
    state_of,
    was_disturbed,
)
from .verdicts import judged

WIDTH = 100             # columns of results/stale.toml
WINDOW = 5.0            # [s] over which the work of other processes is measured


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
        timed: whether to return those with judged times, of which current ones are due too if they
            were measured beside other work, and those that have no records; or the others.
    """
    found, ids = [], set(stored.ids())
    for one in experiments:
        if profile not in one.profiles:
            continue
        records = stored.records(one.id) if one.id in ids else []
        needs_quiet = not records or has_judged_time(records, targets)
        renewed = records and state_of(stored, one.id, one) == "current" and not (
            raised(records) or was_disturbed(records, targets))
        if needs_quiet is timed and not renewed:
            found.append(DueExperiment(
                one, records[0].cpu_seconds if records else one.seconds(profile)))
    return sorted(found, key=lambda entry: (entry.seconds, entry.experiment.id))


def has_judged_time(records, targets):
    """Return whether one of the records is a time, or a ratio of times, with a verdict."""
    return any(is_judged_time(record, judged(record, targets)) for record in records)


def raised(records):
    """Return whether the run of an experiment that made the records raised."""
    return any(record.comparator == "runs" for record in records)


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


def renew_all(experiments, setting, progress, *, timed, source, commit):
    """Run experiments, as many at a time as the setting has workers, and return the ids of those
    that failed.

    Args:
        experiments: a list of `Experiment`s.
        setting: the `RunSetting`.
        progress: a `SuiteProgress`.
        timed: whether each waits for a quiet machine.
        source: called without arguments for the commit of the source, which is to stay that of
            the setting.
        commit: called with the id of each experiment that has ended well, once at a time.

    Raises ValueError where the source changes meanwhile; what was kept before stays.
    """
    lock = Lock()

    def attempt(one):
        require_same(setting.commit, source())
        if timed:
            wait_for_quiet(progress.say)
        ended = run_or_put_back(one, setting, progress, source)
        if ended:
            with lock:
                drop_marker(setting.folder.parent / MARKERS, setting.profile, one.id)
                commit(one.id)
        return ended

    with ThreadPoolExecutor(setting.workers) as pool:
        futures = [pool.submit(attempt, one) for one in experiments]
        try:
            return [one.id for one, future in zip(experiments, futures, strict=True)
                    if not future.result()]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_or_put_back(experiment, setting, progress, source):
    """Run an experiment in a process of its own and return whether it ended well; if not, its old
    files stay. Raises ValueError where the source has changed meanwhile.
    """
    old, ended = stored_files(setting.folder, experiment.id), False
    try:
        raised_ids = run_in_pool([experiment], setting, experiment_of, progress)
        require_same(setting.commit, source())
        ended = not raised_ids
    finally:
        if not ended:
            put_back(setting.folder, experiment.id, old)
    return ended


def require_same(before, now):
    """Raise ValueError where the source is not what it was."""
    if now != before:
        raise ValueError(f"the source changed from {before} to {now} meanwhile: records name one "
                         "commit; run the renewal again, in a working tree of its own")


def stored_files(folder, experiment_id):
    """Return {path: content} of the records, tables and points of an experiment."""
    paths = [*folder.glob(f"{experiment_id}.*"), *folder.glob(f"bodies/{experiment_id}.npz")]
    return {path: path.read_bytes() for path in paths}


def put_back(folder, experiment_id, files):
    """Make {path: content} the only files of an experiment again."""
    for path in stored_files(folder, experiment_id).keys() - files.keys():
        path.unlink()
    for path, content in files.items():
        write_whole(path, content)


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
    has no other id. A pattern of ids stays.
    """
    if not file.is_file():
        return
    text = file.read_text()
    markers = msgspec.toml.decode(text, type=MarkerFile).marker
    if not any((one.profile, id) == (profile, experiment_id) for one in markers for id in one.ids):
        return
    kept = []
    for one in markers:
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


def commit_records(root, setting, experiment_id):
    """Commit the records, tables and points of an experiment, and the markers that are left.

    Raises subprocess.CalledProcessError; git has said why.
    """
    paths = [setting.folder / f"{experiment_id}.*"]
    paths += [path for path in (setting.folder / "bodies" / f"{experiment_id}.npz",
                                setting.folder.parent / MARKERS) if path.exists()]
    message = f"Record of {experiment_id}, {setting.profile}"
    for arguments in (("add", "--all"), ("commit", "--quiet", "--message", message)):
        subprocess.run(["git", *arguments, "--", *paths], cwd=root, check=True)


def require_clean(source):
    """Raise ValueError where a commit does not name the source."""
    if source == "unknown" or source.endswith("+changes"):
        raise ValueError(f"the source is {source}: records that replace published ones need a "
                         "commit; commit the changes, or put them aside, and try again")
