"""Implement `mpm-ref trade`: measure accuracy against time, and recommend a setting."""

from json import loads as json_loads
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from ..scene import SceneError
from ..store.atomic import write_bytes
from ..store.page import page_of
from ..sweep.quantity import with_companions
from ..sweep.recorded import observe_results
from ..sweep.scene_text import scene_text
from ..sweep.setting import scene_at
from ..trade.answer import (
    answer_lines,
    answer_of,
    best_scene,
    is_whole,
    largest_extent,
    percent,
)
from ..trade.figure import save_figure
from ..trade.search import TradeSearch
from ..trade.similar import (
    carried_over,
    cheapest_row,
    read_answer,
    require_same_quantities,
)
from .errors import exit_on_errors, options
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
from .terminal import as_json

NO_ANSWER = 1
PROBLEM = {     # what scenes of the same problem share
    "dim =": lambda record: record.dim,
    "end =": lambda record: f"{record.end:.9g} s",
    "bodies": lambda record: ", ".join(sorted(body.name for body in record.body)),
}
LikeOption = Annotated[str | None, typer.Option(
    "--like", help="Answer at once from SCENE.trade.json of this similar scene, without a run.")]

AlternativeOption = Annotated[list[str] | None, typer.Option(
    "--alternative", help="Another scene of the same problem, such as one with a learned law, "
    "whose settings are tried too; may be given several times.")]
CompareOption = Annotated[list[Path] | None, typer.Option(
    "--compare", help="A results file of the same problem, such as that of a reduced model or of "
    "another code, whose error is measured too; may be given several times.")]


def measure(
    name: SceneName,
    error: ErrorOption = "1%",
    budget: BudgetOption = "5min",
    quantity: QuantityOption = None,
    workers: WorkersOption = 2,
    scheduler: SchedulerOption = None,
    out: OutOption = Path(),
    like: LikeOption = None,
    alternative: AlternativeOption = None,
    compare: CompareOption = None,
    json: Json = False,
    quiet: QuietOption = False,
):
    """Measure which settings of a scene keep an error, and which of them is the cheapest.

    Writes SCENE.trade.json, the page SCENE.trade.html, the figure SCENE.trade.png, and the runnable
    scene SCENE.best.toml.
    Runs are stored in SCENE.trade: the same command with a larger budget goes on. Exit status: 0
    a setting is recommended for the whole run, 1 none, or one until an earlier time, 2 bad input,
    4 a file could not be written, 130 Ctrl-C.
    """
    with exit_on_errors():
        with options():
            request = SweepRequest(name, error, budget, quantity, workers, scheduler, out,
                                   quiet).parsed()
            if like is not None and (alternative or compare):
                raise ValueError(f"--like {like}: it measures nothing, so that --alternative and "
                                 "--compare have no meaning beside it")
            record, path, tables = load_sweep(name)
            request = request.for_scene(tables)
            texts = with_companions(request.quantities, record.dim)
            observed = observed_of(record, path, texts)
            others = load_alternatives(record, alternative or ())
            compared = load_compared(compare or (), observed, request)
        if like is not None:
            raise typer.Exit(answer_from(like, SweptScene(record, observed, tables), request))
        search = run_search(record, observed, request, others)
        facts = json_loads(as_json(answer_of(search, path.stem, compared, request.budget)))
        write_answer(search, facts, request, tables)
        print(as_json(facts) if json else "\n".join(answer_lines(facts)))
    raise typer.Exit(0 if facts["best"] is not None and is_whole(facts) else NO_ANSWER)


class SweptScene(NamedTuple):
    """A scene without its quantities of interest, its `ObservedRun`, and these quantities."""

    record: object
    observed: object
    tables: tuple


def answer_from(like, swept, request):
    """Write and say the advice that the answer on a similar scene gives; return the exit status.

    swept: the `SweptScene` that the advice is for.
    """
    name = Path(like).stem
    answer = read_answer(request.out / f"{name}.trade.json")
    with options():
        require_same_quantities(answer, request.quantities, name)
    row = cheapest_row(answer, request.error)
    if row is None:
        print(f"{name}: no setting of its answer keeps {percent(request.error)}")
        return NO_ANSWER
    with options():
        cells = largest_extent(swept.observed.probes) / swept.record.dx
        chosen = carried_over(row, answer.cells, cells)
        scene = scene_at(swept.record, chosen)
    sentence = (f"as on {name}: {chosen.text}, which had an error of {percent(row.error)} of "
                f"{', '.join(answer.quantities)} there, until t = {answer.until:.4g} s of "
                f"{answer.end:.4g} s; nothing was measured on {request.stem}")
    text = scene_text([sentence], scene, request.out, swept.tables)
    write_bytes(request.out / f"{request.stem}.best.toml", text.encode())
    print(f"{sentence}\nwrote {request.out / request.stem}.best.toml")
    return 0


def load_alternatives(record, names):
    """Return {name: scene} of scenes of the same problem. Raises SceneError for one of another."""
    others = {}
    for name in names:
        other, path, _ = load_sweep(name)
        for what, of in PROBLEM.items():
            if of(record) != of(other):
                raise SceneError(f"--alternative {name}: {what} {of(other)}, in the scene "
                                 f"{of(record)}; expected another scene of the same problem")
        if others.setdefault(path.stem, other) is not other:
            raise SceneError(f"--alternative {name}: two scenes are called {path.stem}; rename one")
    return others


def load_compared(files, observed, request):
    """Return {name: `RunObservation`} of results files. Raises ValueError for one that does not
    fit.
    """
    asked = observed._replace(quantities=request.quantities)
    for file in files:
        observe_results(file, asked, request.error)
    return {str(file): observe_results(file, observed) for file in files}


def run_search(record, observed, request, others):
    """Return a `TradeSearch` after its runs."""
    with open_runs(request, observed) as runs:
        search = TradeSearch(record, runs, request.quantities, np.array(observed.times),
                             request.error, others=others)
        search.run()
    return search


def write_answer(search, facts, request, tables):
    """Write the JSON, the page, the figure, and the recommended scene, with the quantities of
    interest of the scene as given; without one, remove that of an earlier answer. Raises
    `NotWritten`.
    """
    base = request.out / request.stem
    write_bytes(f"{base}.trade.json", as_json(facts).encode())
    write_bytes(f"{base}.trade.html", page_of(facts, "trade").encode())
    save_figure(facts, f"{base}.trade.png")
    text = best_scene(search, request.stem, request.out, tables, facts["start_fault"])
    if text is None:
        Path(f"{base}.best.toml").unlink(missing_ok=True)      # of an earlier answer
    else:
        write_bytes(f"{base}.best.toml", text.encode())
