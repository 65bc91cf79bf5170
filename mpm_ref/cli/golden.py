"""`mpm-ref oracle record | check`: golden files, to check other codes by (see `oracle`)."""

from pathlib import Path
from typing import Annotated

import typer

from .. import oracle, scene
from .faults import at_start, one_line, options
from .shipped import find_scene, keep_scene
from .terminal import compiling

DEPARTS = 1      # exit status of a check that another code fails

app = typer.Typer(no_args_is_help=True, help="Record golden files, and check other codes by them.")


@app.command()
def record(
    name: Annotated[str, typer.Argument(metavar="SCENE")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Golden file.")] = Path("golden.h5"),
    steps: Annotated[int, typer.Option(help="Steps to record, every stage of each.")] = 3,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a golden file.")] = False,
    begin: Annotated[int, typer.Option(help="Steps of the run to make before.")] = 0,
    eps: Annotated[float | None, typer.Option(help="Tolerance of implicit steps.")] = None,
):
    """Run the first steps of a scene and record every stage with the error of each number."""
    with one_line():
        path = find_scene(name)
        with options(), at_start(path), compiling():
            keep_scene(path, out)
            problem = scene.build(scene.load(path), str(path))
            oracle.record(problem, out, steps, overwrite, begin, eps)
        print(f"{out}: {steps} steps of {problem.title or name}")


@app.command()
def check(
    golden: Annotated[Path, typer.Argument(metavar="GOLDEN", help="A golden file.")],
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="What the other code wrote.")],
    precision: Annotated[str, typer.Option(help="f64, f32, or auto: as it is stored.")] = "auto",
    json: Annotated[bool, typer.Option("--json", help="Answer with JSON.")] = False,
):
    """Name the first stage that departs, where and by how much. Exit status 0 if none, else 1."""
    with one_line(), options():
        report = oracle.check(golden, other, precision)
    print(report.json if json else report)
    raise typer.Exit(0 if report.agrees else DEPARTS)
