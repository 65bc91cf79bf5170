"""The command line of the validation suite: `python -m validation --help`."""

import sys
import traceback
from functools import partial
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import typer

from figures.frame import draw_all
from mpm_ref.executor import BadScheduler, SchedulerLost

from .common import targets
from .common.cluster_run import run_on_cluster
from .common.compare import COLUMNS, changes, changes_text, stored_results
from .common.durations import HOUR, durations
from .common.parallel import run_side_by_side
from .common.progress import SuiteProgress
from .common.provenance import commit
from .common.recheck import recheck, sample
from .common.record import write_whole
from .common.registry import discover, select
from .common.renew import affordable, commit_records, due, renew_all, require_clean
from .common.report import status_table, write_report
from .common.results import RESULTS, ROOT, ProfileResults
from .common.run import RunSetting, csv_bytes, run_all
from .common.standing import (
    disturbed,
    read_markers,
    refusals,
    standing_text,
    standings,
    with_verdicts,
)
from .fingerprint.command import app as fingerprint
from .mutations.command import mutate

app = typer.Typer(help=__doc__, add_completion=False, no_args_is_help=True,
                  pretty_exceptions_enable=False)
app.add_typer(fingerprint, name="fingerprint")
app.command()(mutate)

Profile = Annotated[
    Literal["quick", "standard", "paper"],
    typer.Option(help="quick: about a minute at most each; standard: hours in all; paper: as "
                 "printed")]
Folder = Annotated[Path, typer.Option("--results", help="holds a folder for each profile")]
Workers = Annotated[int, typer.Option(min=1, help="experiments at a time, sharing the cores")]
Scheduler = Annotated[str | None, typer.Option(
    metavar="local:N|tcp://HOST:PORT", help="dask cluster that runs the experiments instead, a "
    "thread each; its workers need the results folder under the same path")]
Strict = Annotated[
    bool, typer.Option("--strict", help="exit code 1 where records are edited or orphaned, or not "
                       "current and not marked in stale.toml")]
Ids = Annotated[list[str] | None, typer.Argument(help="ids or their leading parts; none: all")]


@app.command("list")
def list_experiments(profile: Profile = "quick", results: Folder = RESULTS):
    """All experiments, the seconds that each is expected to take at one profile, and the time of
    the whole.
    """
    catalogue = discover()
    typer.echo(f"{'experiment':<44} {profile:>10}  title")
    for e in catalogue.experiments.values():
        cost = f"{e.seconds(profile):.0f} s" if profile in e.profiles else "—"
        typer.echo(f"{e.id:<44} {cost:>10}  {e.title}")
    typer.echo(f"—: does not run at the {profile} profile; --profile shows another one")
    stored = ProfileResults(results / profile)
    try:
        typer.echo(durations(catalogue.experiments.values(), stored, profile).sentence)
    except ValueError as damaged:
        typer.echo(f"{damaged}", err=True)
        raise typer.Exit(2) from None
    raise typer.Exit(_report_broken(catalogue.broken))


@app.command()
def run(ids: Ids = None, profile: Profile = "quick", seed: int = 0, results: Folder = RESULTS,
        workers: Workers = 1, scheduler: Scheduler = None):
    """Run experiments, draw their figures and write the report.

    A miss is a result; only an experiment or a figure that raises makes the exit code 1.
    """
    catalogue = discover()
    try:
        chosen = select(catalogue.experiments, ids, profile)
    except ValueError as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    folder = results / profile
    printed = targets.load()
    setting = RunSetting(profile, folder, seed, printed, commit(ROOT))
    try:
        failed = (run_on_cluster(chosen, setting, scheduler) if scheduler else
                  run_side_by_side(chosen, setting, workers) if workers > 1 else
                  run_all(chosen, setting))
    except (BadScheduler, SchedulerLost) as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    undrawn = draw_all(ProfileResults(folder), about=[e.id for e in chosen],
                       workers=workers).failed
    _write_report(folder, profile, printed)
    for name in (*failed, *(f"figure {name}" for name in undrawn)):
        typer.echo(f"failed: {name}", err=True)
    raise typer.Exit(max(_report_broken(catalogue.broken), int(bool(failed or undrawn))))


@app.command()
def report(profile: Profile = "quick", results: Folder = RESULTS):
    """Write report.html and report.md from the results there are."""
    folder = results / profile
    if not ProfileResults(folder).ids():
        typer.echo(f"no results in {folder}; `python -m validation run` makes them", err=True)
        raise typer.Exit(2)
    _write_report(folder, profile, targets.load())


@app.command()
def status(profile: Profile = "standard", results: Folder = RESULTS, strict: Strict = False):
    """Print the verdicts on the papers' printed results, and which records are not current."""
    stored, catalogue, printed = ProfileResults(results / profile), discover(), targets.load()
    typer.echo(status_table(stored, printed))
    found = standings(stored, catalogue.experiments)
    typer.echo("\n" + standing_text(found))
    if beside := disturbed(stored, printed):
        typer.echo(f"{len(beside)} with judged times measured beside other work: "
                   f"{', '.join(beside)}")
    wrong = refusals(found, read_markers(results, profile), with_verdicts(stored, printed))
    for sentence in wrong if strict else ():
        typer.echo(sentence, err=True)
    raise typer.Exit(max(_report_broken(catalogue.broken), int(strict and bool(wrong))))


