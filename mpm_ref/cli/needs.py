"""Implement `mpm-ref needs`: find what a scene does not require for its quantities of interest."""

from pathlib import Path
from shlex import quote

import typer

from ..needs.answer import NeedsAnswer, lean_text
from ..needs.code_parts import code_parts
from ..needs.figure import save_figure
from ..needs.page import page_facts
from ..needs.removal import RemovalStudy
from ..needs.variant import first_variant
from ..store.atomic import write_bytes
from ..store.page import page_of
from ..sweep.observation import CRASHED, STOPPED
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
from .terminal import as_json, finite, warn

NO_ANSWER = 1


def find(
    name: SceneName,
    error: ErrorOption = "1%",
    budget: BudgetOption = "10min",
    quantity: QuantityOption = None,
    workers: WorkersOption = 2,
    scheduler: SchedulerOption = None,
    out: OutOption = Path(),
    json: Json = False,
    quiet: QuietOption = False,
):
    """Find which ingredients of a scene its quantities of interest require.

    Takes them away one by one, then together in the best order, and measures the change of the
    quantities and the CPU time saved. Writes SCENE.needs.json, the page SCENE.needs.html, the
    figure SCENE.needs.png and the runnable scene SCENE.lean.toml. Runs are stored in SCENE.trade:
    the same command with a larger budget goes on. Exit status: 0 the answer, 1 part of it within
    the budget, 2 bad input, 4 a file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            request = SweepRequest(name, error, budget, quantity, workers, scheduler, out,
                                   quiet).parsed()
            record, path, tables = load_sweep(name)
            request = request.for_scene(tables)
            observed = observed_of(record, path, request.quantities)
        answer = answer_of(first_variant(record, observed.probes), observed, request)
        write_answer(answer, out, tables)
        print(as_json(answer.facts) if json else "\n".join(answer.lines))
    raise typer.Exit(0 if answer.result.complete else NO_ANSWER)


def answer_of(first, observed, request):
    """Return the `NeedsAnswer` of a `SceneVariant` after its runs; the command ends without one."""
    store = request.out / f"{request.stem}.trade"
    with open_runs(request, observed) as runs:
        study = RemovalStudy(runs, first, request.error)
        result = study.result()
        if result is None:
            end_without_base(study.base, request)
        parts = parts_of(first, result, store)
    return NeedsAnswer(request.stem, command_of(request), request.error, result, parts)


def parts_of(first, result, store):
    """Return {"as given" and "lean": `CodeParts`}; empty, with a warning, where they cannot be
    had.
    """
    try:
        parts = {"as given": code_parts(first.scene, store)}
        if result.order:
            parts["lean"] = code_parts(result.lean.scene, store)
    except RuntimeError as fault:
        warn([f"no table of the code: {fault}"])
        return {}
    return parts


def end_without_base(base, request):
    """End the command where the scene as given did not reach its end."""
    if base.outcome in (STOPPED, CRASHED):
        end(f"{request.name}: the run of the scene as given, which the others are compared with, "
            f"did not reach its end within --budget ({base.message}; it reached t = "
            f"{base.until:.3g} s); the same command with a larger --budget tries again", NO_ANSWER)
    end(f"{request.name}: the scene as given cannot be compared with: {base.message}", BAD_INPUT)


def command_of(request):
    """Return the command that asks for the same answer."""
    texts = [f"--quantity {quote(text)}" for text in request.quantities]
    return " ".join(["mpm-ref needs", quote(request.name), f"--error {request.error:g}",
                     f"--budget {request.budget:g}s", *texts])


def write_answer(answer, out, tables):
    """Write the JSON, the page, the figure and the lean scene, with the quantities of interest of
    the scene as given. Raises `NotWritten`.
    """
    base = Path(out) / answer.name
    write_bytes(f"{base}.needs.json", as_json(answer.facts).encode())
    write_bytes(f"{base}.needs.html", page_of(finite(page_facts(answer)), "needs").encode())
    write_bytes(f"{base}.lean.toml", lean_text(answer, out, tables).encode())
    save_figure(answer, f"{base}.needs.png")
