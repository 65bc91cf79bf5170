"""Compare stored records with the source of today: current, stale, edited by hand, or orphaned."""

from typing import NamedTuple

from .record import seal_of
from .source_digest import ROOT, source_digest

WORDS = {       # of states, as the command line lists them
    "edited": "changed by hand after they were made",
    "stale": "made by another source than today's",
    "orphaned": "of experiments that do not exist any more",
    "early": "made before records had digests and seals",
}
WRONG = ("edited", "stale", "orphaned")     # states that a strict check does not accept


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
    return "current" if origin.digest == current else "stale"


def standing_text(all_standings):
    """Return the lists of all experiments that are not current, as lines of text."""
    by_state = {}
    for one in all_standings:
        by_state.setdefault(one.state, []).append(one.experiment)
    lines = [f"{len(by_state.get('current', []))} of {len(all_standings)} experiments are current"]
    lines += [f"{len(by_state[state])} {words}: {', '.join(by_state[state])}"
              for state, words in WORDS.items() if state in by_state]
    return "\n".join(lines)
