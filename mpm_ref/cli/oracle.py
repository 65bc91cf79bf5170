"""`mpm-ref oracle record | check`: golden files, to check other codes by (see `oracle`)."""

from math import inf
from pathlib import Path
from typing import Annotated

import typer

from .. import oracle, scene
from ..store.text import counted
from .catalogue import find_scene, require_other_file
from .errors import at_start, exit_on_errors, options
from .options import SceneName
from .terminal import compiling, warn

DEPARTS = 1      # exit status of a check in which an array departs

app = typer.Typer(no_args_is_help=True, help="Record golden files, and check other codes against "
                  "them.")


@app.command()
def record(
    name: SceneName,
    out: Annotated[Path, typer.Option("--out", "-o", help="Golden file.")] = Path("golden.h5"),
    steps: Annotated[int, typer.Option(help="Number of steps to record.")] = 3,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a golden file.")] = False,
    begin: Annotated[int, typer.Option(help="Steps to make before the recorded ones.")] = 0,
    eps: Annotated[float | None, typer.Option(help="Tolerance of implicit steps.")] = None,
    adjoint: Annotated[bool, typer.Option("--adjoint", help="Record gradients too.")] = False,
):
    """Run the first steps of a scene and record every stage with the tolerance of each number."""
    with exit_on_errors():
        path = find_scene(name)
        with options(), at_start(path), compiling():
            require_other_file(path, out)
            if eps is not None and not 0.0 < eps < inf:
                raise ValueError(f"--eps {eps}: expected a tolerance, a finite number > 0")
            if adjoint and eps is not None:
                raise ValueError(f"--adjoint with --eps {eps}: implicit steps have no adjoint, and "
                                 "explicit ones solve nothing; leave out one of the two options")
            problem, idle = scene.build(scene.load(path), str(path)), ()
            if adjoint:
                oracle.record_adjoint(problem, out, steps, overwrite, begin)
            else:
                idle = oracle.record(problem, out, steps, overwrite, begin, eps)
        warn(nothing_to_solve(idle))
        print(f"{out}: {counted(steps, 'step')} of {problem.title or name}")


def nothing_to_solve(steps):
    """Return the warnings about recorded steps that do not test a solver: one, or none."""
    if not steps:
        return []
    which = ", ".join(map(str, steps))
    return [f"nothing to solve in {'step' if len(steps) == 1 else 'steps'} {which}: dv is 0 "
            "everywhere after 0 iterations; to test a solver, record later steps with --begin, "
            "when something moves or is in contact"]


@app.command()
def check(
    golden: Annotated[Path, typer.Argument(metavar="GOLDEN", help="A golden file.")],
    other: Annotated[Path, typer.Argument(metavar="OTHER", help="Arrays of the other code.")],
    precision: Annotated[str, typer.Option(help="f64, f32, or auto: that of the arrays.")] = "auto",
    json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
):
    """Report the first deviating stage, where and by how much.

    Exit status: 0 no deviation, 1 a deviation, or nothing to compare, 2 bad input.
    """
    with exit_on_errors(), options():
        report = oracle.check(golden, other, precision)
    print(report.json if json else report)
    raise typer.Exit(0 if report.agrees else DEPARTS)
