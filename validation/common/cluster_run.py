"""Run experiments on a dask cluster, whose workers write into a results folder of all machines."""

from functools import partial

from mpm_ref.executor import open_executor

from .parallel import attempt_in_process, experiment_of
from .progress import SuiteProgress


def run_on_cluster(experiments, setting, scheduler, find=experiment_of):
    """Run experiments like `run.run_all` on the workers of a scheduler, the longest first.

    scheduler: see `open_executor`. Each worker has one thread. Returns the ids of those that
    raised. Raises BadScheduler and SchedulerLost; what has finished is written.
    """
    longest = sorted(experiments, key=lambda e: -e.seconds(setting.profile))
    failed = []
    with (open_executor(scheduler) as executor,
          SuiteProgress([e.seconds(setting.profile) for e in experiments]) as progress):
        setting = setting._replace(folder=setting.folder.resolve(), workers=executor.workers)
        run_one = partial(attempt_in_process, find, setting=setting)
        for outcome in executor.run(run_one, [e.id for e in longest]):
            experiment = longest[outcome.index]
            summary, raised = texts_of(outcome)
            if raised:
                progress.say(raised)
                failed.append(experiment.id)
            progress.ended(experiment.id, experiment.seconds(setting.profile), summary)
    return failed


def texts_of(outcome):
    """Return (summary, traceback or None) of a `TaskOutcome`."""
    if outcome.error is not None:
        return "FAILED: it did not end", outcome.traceback or outcome.error
    return outcome.value.summary, outcome.value.raised
