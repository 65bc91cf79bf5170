"""Are the claims of `mpm-ref limits` right? Cells that it did not run, against a finer reference.

`limits` says of each direction that the scene is right up to a factor; it runs a few factors, and
compares them with the grid of half the spacing. Here other factors below that one are drawn, and
their runs are compared with the grid of a quarter. A cell is right by the rule of `limits.verdict`:
it differs from its reference by at most twice as much as the scene as given differs from its own.
"""

from math import log10
from typing import NamedTuple

import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.limits.cause import LIMITS
from mpm_ref.limits.cell import cell_of, cell_text, physical
from mpm_ref.limits.verdict import RIGHT, SLACK, WRONG, differences
from mpm_ref.scene import SceneError
from mpm_ref.sweep.runs import RunRequest, SceneRuns
from mpm_ref.sweep.store import RunStore

from ..common.registry import experiment
from ..common.seeding import generator
from .advice_scenes import TUNED, advice_scenes
from .searched_cells import (
    COLUMNS,
    ERROR,
    QUANTITY,
    SearchedCell,
    cell_rows,
    observed_scene,
    record_notices,
    searched,
    silent_cells,
    table_rows,
)

JUDGED = ("slide", "stick", "swing", "lean", "dam", "sand", "splash", "impact")
CHOSEN = (*TUNED, "shove", "roll")     # for the bounds of `mpm_ref.indicators`
FINER = 0.25            # factor of dx of the reference
DRAWS = 3               # factors of a direction
KEPT = 0.95             # the aim: share of claims that are right
FALSE = 0.05            # the aim: share of right cells that have a warning
LONGEST = 60.0          # [s] of CPU time of one run
CLAIMS = ("scene", "cell", "claim", "error", "tolerance", "status")


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
    """Judge the claims on all scenes, and the warnings of the runs of their searches."""
    names = run.choose(quick=("dam",), standard=JUDGED)
    budget = run.choose(quick=10.0, standard=np.inf)
    claims, cells = [], []
    for name, scene in run.progress(scenes_of(names).items(), "scenes"):
        rng = generator(run.seed, f"{run.experiment.id}.{name}")
        rows, of_search = run.cached(name, lambda name=name, scene=scene, rng=rng: claims_of(
            name, scene, budget, rng))
        claims += [Claim(*row) for row in rows]
        cells += [SearchedCell(*row) for row in of_search]
    run.table("claims", CLAIMS, claims)
    run.table("cells", COLUMNS, table_rows(cells))
    record_claims(run, claims, len(cells))
    record_notices(run, cells, FALSE)
    record_silent(run, cells)


@experiment("trade.bounds", title="The bounds of the indicators of error, on the scenes on which "
            "they were chosen", profiles=("quick", "standard"),
            budget={"quick": 60, "standard": 2400})
def bounds(run):
    """Count what the bounds notice on the scenes on which they were chosen."""
    names = run.choose(quick=("spin",), standard=CHOSEN)
    budget = run.choose(quick=10.0, standard=np.inf)
    cells = []
    for name, scene in run.progress(scenes_of(names).items(), "scenes"):
        rows = run.cached(name, lambda name=name, scene=scene: cell_rows(
            name, searched(scene, observed_scene(scene), budget).judge))
        cells += [SearchedCell(*row) for row in rows]
    run.table("cells", COLUMNS, table_rows(cells))
    record_notices(run, cells, FALSE)


def scenes_of(names):
    """Return {name: scene} of some scenes of advice."""
    return {one.name: one.scene for one in advice_scenes() if one.name in names}


def claims_of(name, scene, budget, rng):
    """Return the `Claim`s about a scene as lists, and the rows of the cells of its search."""
    observed = observed_scene(scene)
    search = searched(scene, observed, budget)
    tested = {cell: RIGHT for cell in drawn_cells(search.directions, rng)}
    tested |= {cell: WRONG for cell in search.wrong_cells() if len(cell) == 1}
    with open_executor(workers=1) as executor:
        free = SceneRuns(observed, executor, RunStore())
        claims = [list(claim) for claim in compared(name, tested, search.judge.scenes, free)]
    return claims, cell_rows(name, search.judge)


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
            error = difference(ours, reference, "origin" in dict(cell))
            status = RIGHT if error <= tolerance else WRONG
        yield Claim(name, cell_text(cell), claim, error, tolerance, status)


def request(scenes, cell, dx):
    """Return the `RunRequest` of a cell at dx times a factor. Raises SceneError."""
    scene = scenes.scene(cell, dx)
    if isinstance(scene, SceneError):
        raise scene
    return RunRequest(scene, LONGEST, probes=scenes.probes(cell))


def difference(run, reference, shifted=False):
    """Return the largest relative difference of two runs; shifted: of their changes."""
    return float(differences(run.values[QUANTITY], reference.values[QUANTITY], shifted).max())


def record_claims(run, claims, cells):
    """Record the share of claims that a finer reference confirms; cells: number of all cells."""
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


def record_silent(run, cells):
    """Record the wrong `SearchedCell`s that their runs do not notice, by the limits that the search
    names.
    """
    silent = silent_cells(cells)
    far = [one for one in silent if one.is_far]
    scale = f"{len({one.scene for one in cells})} scenes, {len(cells)} cells of their searches"
    for name, group, words in (("silent", silent, ""), ("far_silent", far, ", far from right")):
        run.record(f"trade.limits.{name}", len(group), unit="cells", comparator="<=", bound=0,
                   scale=scale, note=f"cells with a wrong result without a warning of their run"
                   f"{words}" + "".join(f"; {one.scene} {one.cell}: {one.error:.3g} (tolerance "
                                        f"{one.tolerance:.3g}), {one.limit}" for one in group[:5]))
    for limit in LIMITS:
        run.record(f"trade.limits.limit.{limit.replace(' ', '_')}",
                   sum(one.limit == limit for one in silent), unit="cells", comparator="info",
                   scale=scale, note="silent cells to which the search gives this limit by name")
