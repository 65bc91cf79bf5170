"""Options of the commands that run a scene many times: `trade`, `limits` and `needs`."""

import re
from contextlib import ExitStack, contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from .. import scene
from ..executor import open_executor
from ..scene.validate import validate_scene
from ..store.text import counted
from ..sweep.conditions import record_impulses
from ..sweep.observation import ObservedRun, RunObserver
from ..sweep.probes import choose_probes
from ..sweep.quantity import DEFAULT, OutputQuantity, check_quantities
from ..sweep.runs import SceneRuns
from ..sweep.setting import in_seconds
from ..sweep.store import RunStore
from .catalogue import find_scene
from .errors import options
from .options import make_folder, on_interrupt
from .terminal import passing, warn

UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
TIMES = 33              # at which quantities are sampled, the start and the end included
SHORTEST = 1.0          # [s] of a budget

ErrorOption = Annotated[str, typer.Option("--error", help="Error asked, such as 1% or 0.01, "
                                          "relative to the largest change of the quantity.")]
BudgetOption = Annotated[str, typer.Option("--budget", help="Time after which no run begins, such "
                                           "as 90s, 20min or 2h.")]
QuantityOption = Annotated[list[str] | None, typer.Option(
    "--quantity", help="Quantity of interest, such as positions, front:x+, kinetic or force:floor; "
    "may be given several times (default: the [\\[quantity]] tables of the scene, or positions).")]
WorkersOption = Annotated[int, typer.Option(help="Number of runs at a time.")]
SchedulerOption = Annotated[str | None, typer.Option(
    help="Where runs are made: local:N, or the address of a Dask scheduler (default: processes "
         "of this machine).")]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder of the files written.")]
QuietOption = Annotated[bool, typer.Option("--quiet", help="Show no progress bar.")]


class SweepRequest(NamedTuple):
    """The options that all of these commands have, as texts before `parsed`."""

    name: str               # of the scene
    error: float | str
    budget: float | str     # [s]
    quantities: tuple | list | None     # of texts
    workers: int
    scheduler: str | None
    out: Path
    quiet: bool

    def parsed(self):
        """Return the request with numbers for its texts. Raises ValueError."""
        if self.workers < 1:
            raise ValueError(f"--workers {self.workers}: expected at least 1")
        return self._replace(error=parse_error(self.error), budget=parse_budget(self.budget),
                             quantities=parse_quantities(self.quantities))

    def for_scene(self, tables):
        """Return the request with the quantities of a scene's `[[quantity]]` tables where it names
        none, and those of `DEFAULT` where the scene has none either.
        """
        texts = self.quantities or tuple(dict.fromkeys(one.text for one in tables)) or DEFAULT
        return self._replace(quantities=texts)

    @property
    def stem(self):
        """Return the name that output files begin with: that of the scene's file without its
        suffix; all of it where only dots would be left, which name a folder.
        """
        path = Path(self.name)
        return path.stem if path.stem.strip(".") else path.name


def parse_error(text):
    """Return the relative error of a text such as "1%" or "0.01". Raises ValueError."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(%?)\s*", text)
    try:
        value = float(match[1]) / (100.0 if match[2] else 1.0)
    except (TypeError, ValueError):
        value = np.nan
    if not 0.0 < value < 1.0:
        raise ValueError(f"--error {text}: expected a share between 0 and 1, such as 1% or 0.01")
    return value


def parse_budget(text):
    """Return the seconds of a text such as "90s", "20min" or "2h". Raises ValueError."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(s|min|h|)\s*", text)
    try:
        value = float(match[1]) * UNITS[match[2]]
    except (TypeError, ValueError):
        value = np.nan
    if not (isfinite(value) and value >= SHORTEST):
        raise ValueError(f"--budget {text}: expected a time of at least {SHORTEST:g} s, such as "
                         "90s, 20min or 2h")
    return value


def parse_quantities(texts):
    """Return the texts of quantities, each once; () without any. Raises ValueError for a text that
    names none.
    """
    unique = tuple(dict.fromkeys(texts or ()))
    for text in unique:
        OutputQuantity(text)
    return unique


def load_sweep(name):
    """Return (scene, path, quantities) by the scene's name: with its end as a time, and without its
    quantities of interest, which are the last.

    Raises SceneError for a scene that cannot be read, or whose run has no end in seconds.
    """
    path = find_scene(name)
    record = scene.load(path)
    tables = in_seconds(record) | {"quantity": ()}
    return validate_scene(tables, str(path)), path, record.quantity


def observed_of(record, path, quantities):
    """Return the `ObservedRun` of a scene: its quantities, times, and probes of its particles.

    Raises SceneError for a scene that cannot be built, ValueError for a quantity that does not fit
    it.
    """
    check_quantities(quantities, record)
    problem, recorder = record_impulses(scene.build(record, str(path)), record)
    probes = tuple((p.body, p.X) for p in choose_probes(problem.bodies))
    times = tuple(np.linspace(0.0, record.end, TIMES).tolist())
    observed = ObservedRun("", "", tuple(quantities), times, probes)
    RunObserver(problem, observed, recorder).start()
    return observed


@contextmanager
def open_runs(request, observed):
    """Yield the `SceneRuns` of a request, with a bar that counts runs; its store is the folder
    SCENE.trade beside the output. A bad scheduler and Ctrl-C end the command.
    """
    make_folder(request.out)
    folder = request.out / f"{request.stem}.trade"
    with ExitStack() as stack:
        with options():
            executor = stack.enter_context(open_executor(request.scheduler, request.workers))
        bar = stack.enter_context(passing(
            request.quiet, total=request.budget, unit="s", desc=request.stem,
            bar_format="{desc} {bar}| {postfix} [{elapsed}]"))
        store = RunStore(folder)
        before, runs = store.count(), SceneRuns(observed, executor, store, request.budget)
        stack.enter_context(on_interrupt(lambda: f"after {runs.count} runs, which are stored in "
                                         f"{folder}; the same command goes on"))

        def show(label, observation):
            bar.set_postfix_str(f"{counted(runs.count, 'run')}, {max(runs.left, 0.0):.0f} s left, "
                                f"last: {getattr(label, 'text', label)}: {observation.outcome}")
            bar.update(request.budget - max(runs.left, 0.0) - bar.n)

        runs.on_run = show
        yield runs
    if before and not runs.reused:
        warn([f"none of the {counted(before, 'run')} in {folder} could be used: they are of "
              "another scene, list of quantities or version of the package"])
