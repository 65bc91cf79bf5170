"""Maps of small shipped scenes: each property is changed over its full decades, by itself.

`mpm-ref limits` stops in each direction at the first cell that is not right. Here all factors of
all axes are run, and each has its verdict: right; wrong, and noticed by a warning of its run; wrong
and silent, so that a finer grid alone shows it; stopped with a message; refused; or without a
contact that the scene as given has. A wrong cell is far where its error is more than twice the
tolerance; no run should be far wrong and silent.

Scenes are coarser and shorter than they ship, so that all cells and their companions at dx/2 take
minutes.
"""

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.limits.axes import DOWN, UP, applicable, rungs
from mpm_ref.limits.cell import cell_of
from mpm_ref.limits.verdict import LOST, RIGHT, UNCHECKED, WRONG, CellJudge
from mpm_ref.scene.validate import plain, validate_scene
from mpm_ref.sweep.observation import CRASHED, REFUSED, STOPPED, UNSTABLE
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.setting import in_seconds, scene_at, setting
from mpm_ref.sweep.store import RunStore

from ..common.registry import experiment
from ..common.scenes import catalogue_scene
from ..trade.searched_cells import (
    COLUMNS,
    ERROR,
    QUANTITY,
    SearchedCell,
    cell_rows,
    observed_scene,
    silent_cells,
    table_rows,
)

WEIGHTS = Path(__file__).parents[1] / "nclaw" / "weights" / "jelly.npz"
LEARNED = {"law": "neural", "weights": str(WEIGHTS)}
QUICK_AXES, QUICK_END = ("time_step", "gravity"), 0.2       # axes, and share of the scene's end
GROUPS = {      # names of records: outcomes whose cells they count
    "right": (RIGHT,), "wrong": (WRONG,), "refused": (REFUSED,), "contact_lost": (LOST,),
    "stopped": (UNSTABLE, CRASHED), "too_long": (STOPPED,), "not_checked": (UNCHECKED,)}


class MappedScene(NamedTuple):
    """A shipped scene as it is mapped."""

    name: str
    scene: str              # of the catalogue
    dx: float               # factor of the grid spacing
    end: float              # [s]
    material: dict | None = None        # in place of that of the first body


EXPLICIT = (MappedScene("jelly", "hello", 1.0, 0.5),
            MappedScene("sand", "column_collapse", 4.0, 0.1),
            MappedScene("water", "dam_break", 2.0, 0.1))
HOT = (MappedScene("bust", "hot_faceless", 2.0, 0.25),)
LEARNED_LAW = (MappedScene("learned_jelly", "nclaw_jelly", 2.0, 0.1, LEARNED),)


@experiment("extremes.explicit.scenes", title="Jelly, sand and water, each property changed over "
            "decades", profiles=("quick", "standard"), budget={"quick": 30, "standard": 500})
def explicit_scenes(run):
    """Map scenes of explicit steps."""
    map_scenes(run, run.choose(quick=EXPLICIT[:1], standard=EXPLICIT))


@experiment("extremes.hot.scenes", title="An elastic bust, each property changed over decades",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 500})
def hot_scenes(run):
    """Map a scene of implicit steps."""
    map_scenes(run, HOT)


@experiment("extremes.nclaw.scenes", title="NCLaw: a jelly of a learned law, each property changed "
            "over decades", profiles=("quick", "standard"), budget={"quick": 30, "standard": 300})
def nclaw_scenes(run):
    """Map a scene of a learned law."""
    map_scenes(run, LEARNED_LAW)


def map_scenes(run, chosen):
    """Map each `MappedScene`; at quick an earlier end and few factors."""
    is_quick = run.choose(quick=True, standard=False)
    cells = []
    for one in run.progress(chosen, "scenes"):
        scene = small_scene(one, QUICK_END if is_quick else 1.0)
        rows = run.cached(one.name, lambda one=one, scene=scene: mapped(one.name, scene, is_quick))
        cells += [SearchedCell(*row) for row in rows]
        record_map(run, one.name, [cell for cell in cells if cell.scene == one.name])
    run.table("cells", COLUMNS, table_rows(cells))


def small_scene(one, share=1.0):
    """Return the scene of a `MappedScene`, until a share of its end."""
    scene = validate_scene(in_seconds(catalogue_scene(one.scene)))
    tables = {key: value for key, value in plain(scene_at(scene, setting(dx=one.dx))).items()
              if value is not None}
    tables["end"] = share * one.end
    if "interval" in tables:
        tables["interval"] = min(tables["interval"], tables["end"])
    if one.material is not None:
        tables["body"][0]["material"] = one.material
    return validate_scene(tables)


def mapped(name, scene, is_quick):
    """Return the rows of all cells of the map of a scene."""
    observed = observed_scene(scene)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore(), np.inf)
        judge = CellJudge(scene, runs, observed.probes, (QUANTITY,), ERROR)
        judge.start()
        judge.judge(axis_cells(judge.scenes.tables(), is_quick), by_fine_grids=True)
    return cell_rows(name, judge)


def axis_cells(tables, is_quick=False):
    """Return the cells of all factors of all axes that apply to plain tables, one at a time."""
    axes, _ = applicable(tables, (QUANTITY,))
    if is_quick:
        axes = [axis for axis in axes if axis.name in QUICK_AXES]
    return [cell_of({axis.name: factor}) for axis in axes for direction in (DOWN, UP)
            for factor in rungs(axis, tables, direction)[:1 if is_quick else None]]


def record_map(run, name, cells):
    """Record how the cells of one scene end, and those that no one would notice."""
    base, counts = f"{run.experiment.id}.{name}", Counter(one.outcome for one in cells)
    scale = f"{len(cells)} cells, each judged beside itself at dx/2"
    for group, outcomes in GROUPS.items():
        run.record(f"{base}.{group}", sum(counts[outcome] for outcome in outcomes), unit="cells",
                   comparator="info", scale=scale)
    silent = silent_cells(cells)
    far = [one for one in silent if one.is_far]
    run.record(f"{base}.silent", len(silent), unit="cells", comparator="info", scale=scale,
               note="wrong cells without a warning of their run; `mpm-ref limits` names their "
               "limits: " + (", ".join(f"{n} {limit}" for limit, n in Counter(
                   one.limit for one in silent).items()) or "none"))
    run.record(f"{base}.far_silent", len(far), unit="cells", comparator="<=", bound=0, scale=scale,
               note="those with an error of more than twice the tolerance" + "".join(
                   f"; {one.cell}: {one.error:.3g} (tolerance {one.tolerance:.3g})"
                   for one in far[:8]))
    run.record(f"{base}.without_message", sum(not one.message for one in cells if one.outcome in (
        UNSTABLE, CRASHED, REFUSED, STOPPED, UNCHECKED, LOST)), unit="cells", comparator="<=",
        bound=0, scale=scale, note="cells that have no verdict of right or wrong, and no message")
