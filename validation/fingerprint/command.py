"""The commands `python -m validation fingerprint record` and `check`."""

from pathlib import Path
from typing import Annotated

import typer

from . import adjoints, implicit, laws, ldm, nsf, oracle, scenes, training
from .compare import compare, machine_differences
from .machine import machine
from .recording import read, run_cases, selected, write

MOST = 6            # labels shown of a case that differs
MODULES = (scenes, implicit, ldm, nsf, laws, adjoints, training, oracle)    # in the order of runs

app = typer.Typer(help="Record the results of runs of every kind, to the bit, and compare them.",
                  no_args_is_help=True)

File = Annotated[Path, typer.Argument(help="JSON file of fingerprints")]
Only = Annotated[str | None, typer.Option(help='pattern of names of cases, such as "hot*"')]


@app.command()
def record(file: File, only: Only = None):
    """Run all cases and write their fingerprints. Exits with 1 where threads change bits."""
    entries = run_cases(selected(cases(), only), show)
    write(file, entries)
    typer.echo(f"wrote {file}: {summary(entries)}")
    raise typer.Exit(int(any(entry["threads_differ"] for entry in entries.values())))


@app.command()
def check(file: File, only: Only = None):
    """Run all cases and compare them with a record. Exits with 1 where anything differs."""
    reference = read(file)
    for sentence in machine_differences(reference["machine"], machine()):
        typer.echo(f"another machine: {sentence}", err=True)
    chosen = selected(cases(), only)
    names = {case.name for case in chosen}
    recorded = {name: entry for name, entry in reference["cases"].items()
                if only is None or name in names}
    entries = run_cases(chosen, show)
    differences = compare(recorded, entries)
    for name, labels in differences.items():
        more = f" and {len(labels) - MOST} more" if len(labels) > MOST else ""
        typer.echo(f"differs: {name}: {', '.join(labels[:MOST])}{more}")
    typer.echo(f"{len(differences)} of {len(recorded)} recorded cases differ: {summary(entries)}")
    threaded = any(entry["threads_differ"] for entry in entries.values())
    raise typer.Exit(int(bool(differences) or threaded))


@app.command("list")
def list_cases(only: Only = None):
    """Print the names of all cases."""
    for case in selected(cases(), only):
        typer.echo(case.name)


def cases():
    """Return all `RunCase`s, in the order in which they run."""
    return [case for module in MODULES for case in module.cases()]


def show(name, entry):
    """Print the CPU seconds of a case, and its exception or dependence on threads."""
    seconds = " ".join(f"{s:7.2f}" for s in entry["seconds"])
    typer.echo(f"{seconds} s  {name}")
    if entry["raises"] is not None:
        typer.echo(f"    raises {entry['raises']}")
    if entry["threads_differ"]:
        typer.echo(f"    threads change {', '.join(entry['threads_differ'][:MOST])}")


def summary(entries):
    """Return the numbers of cases and of exceptions, and the CPU seconds, as text."""
    raising = sum(entry["raises"] is not None for entry in entries.values())
    seconds = sum(sum(entry["seconds"]) for entry in entries.values())
    return f"{len(entries)} cases, {raising} raise, {seconds:.0f} CPU seconds"