@app.command()
def renew(
        ids: Ids = None, profile: Profile = "standard",
        hours: Annotated[float | None, typer.Option(
            min=0.0, help="CPU time of the experiments, as recorded, without the start of their "
            "processes; default: of all")] = None,
        times: Annotated[bool, typer.Option("--times", help="those with judged times, or without "
                                            "records, instead; each once other processes are idle")]
        = False,
        commits: Annotated[bool, typer.Option("--commit", help="commit each record")] = False,
        workers: Workers = 1):
    """Run the experiments whose published records are not of today's source, the cheapest first.

    Each runs in a process of its own and loses its marker in stale.toml. An interrupted renewal
    goes on where it stopped. The exit code is 1 where an experiment raised.
    """
    catalogue, folder, printed, source = discover(), RESULTS / profile, targets.load(), commit(ROOT)
    setting = RunSetting(profile, folder, 0, printed, source, workers)
    keep = partial(commit_records, ROOT, setting) if commits else lambda _: None
    try:
        require_clean(source)
        if times and workers > 1:
            raise ValueError(f"--times with --workers {workers}: times are measured one experiment "
                             "at a time; leave out one of the two options")
        chosen = select(catalogue.experiments, ids, profile)
        all_due = due(ProfileResults(folder), chosen, profile, printed, timed=times)
        found = affordable(all_due, None if hours is None else hours * HOUR)
        typer.echo(f"{len(found)} of {len(all_due)} experiments that are due, "
                   f"{sum(one.seconds for one in found) / HOUR:.2f} h of CPU time as recorded")
        with SuiteProgress([one.experiment.seconds(profile) for one in found]) as progress:
            failed = renew_all([one.experiment for one in found], setting, progress, timed=times,
                               source=partial(commit, ROOT), commit=keep)
    except (ValueError, CalledProcessError) as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    _write_report(folder, profile, printed)
    for id in failed:
        typer.echo(f"failed: {id}; its old records are left", err=True)
    raise typer.Exit(max(_report_broken(catalogue.broken), int(bool(failed))))


@app.command("recheck")
def recheck_sample(
        profile: Profile = "standard", results: Folder = RESULTS,
        count: Annotated[int, typer.Option("--sample", min=1, help="experiments to run")] = 5,
        seed: Annotated[int | None, typer.Option(help="draw them; else the cheapest")] = None):
    """Run stored experiments again and list the numbers that differ by more than their scatter.

    The stored records stay as they are. The exit code is 1 where a number differs.
    """
    stored, catalogue = ProfileResults(results / profile), discover()
    setting = RunSetting(profile, stored.folder, targets=targets.load(), commit=commit(ROOT))
    differ = False
    for experiment in sample(stored, catalogue.experiments, count, seed):
        with TemporaryDirectory() as folder:
            found = recheck(experiment, stored, setting, folder)
        differ = differ or bool(found)
        typer.echo(f"{experiment.id}: {len(found)} numbers differ" if found else
                   f"{experiment.id}: the same")
        for one in found:
            typer.echo(f"  {one.target}: {one.stored} stored, {one.new} now")
    raise typer.Exit(max(_report_broken(catalogue.broken), int(differ)))


@app.command()
def compare(
        old: Annotated[str, typer.Argument(help="a results folder, or a commit that has one")],
        new: Annotated[str, typer.Argument(
            help="a results folder, or a commit that has one", show_default="results")]
        = str(RESULTS),
        profile: Profile = "standard",
        table: Annotated[Path | None, typer.Option(
            metavar="FILE", help="write the changes as CSV too")] = None):
    """List verdicts that changed between two sets of records, and numbers that moved by more than
    their scatter.

    Printed numbers are judged by the rules of today, own checks by the rule of the new record. The
    exit code is 1 where a verdict got worse or an experiment raised; lost numbers do not count.
    """
    try:
        with stored_results(old, profile) as before, stored_results(new, profile) as after:
            found = changes(before, after, targets.load())
    except ValueError as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    typer.echo(changes_text(found))
    if table:
        write_whole(table, csv_bytes(COLUMNS, [one.row for one in found]))
    raise typer.Exit(int(any(one.kind == "worse" for one in found)))


def _write_report(folder, profile, printed):
    for path in write_report(folder, profile, printed):
        typer.echo(f"wrote {path}")


def _report_broken(broken):
    """1 and the reasons where modules could not be imported, else 0."""
    for module, error in broken.items():
        print(f"{module} cannot be imported:", *traceback.format_exception(error), file=sys.stderr)
    return int(bool(broken))


if __name__ == "__main__":
    app()
