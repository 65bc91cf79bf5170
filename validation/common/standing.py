"""Compare stored records with the source of today: current, stale, edited by hand, or orphaned.

`results/stale.toml` marks records that are known to be of another source, each with its reason.
"""

from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import msgspec

from .input_files import hash_now
from .recheck import TIME_NOTE, is_timed
from .record import seal_of
from .source_digest import ROOT, source_digest
from .verdicts import judged

QUIET = 0.1             # cores that others keep busy, in the mean, up to which times are judged
MARKERS = "stale.toml"  # in the folder that holds the profiles
HEADING = "[[marker]]"  # of one of them in that file

WORDS = {       # of states, as the command line lists them
    "edited": "changed by hand after they were made",
    "stale": "made by another source, or from other data files, than today's",
    "orphaned": "of experiments that do not exist any more",
    "early": "made before records had digests and seals",
}
MARKED = ("stale", "early")     # states that a marker excuses
NEVER = ("edited", "orphaned")  # states that nothing excuses


class Marker(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Records of a profile that are known not to be current: patterns of ids, and why."""

    profile: str
    ids: list[str]
    reason: str


class MarkerFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of `results/stale.toml`."""

    marker: list[Marker] = []


class Standing(NamedTuple):
    """The state of an experiment's records: a word of WORDS, or "current"."""

    experiment: str
    state: str


def standings(results, experiments, root=ROOT):
    """Return the `Standing` of all records of `ProfileResults`; experiments: those of today."""
    return [Standing(id, state_of(results, id, experiments.get(id), root)) for id in results.ids()]


def state_of(results, experiment_id, experiment, root=ROOT):
    """Return the state of the records of an experiment."""
    records = results.records(experiment_id)
    origin = records[0].origin
    tables = results.table_bytes(experiment_id)
    if origin and origin.seal and origin.seal != seal_of(records, tables):
        return "edited"
    if experiment is None:
        return "orphaned"
    if not (origin and origin.digest):
        return "early"
    current = source_digest(experiment.function.__module__, root)
    same_inputs = all(hash_now(path, root) == known for path, known in origin.inputs.items())
    return "current" if origin.digest == current and same_inputs else "stale"


def read_markers(folder, profile):
    """Return the `Marker`s of a profile; folder: holds the profiles."""
    file = Path(folder) / MARKERS
    if not file.is_file():
        return []
    markers = msgspec.toml.decode(file.read_bytes(), type=MarkerFile).marker
    return [marker for marker in markers if marker.profile == profile]


def refusals(all_standings, markers, judged_ids):
    """Return sentences on what a strict check refuses.

    That is a judged record that is not current and has no marker, one that was edited or has no
    experiment, and a pattern of a marker that marks nothing. judged_ids: experiments with verdicts.
    """
    patterns = {pattern for marker in markers for pattern in marker.ids}
    excused = {one.experiment for one in all_standings if one.state in MARKED}
    found = [f"{one.experiment}: {WORDS[one.state]}" for one in all_standings
             if one.state in NEVER or (one.state in MARKED and one.experiment in judged_ids
                                       and not matches(one.experiment, patterns))]
    return found + [f"{MARKERS}: {pattern!r} marks nothing that is not current; remove it"
                    for pattern in sorted(patterns)
                    if not any(fnmatchcase(id, pattern) for id in excused)]


def matches(experiment_id, patterns):
    """Return whether the id of an experiment matches one of the patterns."""
    return any(fnmatchcase(experiment_id, pattern) for pattern in patterns)


def with_verdicts(results, targets):
    """Return the ids of experiments with a record that is judged."""
    return {id for id in results.ids() if any(
        judged(record, targets).verdict != "info" for record in results.records(id))}


def disturbed(results, targets):
    """Return the ids of experiments whose judged times were measured beside other work."""
    return [id for id in results.ids() if was_disturbed(results.records(id), targets)]


def was_disturbed(records, targets):
    """Return whether records have a judged time, and other processes more than QUIET cores."""
    origin = records[0].origin
    return bool(origin and origin.others is not None and origin.others > QUIET and any(
        is_judged_time(record, judged(record, targets)) for record in records))


def is_judged_time(record, one):
    """Return whether a record with its `Judged` is a time, or a ratio of times, with a verdict.

    Of our own checks a number in seconds is one of the motion, unless its note says CPU or wall.
    """
    if one.verdict == "info":
        return False
    if one.target:
        return one.target.kind in ("time", "speedup")
    return is_timed(record) and (record.unit != "s" or bool(TIME_NOTE.search(record.note)))


def standing_text(all_standings):
    """Return the lists of all experiments that are not current, as lines of text."""
    by_state = {}
    for one in all_standings:
        by_state.setdefault(one.state, []).append(one.experiment)
    lines = [f"{len(by_state.get('current', []))} of {len(all_standings)} experiments are current"]
    lines += [f"{len(by_state[state])} {words}: {', '.join(by_state[state])}"
              for state, words in WORDS.items() if state in by_state]
    return "\n".join(lines)
