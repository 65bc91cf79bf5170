"""Draw figures from results: `python -m figures [NAME...] --profile P`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from validation.common.results import RESULTS, ProfileResults

from .frame import draw_all

Names = Annotated[list[str] | None, typer.Argument(
    help="figures, or the experiments whose results they show; none: all")]
Folder = Annotated[Path, typer.Option("--results", help="holds a folder for each profile")]
Workers = Annotated[int, typer.Option(min=1, help="figures at a time")]


def main(
    names: Names = None,
    profile: Literal["quick", "standard", "paper"] = "quick",
    folder: Folder = RESULTS,
    workers: Workers = 1,
):
    """Draw the figures whose results are there, as PNG and PDF.

    A figure that is named and cannot be drawn makes the exit code 1.
    """
    results = ProfileResults(folder / profile)
    try:
        if not results.ids():
            raise ValueError(f"no results in {results.folder}; make them by `python -m validation "
                             f"run ID --profile {profile}`, or give the --profile of others")
        drawn = draw_all(results, names=names or (), workers=workers)
    except ValueError as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    for name in drawn.done:
        typer.echo(f"drew {results.folder / 'figures' / name}.png and .pdf")
    raise typer.Exit(int(bool(drawn.failed or (names and drawn.left))))


if __name__ == "__main__":
    typer.run(main)
