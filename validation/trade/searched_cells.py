"""The cells of searches by `mpm-ref limits`: which wrong ones their runs notice, and which right
ones they warn of in vain.

A cell is noticed where its run gives a warning: before its start (`mpm_ref.preflight`) or by an
indicator (`mpm_ref.indicators`). A wrong cell is far where its error is more than twice the
tolerance. The search narrows each edge down, so that most wrong cells are near the tolerance, where
right and wrong ones hardly differ.
"""

from typing import NamedTuple

import msgspec
import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.indicators import INDICATORS
from mpm_ref.limits.cell import cell_text
from mpm_ref.limits.search import LimitsSearch
from mpm_ref.limits.verdict import RIGHT, WRONG, CellJudge
from mpm_ref.scene import build, digest
from mpm_ref.sweep.observation import ObservedRun
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.store import RunStore

QUANTITY, ERROR, TIMES = "positions", 0.05, 17
FAR, CLEAR = 2.0, 0.5   # times the tolerance: far wrong, and clearly right
PREFLIGHT = "preflight"             # the name of a warning before the start
CAUSES = (*INDICATORS, PREFLIGHT)


class SearchedCell(NamedTuple):
    """A cell of a search: its verdict, and the names of its run's warnings."""

    scene: str
    cell: str
    outcome: str
    error: float
    tolerance: float
    limit: str              # of `mpm_ref.limits.cause`
    coarse_error: float     # of the run at 2 dx
    warnings: str           # of CAUSES, with spaces between them
    message: str            # of a run that did not finish
    values: tuple           # worst values of INDICATORS, NaN where not measured

    @property
    def is_far(self):
        """Return whether the cell is wrong by more than `FAR` times its tolerance."""
        return self.outcome == WRONG and not self.error <= FAR * self.tolerance


COLUMNS = (*SearchedCell._fields[:-1], *INDICATORS)


def observed_scene(scene):
    """Return the `ObservedRun` of a scene, with its probes."""
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies))
    times = tuple(np.linspace(0.0, scene.end, TIMES).tolist())
    return ObservedRun(msgspec.json.encode(scene).decode(), digest(scene), (QUANTITY,), times,
                       probes)


def searched(scene, observed, budget):
    """Return a finished `LimitsSearch` of a scene, of runs that begin within a budget [s]. Unlike
    that of `mpm-ref limits` it begins after the scene as given, its references and the compilation
    of their kernels.
    """
    with open_executor(workers=1) as executor:
        store = RunStore()
        judge_of(scene, SceneRuns(observed, executor, store)).start()
        judge = judge_of(scene, SceneRuns(observed, executor, store, budget))
        judge.start()
        search = LimitsSearch(judge)
        search.run()
    return search


def judge_of(scene, runs):
    """Return the `CellJudge` of a scene and its `SceneRuns`."""
    return CellJudge(scene, runs, runs.probes, (QUANTITY,), ERROR)


def cell_rows(name, judge):
    """Return the rows of all cells of a `CellJudge`: lists for `SearchedCell`s."""
    return [cell_row(name, cell_text(cell), verdict) for cell, verdict in judge.verdicts.items()]


def cell_row(name, text, verdict):
    """Return the fields of a `SearchedCell` as a list."""
    return [name, text, verdict.outcome, verdict.error, verdict.tolerance, verdict.limit,
            verdict.coarse_error, " ".join(dict.fromkeys(map(cause_of, verdict.warnings))),
            verdict.message,
            [verdict.indicators.get(one, np.nan) for one in INDICATORS]]


def cause_of(warning):
    """Return the name of a warning, of CAUSES."""
    name = warning.split(":")[0]
    return name if name in INDICATORS else PREFLIGHT


def table_rows(cells):
    """Return the rows of a table of `SearchedCell`s, with COLUMNS."""
    return [(*one[:-1], *one.values) for one in cells]


# what is noticed

class Notice(NamedTuple):
    """Numbers of cells: wrong, far wrong and right ones, and those of them with a warning."""

    wrong: int
    far: int
    right: int
    wrong_noticed: int
    far_noticed: int
    right_noticed: int


def notice_of(cells, is_noticed):
    """Return the `Notice` of `SearchedCell`s by a function that says whether one is noticed."""
    wrong = [one for one in cells if one.outcome == WRONG]
    groups = (wrong, [one for one in wrong if one.is_far],
              [one for one in cells if one.outcome == RIGHT])
    return Notice(*map(len, groups), *(sum(map(is_noticed, group)) for group in groups))


def share(part, total):
    """Return part/total, None without a total."""
    return part / total if total else None


def record_notices(run, cells, most_false):
    """Record what all warnings together notice, and each cause alone, of `SearchedCell`s.

    most_false: share of right cells that may have a warning.
    """
    base, names = run.experiment.id, dict.fromkeys(one.scene for one in cells)
    every, scale = notice_of(cells, lambda one: bool(one.warnings)), f"{len(names)} scenes"
    run.record(f"{base}.noticed", share(every.wrong_noticed, every.wrong), comparator="info",
               scale=scale, note=f"share of {every.wrong} wrong cells with a warning of their run")
    run.record(f"{base}.far_noticed", share(every.far_noticed, every.far), comparator="info",
               scale=scale, note=f"share of {every.far} cells wrong by more than {FAR:g} times the "
               "tolerance with a warning of their run")
    run.record(f"{base}.false_alarms", share(every.right_noticed, every.right), comparator="<=",
               bound=most_false, scale=scale,
               note=f"share of {every.right} right cells with a warning of their run")
    clear = [one for one in cells if one.outcome == RIGHT and one.error <= CLEAR * one.tolerance]
    run.record(f"{base}.clear_false_alarms",
               share(sum(bool(one.warnings) for one in clear), len(clear)), comparator="info",
               scale=scale, note=f"the same of {len(clear)} right cells with an error of at most "
               "half the tolerance")
    for cause in CAUSES:
        one = notice_of(cells, lambda cell, cause=cause: cause in cell.warnings.split())
        run.record(f"{base}.{cause}", one.wrong_noticed, unit="cells", comparator="info",
                   scale=scale, note=f"wrong cells with this warning, {one.far_noticed} of them "
                   f"far; {one.right_noticed} right ones")


def silent_cells(cells):
    """Return the wrong `SearchedCell`s without a warning, the farthest from its tolerance first."""
    silent = [one for one in cells if one.outcome == WRONG and not one.warnings]
    return sorted(silent, key=lambda one: -one.error / one.tolerance)
