"""Implement `mpm-ref run`: run a scene into a results file, with progress on the terminal.

Exit status: 0 finished, or stopped at --steps; 2 the scene, the options or the files do not fit;
3 the run became unstable; 4 a file could not be written; 130 Ctrl-C; 143 terminated.
"""

import sys
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Annotated

import threadpoolctl
import typer

from .. import scene
from ..core.grid import OutOfRange
from ..core.jit import set_threads
from ..energy_budget import EnergyBudget
from ..monitor import Unstable
from ..simulate import last_step
from ..store import checkpoint, running
from ..store.atomic import NotWritten
from ..store.results import UNITS, USUAL
from ..store.running import (
    AT_LIMIT,
    FINISHED,
    INTERRUPTED,
    TERMINATED,
    Options,
    Watch,
    checkpoint_of,
)
from ..store.text import counted
from ..store.writer import StoredFields
from ..timestep import TooLarge
from . import info
from .catalogue import find_scene, require_other_file
from .errors import INTERRUPT, NOT_WRITTEN, UNSTABLE, at_start, end, exit_on_errors, options
from .options import Json, SceneName
from .terminal import COMPILING, as_json, compiling, passing, warn

FIELDS = f"Fields to store, of {','.join(UNITS)} (default: {','.join(USUAL)})."
EVERY = "Steps between checkpoints (default: one a minute)."
RESULTS = "Results file (default: SCENE.h5)."
BUDGET = "Sum which parts of the steps change the energy; see `mpm-ref info` on the results."
GZIP = "Level of compression, 1 to 9 (default: none)."
EXIT = {FINISHED: 0, AT_LIMIT: 0, INTERRUPTED: INTERRUPT, TERMINATED: 143}
# The bar takes what the rest leaves of the line.
LINE = "{{percentage:3.0f}}%|{{bar}}| {done} [{{elapsed}}<{{remaining}}{{postfix}}]"
STEPS = LINE.format(done="{n}/{total:g} steps")
SECONDS = LINE.format(done="t {n:.4g}/{total:g} s")


