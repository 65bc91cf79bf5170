"""Draw figures from results: `python -m figures [NAME...] --profile P`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from validation.results import RESULTS, Results

from .frame import draw_all


def main(
    names: Annotated[list[str] | None, typer.Argument(help="figures; none: all")] = None,
    profile: Literal["quick", "standard", "paper"] = "quick",
    results: Annotated[Path, typer.Option(help="where results/<profile>/ stands")] = RESULTS,
):
    """Draw the figures whose results are there, as PNG and PDF."""
    try:
        failed = draw_all(Results(results / profile), names=names or ())
    except ValueError as error:
        typer.echo(f"{error}", err=True)
        raise typer.Exit(2) from None
    raise typer.Exit(int(bool(failed)))


if __name__ == "__main__":
    typer.run(main)
