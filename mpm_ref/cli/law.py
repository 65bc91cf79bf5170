"""Implement `mpm-ref law studies | train | evaluate | export | plot`: laws learned from motion.

A study file names the scene, the method and its recipe (docs/reference/studies.md). `law_train` has
the command `train`.
"""

import sys
from math import inf, isfinite, sqrt
from pathlib import Path
from typing import Annotated

import typer

from ..materials.learned import learned_flow, learned_law, weights
from ..nclaw.export import export_tables, write
from ..nclaw.strain_watch import ComparisonWatch
from ..nclaw.study.compare import RunBroken, compare_runs, write_errors
from ..nclaw.study.curves import compare_curves, draw_curves, paths_for, write_curves
from ..store.atomic import require_place
from ..store.text import counted
from . import law_info, law_train
from .errors import UNSTABLE, end, exit_on_errors, options, writing
from .options import (
    NUMBERS,
    PICTURES,
    Json,
    Overwrite,
    SceneName,
    WeightsFile,
    examples,
    learned_law_warnings,
    load_matching,
    on_interrupt,
    require_ending,
    require_free,
    step_length_warnings,
)
from .terminal import as_json, passing, tell, warn

app = typer.Typer(no_args_is_help=True, help="Train laws on the motion of a scene, compare them "
                  "with the true ones, and export them to other programs.",
                  epilog="`mpm-ref law studies` lists the bundled law studies; "
                  "docs/reference/studies.md explains how to write one.")
app.command(epilog=examples("law", "studies"))(law_info.studies)
app.command(epilog=examples("law", "train law_jelly_small --out laws.npz",
                            "train law_jelly --seeds 3"))(law_train.train)


