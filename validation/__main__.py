"""The command line of the validation suite: `python -m validation --help`."""

import sys
import traceback
from pathlib import Path
from typing import Annotated, Literal

import typer

from figures.frame import draw_all

from .common import targets
from .common.parallel import run_side_by_side
from .common.provenance import commit
from .common.registry import discover, select
from .common.report import status_table, write_report
from .common.results import RESULTS, ROOT, ProfileResults
from .common.run import RunSetting, run_all
from .fingerprint.command import app as fingerprint

app = typer.Typer(help=__doc__, add_completion=False, no_args_is_help=True,
                  pretty_exceptions_enable=False)
app.add_typer(fingerprint, name="fingerprint")

Profile = Annotated[
    Literal["quick", "standard", "paper"],
    typer.Option(help="quick: a minute at most each; standard: hours in all; paper: as printed")]
Folder = Annotated[Path, typer.Option("--results", help="holds a folder for each profile")]
Workers = Annotated[int, typer.Option(min=1, help="experiments at a time, sharing the cores")]
Ids = Annotated[list[str] | None, typer.Argument(help="ids or their leading parts; none: all")]


@app.command("list")
def list_experiments(profile: Profile = "quick"):
    """All experiments and the seconds that each is expected to take at one profile."""
    catalogue = discover()
    typer.echo(f"{'experiment':<44} {profile:>10}  title")
    for e in catalogue.experiments.values():
        cost = f"{e.seconds(profile):.0f} s" if profile in e.profiles else "—"
        typer.echo(f"{e.id:<44} {cost:>10}  {e.title}")
    typer.echo(f"—: does not run at the {profile} profile; --profile shows another one")
    raise typer.Exit(_report_broken(catalogue.broken))


@app.command()
def run(ids: Ids = None, profile: Profile = "quick", seed: int = 0, results: Folder = RESULTS,
        workers: Workers = 1):
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
    if workers > 1:
        failed = run_side_by_side(chosen, setting, workers)
    else:
        failed = run_all(chosen, setting)
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
def status(profile: Profile = "standard", results: Folder = RESULTS):
    """Print the verdicts of all experiments as a Markdown table."""
    typer.echo(status_table(ProfileResults(results / profile), targets.load()))


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
