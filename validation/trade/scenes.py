"""The answers of `mpm-ref trade` on shipped scenes: `hello`, and one scene of each paper.

Each scene is searched for a large error of the positions, then for a small one with the runs that
there are, as the command does that is given once more. Two runs are made at a time. The errors are
5 % and 1 %; where a trial knew the positions to no 5 %, they are 20 % and 5 %.
"""

from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

from mpm_ref.cli.sweep_options import SweepRequest, load_sweep, observed_of
from mpm_ref.cli.trade import run_search
from mpm_ref.scene import digest, loads
from mpm_ref.sweep.quantity import with_companions
from mpm_ref.sweep.setting import scene_at, setting
from mpm_ref.trade.answer import answer_of, best_scene

from ..common.registry import experiment

FINE, COARSE = ("5%", "1%"), ("20%", "5%")
WORKERS = 2
AIMS = {"hello": 180.0}     # [s]
AIM = 1200.0                # [s] of the others
POINTS = ("scene", "asked", "setting", "outcome", "error", "cpu", "bytes", "front", "best")
COLUMNS = ("scene", "asked", "until", "end", "setting", "error", "reference", "cpu", "own_error",
           "own_cpu", "particles", "runs", "wall")


class TradeCase(NamedTuple):
    """A shipped scene and the budget of a search."""

    scene: str
    paper: str
    budget: str
    asked: tuple = FINE


STANDARD = (
    TradeCase("hello", "", "70s"),
    TradeCase("hot_stiffness", "HOT", "6min", COARSE),
    TradeCase("ldm_torsion", "LDM", "5min"),
    TradeCase("ldm_poke", "LDM workshop", "3min", COARSE),
    TradeCase("nsf_jelly", "NSF", "4min"),
    TradeCase("nclaw_jelly", "NCLaw", "4min"),
)
QUICK = (TradeCase("hello", "", "10s"),)


class Advice(NamedTuple):
    """The setting that a search recommends; NaN and "" without one."""

    scene: str
    asked: float
    until: float            # [s] to which the advice holds
    end: float              # [s] of the scene
    setting: str
    error: float            # expected of the setting
    reference: float        # error of the reference itself
    cpu: float              # [s] of the setting
    own_error: float        # of the scene's own setting
    own_cpu: float          # [s]
    particles: int
    runs: int
    wall: float             # [s] of this search
    same: bool              # the scene written, read again, is the one that was measured


@experiment("trade.scenes", title="The answers of `mpm-ref trade` on shipped scenes",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 3600})
def scenes(run):
    """Search the settings of all scenes."""
    answers, points = [], []
    for case in run.progress(run.choose(quick=QUICK, standard=STANDARD), "scenes"):
        advice, rows = run.cached(case.scene, lambda case=case: searched(case))
        answers += record_advice(run, case, [Advice(*row) for row in advice])
        points += rows
    run.table("advice", COLUMNS, [one[:len(COLUMNS)] for one in answers])
    run.table("points", POINTS, points)


def searched(case):
    """Return the `Advice` on a scene for each error asked, and the rows of all settings."""
    advice, points = [], []
    with TemporaryDirectory() as folder:
        for asked in case.asked:
            began = perf_counter()
            search = search_of(case, asked, Path(folder))
            advice.append(list(advice_of(search, case.scene, perf_counter() - began)))
            points += points_of(search, case.scene)
    return advice, points


def search_of(case, asked, folder):
    """Return a finished `TradeSearch`; its runs stay in a folder."""
    request = SweepRequest(case.scene, asked, case.budget, None, WORKERS, None, folder,
                           True).parsed()
    scene, path, tables = load_sweep(case.scene)
    request = request.for_scene(tables)
    observed = observed_of(scene, path, with_companions(request.quantities, scene.dim))
    return run_search(scene, observed, request, {})


def advice_of(search, name, wall):
    """Return the `Advice` of a search that took `wall` seconds."""
    best, own = search.best(), setting(dx=1.0)
    common = (name, search.error, search.horizon(), search.scene.end)
    own_cpu, runs = search.observations[own].cost.cpu, len(search.settings())
    if best is None:
        return Advice(*common, "", nan, nan, nan, nan, own_cpu, 0, runs, wall, True)
    cost, text = search.observations[best].cost, best_scene(search, name)
    same = digest(loads(text)) == digest(scene_at(search.scene, best))
    return Advice(*common, best.text, search.error_of(best), search.reference_error(), cost.cpu,
                  search.error_of(own), own_cpu, cost.particles, runs, wall, same)


def points_of(search, name):
    """Return the rows of all settings of a search."""
    return [(name, search.error, row["text"], row["outcome"], row["error"], row["cpu"],
             row["memory"], int(not row["dominated"]), int(row["best"]))
            for row in answer_of(search, name)["rows"]]


def record_advice(run, case, answers):
    """Record the time of the searches of a scene, and their `Advice`; return it."""
    base, scale = f"trade.scenes.{case.scene}", f"{case.scene}, {WORKERS} runs at a time"
    aim = AIMS.get(case.scene, AIM)
    run.record(f"{base}.wall", sum(one.wall for one in answers), unit="s", comparator="<=",
               bound=aim, scale=scale, note=f"both searches, for {' and '.join(case.asked)}, with "
               f"a budget of {case.budget} each")
    advised = [one for one in answers if one.setting]
    run.record(f"{base}.advised", len(advised), unit="errors", comparator=">=", bound=1,
               scale=scale, note="; ".join(sentence(one) for one in answers))
    run.record(f"{base}.changed", sum(not one.same for one in advised), unit="scenes",
               comparator="<=", bound=0, scale=scale,
               note="recommended scenes that differ from those that were measured when read again")
    return answers


def sentence(one):
    """Return an advice in words."""
    if not one.setting:
        return f"{one.asked:g}: none"
    return (f"{one.asked:g} until {one.until:.3g} of {one.end:.3g} s: {one.setting}, "
            f"{one.cpu:.3g} CPU s, error {one.error:.2g}")