@app.command(epilog=examples("law", "evaluate laws.npz nclaw_jelly --steps 100"))
def evaluate(
    file: WeightsFile,
    name: SceneName,
    steps: Annotated[int | None, typer.Option(
        help="Number of steps of both runs (default: as in the scene).", min=1)] = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.csv for the error of each frame.")] = None,
    json: Json = False,
):
    """Run a scene with its true laws and with learned ones, and report the difference.

    The error is the mean of (x - x_true)^2 over points, axes and frames. Exit status: 0 success,
    2 bad input, 3 a run broke down, 4 a file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            if out is not None:
                require_ending(out, NUMBERS)
                require_place(out)
            laws, problem = load_matching(file, name, steps)
            warn([*step_length_warnings(laws, problem), *learned_law_warnings(problem)])
            errors, found = compare_with_progress(problem, laws, name)
        facts = facts_of(errors, found, problem)
        if out is not None:
            write_errors(errors, problem.clock, out)
        if json:
            print(as_json({"weights": str(file), "scene": name, "csv": out and str(out), **facts}))
        else:
            print("\n".join([*lines(facts, problem), *([str(out)] if out else [])]))
    raise typer.Exit(0 if isfinite(found.error) else UNSTABLE)


def compare_with_progress(problem, laws, name):
    """Return the error of each frame [m^2] and the `Found` of both runs, with a progress bar."""
    errors, found, total = [], None, 1 + problem.clock.steps // problem.clock.every
    watched = ComparisonWatch(laws, problem)
    try:
        with (on_interrupt(lambda: f"after {len(errors)} of {counted(total, 'frame')}"),
              passing(unit="frame", total=total, desc=problem.title or name) as bar):
            for error, found in compare_runs(problem, watched.body):
                if found.step < 0:
                    with bar.external_write_mode(file=sys.stderr):
                        warn(watched.news(len(errors)))
                errors.append(error)
                bar.set_postfix_str(f"error {found.error:.2e} m^2", refresh=False)
                bar.update()
    except RunBroken as fault:
        end(f"{name}: its own laws break down in {fault}", UNSTABLE)
    return errors, found


def facts_of(errors, outcome, problem):
    """Return the result of a comparison as plain values; errors in m^2."""
    sound = [error for error in errors if error < inf]
    worst = max(range(len(sound)), key=sound.__getitem__)
    return {"title": problem.title, "particles": sum(len(body.id) for body in problem.bodies),
            "steps": problem.clock.steps, "frames": len(errors), "error": outcome.error,
            "sound": {"frames": len(sound), "error": sum(sound) / len(sound), "last": sound[-1]},
            "largest": {"frame": worst, "error": sound[worst]},
            "broken": None if outcome.step < 0 else {"step": outcome.step, "why": outcome.why}}


def lines(facts, problem):
    """Return the result of a comparison as lines of text."""
    clock, sound, broken = problem.clock, facts["sound"], facts["broken"]
    yield (f"{facts['title']}: {facts['particles']} particles, {counted(facts['steps'], 'step')} "
           f"of {clock.dt:g} s, {counted(facts['frames'], 'frame')}")
    if broken:
        yield f"the learned laws broke down in step {broken['step']}: {broken['why']}"
    before = ", the frames before" if sound["frames"] < facts["frames"] else ""
    yield (f"mean squared position error over {counted(sound['frames'], 'frame')}{before}: "
           f"{sound['error']:.4g} m^2, its root {sqrt(sound['error']) / problem.dx:.3g} dx")
    largest = facts["largest"]
    yield (f"in the last of them {sound['last']:.3g} m^2; at most {largest['error']:.3g} m^2, at "
           f"t = {largest['frame'] * clock.every * clock.dt:g} s")


LAYERS = (".npz", ".json")


@app.command(epilog=examples("law", "export laws.npz", "export laws.npz --out layers.json"))
def export(
    file: WeightsFile,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.npz or FILE.json, default: WEIGHTS.layers.npz.")] = None,
    overwrite: Overwrite = False,
):
    """Export the layers of learned laws as plain arrays, with test data for another program.

    docs/reference/studies.md lists the names. Exit status: 0 success, 2 bad input, 4 a file could
    not be written.
    """
    with exit_on_errors():
        with options():
            laws = weights.load(file)
            out = out or file.with_suffix(".layers.npz")
            require_ending(out, LAYERS)
            require_place(out)
            if out.exists() and out.samefile(file):
                raise ValueError(f"--out {out}: these are the weights; name another file")
            require_free(out, overwrite)
            tell("computing answers of the laws for test")
            tables = export_tables(laws)
        with writing():
            write(out, tables)
        said = ", ".join(f"{part} {described(getattr(laws, part))}" for part in weights.PARTS)
        print(f"{out}: {said}; {counted(len(tables['check']['F']), 'question')} with answers")


def described(trained):
    """Return a `LawWeights` as text: its kind and the sizes of its layers."""
    sizes = [len(W) for W, _ in trained.layers] + [len(b) for _, b in trained.layers[-1:]]
    return f"{type(trained.kind).__name__} {'-'.join(map(str, sizes))}".strip()


@app.command(epilog=examples("law", "plot laws.npz --against nclaw_jelly --out curves.pdf"))
def plot(
    file: WeightsFile,
    against: Annotated[str, typer.Option(metavar="SCENE", help="Scene with the true laws.")],
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.png, .pdf or .svg, default: WEIGHTS.curves.png.")] = None,
    csv: Annotated[Path | None, typer.Option(help="FILE.csv for the numbers.")] = None,
    strain: Annotated[float, typer.Option(help="Largest strain, between 0 and 1.")] = 0.1,
    steps: Annotated[int, typer.Option(help="Steps to the largest strain.", min=1)] = 200,
):
    """Plot stress-strain curves of learned and true laws along one-element paths.

    The paths are uniaxial, simple shear and volumetric; for a plastic law also loading and
    unloading. Exit status: 0 success, 2 bad input, 4 a file could not be written.
    """
    with exit_on_errors():
        with options():
            laws, problem = load_matching(file, against)
            out = out or file.with_suffix(".curves.png")
            require_outputs(out, csv)
            if not 0.0 < strain < 1.0:
                raise ValueError(f"--strain {strain:g}: expected a number above 0 and below 1")
            warn(step_length_warnings(laws, problem))
            tell("comparing the laws along paths of strain")
            found = compare_with_truth(laws, problem, strain, steps)
        draw_curves(found, f"{file.name} against {problem.title or against}: {steps} steps of "
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


def compare_with_truth(laws, problem, strain, steps):
    """[`Curve`] of trained laws beside those of a problem's bodies."""
    body, dt = problem.bodies[0], problem.clock.dt
    learned = learned_law(laws.elastic), learned_flow(laws.plastic)
    paths = paths_for((body.flow, learned[1]), problem.dim, strain, steps)
    return compare_curves((body.law, body.flow), learned, paths, dt, laws.about.get("seen"))


def line(curve):
    """Return the error of a learned law along a path as text."""
    end = curve.path.strain[abs(curve.path.strain).argmax()]
    off = f"off by at most {100.0 * curve.error:.3g} % of it" if isfinite(curve.error) else (
        f"the learned law breaks down at strain {curve.failure:.4g}" if curve.failure is not None
        else f"the learned law gives up to {abs(curve.learned).max():.4g} Pa")
    beyond = "" if curve.range_exit is None else (
        f"; at {curve.range_exit:.3g} beyond the strains of training")
    return (f"{curve.path.name} to {end:+g}: {curve.path.symbol} up to "
            f"{abs(curve.truth).max():.4g} Pa, {off}{beyond}")
