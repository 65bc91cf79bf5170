"""The command line `mpm-ref`. The commands are in `cli.execute`, `cli.look`, `cli.golden`."""

from pathlib import Path
from typing import Annotated

import threadpoolctl
import typer

from .. import __version__, scene
from ..core.jit import set_threads
from ..store import UNITS, USUAL, Fields
from ..store.running import Options
from . import golden, look
from .execute import Request, run_scene
from .faults import one_line, options
from .look import Machine
from .shipped import find_scene

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False,
                  help="Explicit material point method: run scenes and look at the results.")
for name, command in (("info", look.describe), ("plot", look.plot),
                      ("animate", look.animate), ("export", look.export),
                      ("scenes", look.scenes)):
    app.command(name)(command)
app.add_typer(golden.app, name="oracle")


@app.callback(invoke_without_command=True)
def version(
    show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
):
    """Explicit material point method: run scenes and look at the results."""
    if show:
        print(f"mpm-ref {__version__}")
        raise typer.Exit


@app.command()
def run(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A TOML file, or a shipped scene.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Results; SCENE.h5 here.")] = None,
    steps: Annotated[int | None, typer.Option(help="Stop after so many steps in all.")] = None,
    threads: Annotated[int | None, typer.Option(help="Number of threads; all.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results.")] = False,
    checkpoint_every: Annotated[int | None, typer.Option(help="Steps; one a minute.")] = None,
    fields: Annotated[str, typer.Option(help=f"To store, of {','.join(UNITS)}.")] = ",".join(USUAL),
    gzip: Annotated[int, typer.Option(help="Compression, 0 (none) to 9.")] = 0,
    json: Machine = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
):
    """Run a scene into a results file.

    Ctrl-C ends the run after the step being made, with a checkpoint; after that, or whatever else
    ends it, --resume continues bit for bit. Exit status: 0 done, 2 bad input, 3 the run became
    unstable, 4 a file could not be written, 130 Ctrl-C, 143 terminated.
    """
    with one_line():
        path = find_scene(name)
        record = scene.load(path)
        with options():
            how = Options(steps, checkpoint_every, Fields(tuple(fields.split(",")), gzip),
                          resume, overwrite, record.seed)
            use_threads(threads)
        request = Request(name, out or Path(f"{path.stem}.h5"), json, quiet)
        raise typer.Exit(run_scene(scene.build(record), request, how))


def use_threads(n):
    """Let kernels and BLAS use n threads; None leaves it at all cores. Raises ValueError."""
    if n is not None:
        set_threads(n)
        threadpoolctl.threadpool_limits(n)


def main():
    """Entry point of the console script."""
    app(prog_name="mpm-ref")
