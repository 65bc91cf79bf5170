"""`mpm-ref law export` and `plot`: what learned laws are, and what they answer."""

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from ..materials.learned import learned_flow, learned_law, weights
from ..nclaw.export import exported, write
from ..nclaw.study.curves import curves, paths_for
from ..nclaw.study.numbers import write_curves
from ..nclaw.study.pictures import draw
from ..store.atomic import require_place
from ..store.words import counted
from .faults import one_line, options, writing
from .law_options import NUMBERS, WeightsFile, fitting, other_steps
from .outputs import PICTURES, require_ending, require_free
from .rom_options import Overwrite
from .terminal import warn

LAYERS = (".npz", ".json")


def export(
    file: WeightsFile,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.npz or FILE.json, default: WEIGHTS.layers.npz.")] = None,
    overwrite: Overwrite = False,
):
    """Write layers as plain arrays, with words on their use, and answers to test another program.

    docs/reference/studies.md lists the names. Exit status: 0 done, 2 bad input, 4 a file could
    not be written.
    """
    with one_line():
        with options():
            laws = weights.load(file)
            out = out or file.with_suffix(".layers.npz")
            require_ending(out, LAYERS)
            require_place(out)
            if out.exists() and out.samefile(file):
                raise ValueError(f"--out {out}: these are the weights; name another file")
            require_free(out, overwrite)
            tables = exported(laws)
        with writing():
            write(out, tables)
        said = ", ".join(f"{part} {described(getattr(laws, part))}" for part in weights.PARTS)
        print(f"{out}: {said}; {counted(len(tables['check']['F']), 'question')} with answers")


def described(trained):
    """A `weights.Trained` in words: its kind and the sizes of its layers."""
    sizes = [len(W) for W, _ in trained.layers] + [len(b) for _, b in trained.layers[-1:]]
    return f"{type(trained.kind).__name__} {'-'.join(map(str, sizes))}".strip()


def plot(
    file: WeightsFile,
    against: Annotated[str, typer.Option(metavar="SCENE", help="Scene with the true laws.")],
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.png, .pdf or .svg, default: WEIGHTS.curves.png.")] = None,
    csv: Annotated[Path | None, typer.Option(help="FILE.csv for the numbers.")] = None,
    strain: Annotated[float, typer.Option(help="Largest, above 0 and below 1.")] = 0.1,
    steps: Annotated[int, typer.Option(help="From rest to it, of the scene's dt.", min=1)] = 200,
):
    """Draw stress-strain curves of learned laws beside the true ones, along one-element paths.

    Uniaxial, simple shear, volumetric; where something flows, also loading and unloading. Exit
    status: 0 done, 2 bad input, 4 a file could not be written.
    """
    with one_line():
        with options():
            laws, problem = fitting(file, against)
            out = out or file.with_suffix(".curves.png")
            require_outputs(out, csv)
            if not 0.0 < strain < 1.0:
                raise ValueError(f"--strain {strain:g}: expected a number above 0 and below 1")
            warn(other_steps(laws, problem))
            found = beside_truth(laws, problem, strain, steps)
        draw(found, f"{file.name} against {problem.title or against}: {steps} steps of "
             f"{problem.clock.dt:g} s to a strain of {strain:g}", out)
        if csv is not None:
            write_curves(found, csv)
        print("\n".join([*map(line, found), str(out), *([str(csv)] if csv else [])]))


def require_outputs(out, csv):
    """Raise ValueError or NotWritten where no picture, or no numbers, are to be written."""
    require_ending(out, PICTURES)
    require_place(out)
    if csv is not None:
        if csv.suffix.lower() not in NUMBERS:
            raise ValueError(f"--csv {csv}: expected a name that ends in {NUMBERS[0]}")
        require_place(csv)


def beside_truth(laws, problem, strain, steps):
    """[`Curve`] of trained laws beside those of a problem's bodies."""
    body, dt = problem.bodies[0], problem.clock.dt
    learned = learned_law(laws.elastic), learned_flow(laws.plastic)
    paths = paths_for((body.flow, learned[1]), problem.dim, strain, steps)
    return curves((body.law, body.flow), learned, paths, dt, laws.about.get("seen"))


def line(curve):
    """How far a learned law is off along a path, in words."""
    end = curve.path.strain[abs(curve.path.strain).argmax()]
    off = f"off by at most {100.0 * curve.off:.3g} % of it" if isfinite(curve.off) else (
        f"the learned law breaks down at strain {curve.broken:.4g}" if curve.broken is not None
        else f"the learned law gives up to {abs(curve.learned).max():.4g} Pa")
    beyond = "" if curve.beyond is None else (
        f"; at {curve.beyond:.3g} beyond the strains of training")
    return (f"{curve.path.name} to {end:+g}: {curve.path.symbol} up to "
            f"{abs(curve.truth).max():.4g} Pa, {off}{beyond}")
