"""Run experiments as they are and broken, each time in a new process, and compare the verdicts."""

import math
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from ..common.parallel import Silent, experiment_of
from ..common.results import ProfileResults
from ..common.run import attempt
from ..common.verdicts import judged
from ..hot import warm_states
from .patch import apply


class Outcome(NamedTuple):
    """The checks of an experiment that pass as it is, and those of them that a mutation breaks."""

    experiment: str
    mutation: str
    passing: frozenset      # ids of records that a rule judges
    broken: frozenset       # of these, which miss
    raised: bool            # the broken experiment ended in an error


def run_in_new_process(ids, setting, mutation=None, find=experiment_of):
    """Run experiments one after the other in one new process, with a mutation or as they are.

    Return the ids of those that raised.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(run_here, ids, setting, mutation, find).result()


def run_here(ids, setting, mutation, find):
    """Break what the mutation names in this process, and run the experiments."""
    experiments = [find(id) for id in ids]
    with TemporaryDirectory() as folder:
        if mutation is not None:
            keep_cache_sound(Path(folder))
            apply(mutation)
        outcomes = [attempt(one, setting, Silent()) for one in experiments]
    return [one.id for one in outcomes if one.raised]


def keep_cache_sound(folder):
    """Let the states of HOT's scenes be read from, and written to, a copy in a folder."""
    sound = warm_states.cache_folder()
    if sound.is_dir():
        shutil.copytree(sound, folder / "warm_states" / sound.name)
    warm_states.cache_folder = partial(warm_states.cache_folder, folder)


def compare(experiment_id, mutation, sound, broken, targets):
    """Return the `Outcome` from the folders of a profile's results, sound and broken."""
    before, after = (verdicts(folder, experiment_id, targets) for folder in (sound, broken))
    passing = frozenset(id for id, verdict in before.items() if verdict != "miss")
    missing = frozenset(id for id in passing if after.get(id) == "miss")
    raised = any(record.comparator == "runs"
                 for record in ProfileResults(broken).records(experiment_id))
    return Outcome(experiment_id, mutation.name, passing, missing, raised)


def verdicts(folder, experiment_id, targets):
    """Return {id of a record: verdict} of an experiment's records that a rule can make a miss."""
    found = {}
    for record in ProfileResults(folder).records(experiment_id):
        one = judged(record, targets)
        if one.kind != "remark" and any(map(math.isfinite, one.interval)):
            found[record.target] = one.verdict
    return found
