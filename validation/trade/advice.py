"""Is the advice of `mpm-ref trade` right? 24 scenes, five quantities, four errors asked.

The 18 scenes, with 360 cases, that were not used to choose the rules of the search are judged.

The search may use grids down to a quarter of the scene's spacing. The truth is a closed form, or
the reference of grids down to an eighth with its own error, that of another transfer included; a
case is judged where that error is at most a quarter of the error asked. The rivals of the search
are the settings of a plain sweep: each single knob on each grid. The advice and the cheapest
setting that keeps the error are timed once more, in turn: the least of many times that scatter is
smaller than the time of that setting.
"""

from typing import NamedTuple

import msgspec
import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.scene import build, digest
from mpm_ref.sweep.difference import change_so_far
from mpm_ref.sweep.observation import ObservedRun, observe
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.setting import Setting, scene_at, setting
from mpm_ref.sweep.store import RunStore
from mpm_ref.trade.candidates import GRIDS, single_knobs
from mpm_ref.trade.reference import QuantityReference
from mpm_ref.trade.search import TradeSearch

from ..common.registry import experiment
from .advice_scenes import TUNED, advice_scenes

ERRORS = (0.1, 0.05, 0.02, 0.01)
TIMES = 17
SEARCHED, TRUE = 0.25, 0.125    # factors of dx of the finest grids of searches and of the truth
KNOWN = 0.25                    # of the error asked, which that of the truth may be
REPEATS, LONG = 5, 2.0          # runs of a setting that is timed; [s], from which on it is enough
KEPT, DEAR = 0.95, 1.5          # the aims: share of advice that is right, its cost over the least
COLUMNS = ("scene", "quantity", "asked", "until", "setting", "claimed", "error", "truth", "cpu",
           "least", "cheapest", "status")
RIGHT, WRONG, UNKNOWN, NONE = "right", "wrong", "not judged", "no advice"


class AdviceCase(NamedTuple):
    """One case: what was asked, advised and measured."""

    scene: str
    quantity: str
    asked: float
    until: float        # [s] to which the advice holds
    setting: str
    claimed: float      # error of the setting as the search estimates it
    error: float        # as the truth says
    truth: float        # error of the truth
    cpu: float          # [s] of the setting
    least: float        # [s] of the cheapest setting that keeps the error
    cheapest: str
    status: str


def cases_of(one, sweep):
    """Return the `AdviceCase`s of an `AdviceScene`; sweep: whether the plain sweep is run."""
    probes = tuple((p.body, p.X) for p in choose_probes(build(one.scene).bodies))
    times = np.linspace(0.0, one.scene.end, TIMES)
    observed = ObservedRun(msgspec.json.encode(one.scene).decode(), digest(one.scene),
                           one.quantities, tuple(times.tolist()), probes)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore())
        searches = {(text, asked): search(one, runs, times, text, asked)
                    for text in one.quantities for asked in ERRORS}
        truth = true_search(one, runs, times, probes)
        if sweep:
            truth.observe(plain_sweep(one.scene), most_cpu=np.inf)
        for other in searches.values():
            truth.observations |= {s: other.observations[s] for s in other.settings()}
        pairs = [settings_to_time(search, truth) for search in searches.values()]
        cpu = timed_in_turn(one.scene, observed, dict.fromkeys(s for p in pairs for s in p))
    return [case_of(one.name, search, truth, cpu) for search in searches.values()]


def search(one, runs, times, text, asked):
    """Return the search for a quantity and an error, as `mpm-ref trade` makes it."""
    result = TradeSearch(one.scene, runs, (text,), times, asked, finest=SEARCHED)
    result.run()
    return result


def true_search(one, runs, times, probes):
    """Return a search whose references are the truth of all quantities."""
    truth = TradeSearch(one.scene, runs, one.quantities, times, 1e-9, finest=TRUE)
    truth.start()
    truth.refine()
    truth.compare_families()
    if one.exact is not None:
        zero = np.zeros(len(times))
        for text, values in one.exact(times, np.concatenate([X for _, X in probes])).items():
            truth.references[text] = QuantityReference(
                values, change_so_far(values), zero, zero, zero > 0.0, ())
    return truth


def plain_sweep(scene):
    """Return each single knob on each grid that a search may use."""
    grids = [factor for factor in GRIDS if factor >= SEARCHED]
    families = [Setting(), *single_knobs(scene)]
    return [family | setting(dx=factor) for family in families for factor in grids]


def true_error(chosen, search, truth):
    """Return the error of a setting until the horizon of a search, as the truth says."""
    text, = search.quantities
    run = truth.observations[chosen]
    return float(truth.references[text].error_of(run.values[text])[search.last])


