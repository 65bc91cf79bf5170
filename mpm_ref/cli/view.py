"""Implement `mpm-ref plot | animate | export | scenes`: show results and list scenes."""

from pathlib import Path
from typing import Annotated

import typer

from .. import plotting, scene
from ..store.atomic import require_place
from ..store.results import SCALARS, Results
from ..store.vtkhdf import export_grid, export_particles
from .catalogue import bundled_scenes
from .errors import exit_on_errors, options
from .options import PICTURES, Json, require_ending
from .terminal import print_titles

ResultsFile = Annotated[Path, typer.Argument(metavar="FILE", help="A results file.")]
Scalar = Annotated[str, typer.Option(help=f"Field shown by colour: {', '.join(SCALARS)}.")]
View = Annotated[str | None, typer.Option(help="Axes to the right and upwards, such as xz.")]


def plot(
    file: ResultsFile,
    frame: Annotated[int, typer.Option(help="Frame, counted from 0; -1 is the last.")] = -1,
    field: Scalar = "speed",
    view: View = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Picture (.png, .pdf or .svg), default: FILE.png.")] = None,
):
    """Plot the particles and solids of one frame (png, pdf or svg).

    In 3D, solids are cut at half the depth of the particles.
    """
    what = {"frame": frame, "field": field, "view": view_axes(view)}
    _to_file(plotting.save_plot, file, out, PICTURES, **what)


def animate(
    file: ResultsFile,
    field: Scalar = "speed",
    view: View = None,
    fps: Annotated[int, typer.Option(help="Frames per second.", min=1, max=100)] = 20,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="Animation, default: FILE.gif.")] = None,
):
    """Create a GIF animation of all frames."""
    _to_file(plotting.animate, file, out, (".gif",), field=field, view=view_axes(view), fps=fps)


def export(
    file: ResultsFile,
    grid: Annotated[bool, typer.Option("--grid", help="Export nodes, not particles.")] = False,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="File for ParaView (.vtkhdf or .hdf), default: FILE.vtkhdf.")] = None,
):
    """Export results as VTKHDF for ParaView: particles, or density and velocity of nodes."""
    _to_file(export_grid if grid else export_particles, file, out, (".vtkhdf", ".hdf"))


def scenes(json: Json = False):
    """List the bundled scenes."""
    with exit_on_errors():
        titles = {name: scene.load(path).title for name, path in bundled_scenes().items()}
        print_titles(titles, json)


def _to_file(make, file, out, suffixes, **what):
    """Make a file from results and name it."""
    out = out or file.with_suffix(suffixes[0])
    with options():
        require_ending(out, suffixes)
        if out.exists() and file.exists() and out.samefile(file):
            raise ValueError(f"--out {out}: this is the results file itself; name another file")
    with exit_on_errors(), Results(file) as results:
        require_place(out)
        make(results, out, **what)
        print(out)


def view_axes(view):
    """Return the axes (right, up) of a view such as xz as numbers; None of None."""
    if view is None:
        return None
    with options():
        if len(view) != 2 or len(set(view)) != 2 or not set(view) <= set(plotting.AXES):
            raise ValueError(f"--view {view}: expected two different axes such as xy or xz")
    return tuple(plotting.AXES.index(axis) for axis in view)
