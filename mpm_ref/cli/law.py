"""`mpm-ref law train | evaluate | export | plot`: laws learned from the motion of a scene (see
`laws`).

A study file names the scene, the method and its recipe; docs/reference/studies.md explains it.
The other commands are in `law_train` and `law_show`.
"""

import sys
from math import inf, isfinite, sqrt
from pathlib import Path
from typing import Annotated

import typer

from ..nclaw.study.compare import Broken, beside
from ..nclaw.study.numbers import write_errors
from ..nclaw.study.watched import Watched
from ..store.atomic import require_place
from ..store.words import counted
from . import faults, law_show, law_train
from .faults import end, one_line, options
from .info import as_json
from .law_options import NUMBERS, SceneName, WeightsFile, fitting, not_true, other_steps
from .look import Machine
from .outputs import require_ending
from .rom_options import on_interrupt
from .terminal import passing, warn

app = typer.Typer(no_args_is_help=True, help="Laws learned from the motion of a scene: train them, "
                  "put them beside the true ones, hand them to other programs.")
app.command()(law_train.train)


@app.command()
def evaluate(
    file: WeightsFile,
    name: SceneName,
    steps: Annotated[int | None, typer.Option(
        help="Of both runs, default: as the scene says.", min=1)] = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", help="FILE.csv for the error of each frame.")] = None,
    json: Machine = False,
):
    """Run a scene with its own laws and with learned ones, side by side: how far do they part?

    The error is the mean of (x - x_true)^2 over points, axes and frames. Exit status: 0 done,
    2 bad input, 3 a run broke down, 4 a file could not be written, 130 Ctrl-C.
    """
    with one_line():
        with options():
            if out is not None:
                require_ending(out, NUMBERS)
                require_place(out)
            laws, problem = fitting(file, name, steps)
            warn([*other_steps(laws, problem), *not_true(problem)])
            errors, found = compared(problem, laws, name)
        facts = facts_of(errors, found, problem)
        if out is not None:
            write_errors(errors, problem.clock, out)
        if json:
            print(as_json({"weights": str(file), "scene": name, "csv": out and str(out), **facts}))
        else:
            print("\n".join([*lines(facts, problem), *([str(out)] if out else [])]))
    raise typer.Exit(0 if isfinite(found.error) else faults.UNSTABLE)


app.command()(law_show.export)
app.command()(law_show.plot)


def compared(problem, laws, name):
    """(error of each frame [m^2], `Found`) of both runs, with a bar of frames."""
    errors, found, total = [], None, 1 + problem.clock.steps // problem.clock.every
    watched = Watched(laws, problem)
    try:
        with (on_interrupt(lambda: f"after {len(errors)} of {counted(total, 'frame')}"),
              passing(unit="frame", total=total, desc=problem.title or name) as bar):
            for error, found in beside(problem, watched.made):
                if found.step < 0:
                    with bar.external_write_mode(file=sys.stderr):
                        warn(watched.news(len(errors)))
                errors.append(error)
                bar.set_postfix_str(f"error {found.error:.2e} m^2", refresh=False)
                bar.update()
    except Broken as fault:
        end(f"{name}: its own laws break down in {fault}", faults.UNSTABLE)
    return errors, found


def facts_of(errors, found, problem):
    """What came of a comparison, as plain values; errors in m^2."""
    sound = [error for error in errors if error < inf]
    worst = max(range(len(sound)), key=sound.__getitem__)
    return {"title": problem.title, "particles": sum(len(body.id) for body in problem.bodies),
            "steps": problem.clock.steps, "frames": len(errors), "error": found.error,
            "sound": {"frames": len(sound), "error": sum(sound) / len(sound), "last": sound[-1]},
            "largest": {"frame": worst, "error": sound[worst]},
            "broken": None if found.step < 0 else {"step": found.step, "why": found.why}}


def lines(facts, problem):
    """The same in words."""
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
