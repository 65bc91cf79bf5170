"""Define the command line `mpm-ref`, with one module for each group of commands."""

from typing import Annotated

import typer

from .. import __version__
from . import info, law, limits, needs, oracle, rom, run, trade, view
from .terminal import tell_progress

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False,
                  help="Run scenes with the material point method, explicit or implicit, and "
                       "show the results.")
for name, command in (("run", run.run), ("info", info.describe), ("plot", view.plot),
                      ("animate", view.animate), ("export", view.export),
                      ("scenes", view.scenes),
                      ("trade", trade.measure), ("limits", limits.measure),
                      ("needs", needs.find)):
    app.command(name)(command)
app.add_typer(oracle.app, name="oracle")
app.add_typer(rom.app, name="rom")
app.add_typer(law.app, name="law")


@app.callback(invoke_without_command=True)
def version(
    show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
):
    """Run the command, or print the version."""
    if show:
        print(f"mpm-ref {__version__}")
        raise typer.Exit


def main():
    """Run the command line."""
    tell_progress()
    app(prog_name="mpm-ref")
