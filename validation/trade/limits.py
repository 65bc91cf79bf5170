"""Are the claims of `mpm-ref limits` right? Cells that it did not run, against a finer reference.

`limits` says of each direction that the scene is right up to a factor; it runs a few factors, and
compares them with the grid of half the spacing. Here other factors below that one are drawn, and
their runs are compared with the grid of a quarter. A cell is right by the rule of `limits.verdict`:
it differs from its reference by at most twice as much as the scene as given differs from its own.
"""

from math import log10
from typing import NamedTuple

import msgspec
import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.limits.answer import warnings_of
from mpm_ref.limits.cell import cell_of, cell_text, physical
from mpm_ref.limits.search import LimitsSearch
from mpm_ref.limits.verdict import RIGHT, SLACK, WRONG, CellJudge, differences
from mpm_ref.scene import SceneError, build, digest
from mpm_ref.sweep.observation import ObservedRun
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import RunRequest, SceneRuns
from mpm_ref.sweep.store import RunStore

from ..common.registry import experiment
from ..common.seeding import generator
from .advice_scenes import advice_scenes

JUDGED = ("slide", "stick", "swing", "lean", "dam", "sand", "splash", "impact")
QUANTITY, ERROR, TIMES = "positions", 0.05, 17
FINER = 0.25            # factor of dx of the reference
DRAWS = 3               # factors of a direction
KEPT = 0.95             # the aim: share of claims that are right
LONGEST = 60.0          # [s] of CPU time of one run
COLUMNS = ("scene", "cell", "claim", "error", "tolerance", "status")


class Claim(NamedTuple):
    """A cell that lies within what `limits` calls right, or that it calls wrong, beside a finer
    reference.
    """

    scene: str
    cell: str
    claim: str              # RIGHT or WRONG
    error: float
    tolerance: float
    status: str             # RIGHT, WRONG, or how the run or its reference ended


@experiment("trade.limits", title="The claims of `mpm-ref limits`, on cells that it did not run",
            profiles=("quick", "standard"), budget={"quick": 60, "standard": 2400})
def limits(run):
    """Judge the claims on all scenes."""
    names = run.choose(quick=("dam",), standard=JUDGED)
    scenes = {one.name: one.scene for one in advice_scenes() if one.name in names}
    budget = run.choose(quick=10.0, standard=np.inf)
    claims, silent, cells = [], 0, 0
    for name, scene in run.progress(scenes.items(), "scenes"):
        rng = generator(run.seed, f"{run.experiment.id}.{name}")
        rows, counts = run.cached(name, lambda name=name, scene=scene, rng=rng: claims_of(
            name, scene, budget, rng))
        claims += [Claim(*row) for row in rows]
        silent, cells = silent + counts[0], cells + counts[1]
    run.table("claims", COLUMNS, claims)
    record_claims(run, claims, silent, cells)


def claims_of(name, scene, budget, rng):
    """Return the `Claim`s about a scene as lists, and [the number of wrong cells without a warning,
    that of all cells].
    """
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies))
    times = tuple(np.linspace(0.0, scene.end, TIMES).tolist())
    observed = ObservedRun(msgspec.json.encode(scene).decode(), digest(scene), (QUANTITY,), times,
                           probes)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore(), budget)
        judge = CellJudge(scene, runs, probes, (QUANTITY,), ERROR)
        judge.start()
        search = LimitsSearch(judge)
        search.run()
        wrong = search.wrong_cells()
        tested = {cell: RIGHT for cell in drawn_cells(search.directions, rng)}
        tested |= {cell: WRONG for cell in wrong if len(cell) == 1}
        free = SceneRuns(observed, executor, RunStore())
        claims = [list(claim) for claim in compared(name, tested, judge.scenes, free)]
    silent = sum(not warnings_of(judge.scenes.scene(cell)) for cell in wrong)
    return claims, [silent, len(judge.verdicts)]


def drawn_cells(directions, rng):
    """Return cells with random factors between 1 and the farthest that is right, of all directions
    between whose rungs other factors are possible.
    """
    return [cell_of({one.axis.name: float(10.0 ** (share * log10(one.good)))})
            for one in directions
            if not one.is_discrete and one.axis.name != "origin" and one.good != 1.0
            for share in rng.uniform(0.1, 1.0, DRAWS)]


def compared(name, cells, scenes, runs):
    """Yield the `Claim` of each of {cell: claim}."""
    own = request(scenes, (), 1.0), request(scenes, (), FINER)
    base = difference(*runs.observe(dict(enumerate(own))).values())
    tolerance = max(ERROR, SLACK * base)
    for cell, claim in cells.items():
        both = request(scenes, cell, 1.0), request(scenes, physical(cell), FINER)
        ours, reference = runs.observe(dict(enumerate(both))).values()
        error, status = np.nan, ours.outcome
        if ours.finished and not reference.finished:
            status = f"the reference: {reference.outcome}"
        elif ours.finished:
            error = difference(ours, reference)
            status = RIGHT if error <= tolerance else WRONG
        yield Claim(name, cell_text(cell), claim, error, tolerance, status)


def request(scenes, cell, dx):
    """Return the `RunRequest` of a cell at dx times a factor. Raises SceneError."""
    scene = scenes.scene(cell, dx)
    if isinstance(scene, SceneError):
        raise scene
    return RunRequest(scene, LONGEST, probes=scenes.probes(cell))


def difference(run, reference):
    """Return the largest relative difference of two runs."""
    return float(differences(run.values[QUANTITY], reference.values[QUANTITY], False).max())


def record_claims(run, claims, silent, cells):
    """Record the share of claims that a finer reference confirms."""
    scale = f"{len({one.scene for one in claims})} scenes, {cells} cells of their searches"
    for claim, words, rule in (
            (RIGHT, "cells between 1 and the farthest factor that is right",
             {"comparator": ">=", "paper": KEPT}),
            (WRONG, "cells of one axis that finished with a wrong result", {"comparator": "info"})):
        judged = [one for one in claims if one.claim == claim and (
            claim == RIGHT or one.status in (RIGHT, WRONG))]
        others = [one for one in judged if one.status != claim]
        run.record(f"trade.limits.{claim}", 1.0 - len(others) / len(judged) if judged else None,
                   scale=scale, note=f"share of {len(judged)} {words} that a grid of a quarter of "
                   "the spacing confirms" + "".join(
                       f"; {one.scene} {one.cell}: {one.status} {one.error:.3g}"
                       for one in others[:10]), **rule)
    run.record("trade.limits.silent", silent, unit="cells", comparator="<=", bound=0, scale=scale,
               note="cells that finish with a wrong result, without a warning as the run begins")
