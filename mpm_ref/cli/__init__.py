"""The command line `mpm-ref`: `run` and the options of all; the other commands are in `describe`,
`look`, `golden`, `rom` and `law`.
"""

from pathlib import Path
from typing import Annotated

import threadpoolctl
import typer

from .. import __version__, scene
from ..core.jit import set_threads
from ..store import UNITS, USUAL, Fields
from ..store.running import Options
from . import golden, law, look, rom
from .describe import describe
from .execute import Bar, Request, run_scene
from .faults import one_line, options
from .look import Machine
from .shipped import find_scene, keep_scene

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, add_completion=False,
                  help="The material point method, explicit and implicit: run scenes and look at "
                       "the results.")
for name, command in (("info", describe), ("plot", look.plot),
                      ("animate", look.animate), ("export", look.export),
                      ("scenes", look.scenes)):
    app.command(name)(command)
app.add_typer(golden.app, name="oracle")
app.add_typer(rom.app, name="rom")
app.add_typer(law.app, name="law")


FIELDS = f"To store, of {','.join(UNITS)}; default: {','.join(USUAL)}."
EVERY = "Steps between checkpoints, default: one a minute."
RESULTS = "Results file, default: SCENE.h5 here."
GZIP = "Compression, 1 to 9, default: none."


@app.callback(invoke_without_command=True)
def version(
    show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
):
    """Print the version, where no command is given."""
    if show:
        print(f"mpm-ref {__version__}")
        raise typer.Exit


@app.command()
def run(
    name: Annotated[str, typer.Argument(metavar="SCENE", help="A TOML file, or a shipped scene.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help=RESULTS)] = None,
    steps: Annotated[int | None, typer.Option(help="Stop after so many steps in all.")] = None,
    threads: Annotated[int | None, typer.Option(help="Number of threads, default: all.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results.")] = False,
    checkpoint_every: Annotated[int | None, typer.Option(help=EVERY)] = None,
    fields: Annotated[str | None, typer.Option(help=FIELDS)] = None,
    gzip: Annotated[int | None, typer.Option(help=GZIP)] = None,
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
        record, out = scene.load(path), out or Path(f"{path.stem}.h5")
        with options():
            keep_scene(path, out)
            how = Options(steps, checkpoint_every, stored(fields, gzip), resume, overwrite,
                          record.seed)
            use_threads(threads)
        with Bar(Request(name, out, json, quiet)) as bar:
            status = run_scene(scene.build(record, str(path)), bar, how)
        raise typer.Exit(status)


def stored(fields, gzip):
    """`Fields` of the two options; None where neither is given. Raises ValueError."""
    if fields is None and gzip is None:
        return None
    return Fields(USUAL if fields is None else tuple(fields.split(",")), gzip or 0)


def use_threads(n):
    """Let kernels and BLAS use n threads; None leaves it at all cores. Raises ValueError."""
    if n is not None:
        set_threads(n)
        threadpoolctl.threadpool_limits(n)


def main():
    """Entry point of the console script."""
    app(prog_name="mpm-ref")