def run(
    name: SceneName,
    out: Annotated[Path | None, typer.Option("--out", "-o", help=RESULTS)] = None,
    steps: Annotated[int | None, typer.Option(help="Stop after this many steps in all.")] = None,
    threads: Annotated[int | None, typer.Option(help="Number of threads (default: all).")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume from the checkpoint.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results.")] = False,
    checkpoint_every: Annotated[int | None, typer.Option(help=EVERY)] = None,
    fields: Annotated[str | None, typer.Option(help=FIELDS)] = None,
    gzip: Annotated[int | None, typer.Option(help=GZIP)] = None,
    energy_budget: Annotated[bool, typer.Option("--energy-budget", help=BUDGET)] = False,
    json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress bar.")] = False,
):
    """Run a scene into a results file.

    Ctrl-C ends the run after the current step, with a checkpoint. --resume continues an interrupted
    run bit for bit, whatever ended it. Exit status: 0 success, 2 bad input, 3 the run became
    unstable, 4 a file could not be written, 130 Ctrl-C, 143 terminated.
    """
    with exit_on_errors():
        path = find_scene(name)
        record, out = scene.load(path), out or Path(f"{path.stem}.h5")
        with options():
            require_other_file(path, out)
            how = Options(steps, checkpoint_every, stored(fields, gzip), resume, overwrite,
                          record.seed)
            use_threads(threads)
        problem = scene.build(record, str(path))
        if energy_budget:
            with options():
                problem = replace(problem, budget=EnergyBudget())
        with Bar(Request(name, out, json, quiet)) as bar:
            status = run_scene(problem, bar, how)
        raise typer.Exit(status)


def stored(fields, gzip):
    """`StoredFields` of the two options; None where neither is given. Raises ValueError."""
    if fields is None and gzip is None:
        return None
    return StoredFields(USUAL if fields is None else tuple(fields.split(",")), gzip or 0)


def use_threads(n):
    """Let kernels and BLAS use n threads; None leaves it at all cores. Raises ValueError."""
    if n is not None:
        set_threads(n)
        threadpoolctl.threadpool_limits(n)


@dataclass(frozen=True)
class Request:
    """The scene, the results file and the output options of a command."""

    scene: str
    out: Path
    json: bool = False
    quiet: bool = False


class Bar(Watch):
    """A `Watch` that prints the problem, and shows a progress bar on a terminal.

    The bar shows steps or time done, time left, dt, and kinetic and total energy. It is a context
    manager.
    """

    def __init__(self, request):
        self.request, self.facts, self.energies, self.steps = request, None, "", 0
        self.warnings = []
        self.bar, self.stack = None, ExitStack()

    def __enter__(self):
        self.stack.enter_context(compiling(self.request.quiet))
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def began(self):
        """Return whether the run has begun."""
        return self.bar is not None

    def begin(self, problem, state):
        """Say what is run and what looks wrong in it, and open the bar."""
        self.facts = info.of_problem(problem, state)
        self.stack.close()
        if not state.frame:
            warn(self.facts["warnings"])
        if not self.request.json:
            print("\n".join(info.problem_lines(self.facts)), flush=True)
        self.total = last_step(problem.clock)
        self.bar = passing(
            self.request.quiet, total=self.total or problem.clock.end, mininterval=0.2,
            initial=self.done(state), unit="step" if self.total else "t =",
            bar_format=STEPS if self.total else SECONDS,
        )
        self.bar.set_postfix_str(COMPILING)

    def done(self, state):
        """Return the progress of a state: its step, or its time [s]."""
        return state.step if self.total else state.t

    def step(self, state, dt):
        """Move the bar."""
        self.steps += 1
        if self.steps == 1:
            self.start_clock(state)
        t = f"t {state.t:.3g}, " if self.total else ""
        solve = "" if state.solve is None else f", {solve_text(state.solve)}"
        self.bar.set_postfix_str(f"{t}dt {dt:.3g} s{solve}{self.energies}", refresh=False)
        self.bar.update(self.done(state) - self.bar.n)

    def start_clock(self, state):
        """Count from here: the first step compiles."""
        self.bar.reset()
        self.bar.initial = self.bar.n = self.bar.last_print_n = self.done(state)

    def frame(self, frame, energy):
        """Note the energies that are finite: of a law without energy the sum is not."""
        known = {"E_kin": energy.kinetic, "E": energy.sum}
        said = [f"{name} {value:.3g}" for name, value in known.items() if isfinite(value)]
        self.energies = f", {', '.join(said)} J" if said else ""

    def warn(self, message):
        """Print a warning above the bar, and note it."""
        self.warnings.append(message)
        with self.bar.external_write_mode(file=sys.stderr):
            warn([message])

    def close(self):
        """Leave the bar as it is."""
        self.stack.close()
        if self.bar is not None:
            self.bar.close()


def solve_text(report):
    """Return iterations and last residual of an implicit step as text."""
    return f"{report.iterations} it to {report.residuals[-1]:.0e}"


def run_scene(problem, bar, options):
    """Run a problem and return the exit status. Errors of the input are raised."""
    request = bar.request
    try:
        outcome = running.run(problem, request.out, options, bar)
    except (Unstable, OutOfRange, TooLarge, NotWritten, KeyboardInterrupt) as fault:
        bar.close()
        if not bar.began:
            with at_start(request.scene):
                raise
        _broke_off(fault, request)
    bar.close()
    if not outcome.same_code:
        print("mpm-ref: the checkpoint was saved by another version of the code: the run went on, "
              "but not bit for bit", file=sys.stderr)
    _report(outcome, bar)
    return EXIT[outcome.why]


def _broke_off(fault, request):
    """End a run that could not end between two steps by itself."""
    said = str(fault) or "interrupted at once"
    status = {NotWritten: NOT_WRITTEN, KeyboardInterrupt: INTERRUPT}.get(type(fault), UNSTABLE)
    next_ = last_checkpoint(request, again=status != UNSTABLE)
    end(f"{said}{'' if said.endswith('?') else '.'} {next_}", status)


def _report(outcome, bar):
    """Say how the run of a `Bar` ended and how to go on."""
    state, request = outcome.state, bar.request
    warn([*info.unsolved(outcome.unsolved), *info.stalled(state.stalled)])
    if request.json:
        print(as_json({
            "why": outcome.why, "out": str(request.out), "step": state.step, "t": state.t,
            "frames": outcome.frames, "unsolved": outcome.unsolved,
            "rejected": state.rejected, "stalled": state.stalled,
            "checkpoint": str(checkpoint_of(request.out)),
            "warnings": bar.warnings, "state_sha256": checkpoint.digest(state),
            "problem": bar.facts,
        }))
    else:
        print(f"{outcome.why}: step {state.step}, t = {state.t:.6g} s, "
              f"{counted(outcome.frames, 'frame')} in {request.out}")
        print("".join(f"{line}\n" for line in info.rejected_line(state.rejected)), end="")
    if outcome.why != FINISHED:
        print(f"to go on: {how_to_resume(request)}", file=sys.stderr)


def how_to_resume(request):
    """Return the command that resumes a run."""
    return f"mpm-ref run {request.scene} --out {request.out} --resume"


def last_checkpoint(request, again):
    """Return a sentence on the last checkpoint of a run and on how to continue.

    again: whether to resume from it; otherwise the same scene would break down again.
    """
    path = checkpoint_of(request.out)
    try:
        there = checkpoint.summary(path)
    except checkpoint.BadCheckpoint as fault:
        return f"No checkpoint: {fault}"
    on = f"to go on from it: {how_to_resume(request)}" if again else (
        "the same scene would break again: change it and start anew with --overwrite")
    return f"Last good checkpoint: {path}, step {there['step']}, t = {there['t']:.6g} s; {on}"
