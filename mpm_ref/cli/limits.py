"""Implement `mpm-ref limits`: find how far a scene is from its nearest failures."""

from pathlib import Path
from shlex import quote

from ..limits.answer import answer_lines, answer_of
from ..limits.figure import save_figure
from ..limits.page import page_facts
from ..limits.search import LimitsSearch
from ..limits.verdict import CellJudge, NoReference
from ..store.atomic import write_bytes
from ..store.page import page_of
from ..sweep.observation import REFUSED
from ..sweep.quantity import with_companions
from .errors import BAD_INPUT, end, exit_on_errors, options
from .options import Json, SceneName
from .sweep_options import (
    BudgetOption,
    ErrorOption,
    OutOption,
    QuantityOption,
    QuietOption,
    SchedulerOption,
    SweepRequest,
    WorkersOption,
    load_sweep,
    observed_of,
    open_runs,
)
from .terminal import as_json, finite

NO_ANSWER = 1


def measure(
    name: SceneName,
    error: ErrorOption = "1%",
    budget: BudgetOption = "20min",
    quantity: QuantityOption = None,
    workers: WorkersOption = 2,
    scheduler: SchedulerOption = None,
    out: OutOption = Path(),
    json: Json = False,
    quiet: QuietOption = False,
):
    """Find how far a scene is from its nearest failures, and how it fails there.

    Changes stiffness, Poisson's ratio, density, speed, gravity, friction, yield stress, time step,
    points per cell, size and place by factors over decades, one and two at a time. Writes
    SCENE.limits.json, the page SCENE.limits.html, and the figure SCENE.limits.png. Runs are stored
    in SCENE.trade: the same command with a larger budget goes on. Exit status: 0 an answer is
    given, 1 the scene as given has no reference within the budget, 2 bad input, 4 a
    file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            request = SweepRequest(name, error, budget, quantity, workers, scheduler, out,
                                   quiet).parsed()
            record, path, tables = load_sweep(name)
            request = request.for_scene(tables)
            texts = with_companions(request.quantities, record.dim)     # `trade` has these runs
            observed = observed_of(record, path, texts)
        search = run_search(record, observed, request)
        facts = answer_of(search, record, path.stem)
        facts |= {"budget": request.budget, "command": command_of(request)}
        write_answer(facts, request)
        print(as_json(facts) if json else "\n".join(answer_lines(facts)))


def run_search(record, observed, request):
    """Return a `LimitsSearch` after its runs; ends the command where it cannot begin."""
    with open_runs(request, observed) as runs:
        judge = CellJudge(record, runs, observed.probes, request.quantities, request.error)
        try:
            judge.start()
        except NoReference as fault:
            end(f"{request.name}: {fault}", BAD_INPUT if fault.outcome == REFUSED else NO_ANSWER)
        search = LimitsSearch(judge)
        search.run()
    return search


def command_of(request):
    """Return the command of a request."""
    quantities = "".join(f" --quantity {quote(text)}" for text in request.quantities)
    return (f"mpm-ref limits {quote(request.name)} --error {request.error:g} --budget "
            f"{request.budget:g}s{quantities} --workers {request.workers}")


def write_answer(facts, request):
    """Write the JSON, the page and the figure. Raises `NotWritten`."""
    base = request.out / request.stem
    write_bytes(f"{base}.limits.json", as_json(facts).encode())
    write_bytes(f"{base}.limits.html", page_of(finite(page_facts(facts)), "limits").encode())
    save_figure(facts, f"{base}.limits.png")