def least_of(search, truth):
    """Return the cheapest of all settings tried that keeps the error, or None."""
    if search.horizon() <= 0.0:
        return None
    good = [s for s in truth.settings() if truth.observations[s].is_sound
            and s.get("dx", 1.0) >= SEARCHED and true_error(s, search, truth) <= search.error]
    return min(good, key=lambda s: truth.observations[s].cost.cpu, default=None)


def settings_to_time(search, truth):
    """Return the recommended setting and the cheapest that keeps the error; none if they are the
    same.
    """
    best, least = search.best(), least_of(search, truth)
    return () if best is None or least is None or best == least else (best, least)


def timed_in_turn(scene, observed, settings):
    """Return {setting: CPU time [s]}, medians of runs that are made in turn."""
    times = {chosen: [] for chosen in settings}
    for _ in range(REPEATS):
        for chosen in settings:
            if sum(times[chosen]) < LONG:
                text = msgspec.json.encode(scene_at(scene, chosen)).decode()
                times[chosen].append(observe(observed._replace(scene=text)).cost.cpu)
    return {chosen: float(np.median(values)) for chosen, values in times.items()}


def case_of(name, search, truth, cpu):
    """Return the `AdviceCase` of a search; cpu: {setting: [s]} of those that were timed again."""
    (text,), asked, until = search.quantities, search.error, search.horizon()
    own = float(truth.references[text].error[search.last])
    best, least = search.best(), least_of(search, truth)
    cost = {s: cpu.get(s, truth.observations[s].cost.cpu) for s in (best, least) if s is not None}
    if best is None:
        return AdviceCase(name, text, asked, until, "", np.nan, np.nan, own, np.nan,
                          cost.get(least, np.nan), "" if least is None else least.text, NONE)
    error = true_error(best, search, truth)
    status = UNKNOWN if own > KNOWN * asked else RIGHT if error <= asked else WRONG
    return AdviceCase(name, text, asked, until, best.text, search.error_of(best), error, own,
                      cost[best], cost.get(least, np.nan),
                      "" if least is None else least.text, status)


@experiment("trade.advice", title="The advice of `mpm-ref trade`, judged on scenes not used in its "
            "making", profiles=("quick", "standard"), budget={"quick": 60, "standard": 3600})
def advice(run):
    """Judge the advice on all scenes."""
    scenes = advice_scenes()
    chosen = run.choose(quick=[s for s in scenes if s.name == "stick"], standard=scenes)
    sweep = run.choose(quick=False, standard=True)
    cases = []
    for one in run.progress(chosen, "scenes"):
        rows = run.cached(one.name, lambda one=one: [list(c) for c in cases_of(one, sweep)])
        cases += [AdviceCase(*row) for row in rows]
    run.table("cases", COLUMNS, [tuple(case) for case in cases])
    record_cases(run, [c for c in cases if c.scene not in TUNED], judged=True)
    record_cases(run, [c for c in cases if c.scene in TUNED], judged=False)


def record_cases(run, cases, judged):
    """Record how often the advice was right, and what it costs over the least; judged: with a
    verdict, under another name than without.
    """
    if not cases:
        return
    base = "trade.advice" if judged else "trade.advice.tuned"
    share = {"comparator": ">=", "paper": KEPT} if judged else {"comparator": "info"}
    least = {"comparator": "<=", "paper": DEAR} if judged else {"comparator": "info"}
    scale = (f"{len({c.scene for c in cases})} scenes, {len(cases)} cases, dx down to {SEARCHED} "
             "of the scene's")
    sure = [case for case in cases if case.status in (RIGHT, WRONG)]
    right = [case for case in sure if case.status == RIGHT]
    wrong = [f"{c.scene} {c.quantity} {c.asked:g}: {c.error:.3g}" for c in sure
             if c.status == WRONG]
    none, unknown = (sum(c.status == status for c in cases) for status in (NONE, UNKNOWN))
    run.record(f"{base}.judged", len(sure), comparator="info", scale=scale,
               note=f"of {len(cases)} cases; {none} without advice, {unknown} whose truth is not "
               "known well enough")
    run.record(f"{base}.right", len(right) / len(sure) if sure else None, **share, scale=scale,
               note="share of judged advice that keeps the error asked"
               + ("; wrong: " + ", ".join(wrong) if wrong else ""))
    ratios = np.array([case.cpu / case.least for case in right if case.least > 0.0])
    run.record(f"{base}.cost", float(np.median(ratios)) if len(ratios) else None, **least,
               scale=scale, note="median CPU time of the advice over that of the cheapest setting "
               "of the search and of a plain sweep that keeps the error")
    run.record(f"{base}.dear", float(np.mean(ratios > DEAR)) if len(ratios) else None,
               comparator="info", scale=scale, note=f"share that costs over {DEAR} times the least")
