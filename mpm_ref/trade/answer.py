"""The answer of a search: rows of all settings, the recommended one, and what is not known."""

from math import ceil, isfinite, log2

import numpy as np

from .. import __version__
from ..store.text import counted
from ..sweep.observation import FINISHED, STOPPED
from ..sweep.runs import LATE
from ..sweep.scene_text import scene_text
from ..sweep.setting import scene_at, setting
from .cost import duration, next_grid_facts, next_grid_text, price_text, rounded_up
from .reference import LEAST
from .search import REFERENCE_PART, without_grid
from .start import start_fault

NOT_RUN = "not run"         # outcome of a setting that the budget left out
AS_GIVEN = setting(dx=1.0)  # that of the scene itself
MOST_ERROR = 1.0            # that can be asked


def answer_of(search, name, compared=None, budget=None):
    """Return the answer as plain data, for JSON; errors are relative, times in s, memory in bytes.

    name: that of the scene; compared: {name: `RunObservation`} of results files; budget [s].
    """
    best, horizon = search.best(), search.horizon()
    kept = set(search.keeping(search.settings())) if horizon > 0.0 else set()
    as_given = search.observations.get(AS_GIVEN)
    facts = {
        "scene": name, "dim": search.scene.dim, "version": __version__, "error": search.error,
        "budget": budget, "end": search.times[-1],
        "quantities": list(search.quantities), "until": horizon, "chaos": search.chaos,
        "compared_with": search.compared_with,
        "grids": [search.scene.dx * factor for factor in search.levels],
        "cells": largest_extent(search.runs.probes) / search.scene.dx,
        "references": {text: reference_facts(search, text) for text in search.references},
        "next_grid": next_grid_facts(search),
        "best": None if best is None else best.text,
        "start_fault": "" if best is None else start_fault(search, best),
        "warnings": [] if as_given is None else list(as_given.warnings),
        "rows": [row(search, chosen, chosen == best, chosen in kept)
                 for chosen in ranked(search)],
        "compared": [compared_row(search, file, run) for file, run in (compared or {}).items()],
    }
    return facts | {"advice": advice_lines(facts)}


def largest_extent(probes):
    """Return the largest extent of a body along an axis at the start [m]; probes: of all bodies,
    (name, positions (n, d)).
    """
    return max(float(np.ptp(np.asarray(X), axis=0).max()) for _, X in probes)


def reference_facts(search, text):
    """Return what is known of the reference of a quantity."""
    reference = search.references[text]
    return {"error": float(reference.error[search.last]),
            "error_at_end": float(reference.error[-1]), "order_at_end": float(reference.order[-1]),
            "extrapolated": bool(reference.extrapolated[search.last or -1]),
            "differences": list(reference.differences), "scale": float(reference.scale[-1]),
            "least_error": search.least_error(text)}


def ranked(search):
    """Return all settings, those that finished by their CPU time first."""
    def rank(chosen):
        run = search.observations[chosen]
        return (run.outcome != FINISHED, run.cost.cpu if isfinite(run.cost.cpu) else 0.0)
    return sorted(search.settings(), key=rank)


def row(search, chosen, is_best, keeps):
    """Return the facts of one setting, which may be the best, and may keep the error."""
    run = search.observations[chosen]
    return {"setting": dict(chosen.items), "text": chosen.text, **run_facts(search, run),
            "keeps": keeps, "best": is_best, "as_given": chosen == AS_GIVEN,
            "family": without_grid(chosen).text}


def compared_row(search, file, run):
    """Return the facts of a results file, which is no setting that could be recommended."""
    return {"setting": {}, "text": file, **run_facts(search, run), "keeps": False, "best": False,
            "as_given": False, "family": "results file"}


def run_facts(search, run):
    """Return how a run ended, its errors until the horizon and until the end, and its cost.

    Until the end they are differences from a reference that is not known so far.
    """
    errors, at_end = ({text: search.error_of_run(run, (text,), k) for text in search.references}
                      for k in (None, -1))
    outcome, message = run.ending
    return {"outcome": NOT_RUN if run.message == LATE else outcome, "message": message,
            "until": run.until, "warnings": list(run.warnings),
            "error": search.error_of_run(run), "errors": errors,
            "error_at_end": search.error_of_run(run, k=-1), "errors_at_end": at_end,
            "dominated": is_dominated(search, run), **vars(run.cost)}


def is_dominated(search, run):
    """Return whether a setting has at most the error and less CPU time than a run: until the
    horizon, or until the end where no error is known.
    """
    if not run.is_sound:
        return True
    k = search.last or -1
    error, cpu = search.error_of_run(run, k=k), run.cost.cpu
    others = [search.observations[chosen] for chosen in search.settings()]
    return any(search.error_of_run(one, k=k) <= error and one.cost.cpu < cpu
               for one in others if one.is_sound)


def is_whole(facts):
    """Return whether the errors hold until the end of the run."""
    return facts["until"] >= facts["end"] * (1.0 - 1e-9)


def has_errors(facts):
    """Return whether the errors hold until some time."""
    return facts["until"] > 0.0


def shown_rows(facts, key="rows"):
    """Return the rows with the errors that are shown: differences from the reference until the end
    where no error is known.
    """
    if has_errors(facts):
        return facts[key]
    return [one | {"error": one["error_at_end"]} for one in facts[key]]


# in words

def answer_lines(facts):
    """Return the answer as lines of text: the front, the advice, and what is not known."""
    return [*warning_lines(facts), *front_lines(facts), "", *reference_lines(facts),
            *advice_lines(facts), *map(compared_line, facts["compared"])]


def warning_lines(facts):
    """Return the warnings of the run of the scene as given."""
    return [f"warning: the scene as given: {text}" for text in facts["warnings"]]


def front_lines(facts):
    """Return the table of the settings on the front, with the scene as given, and how many others
    there are; where no error is known, with the grids of the reference.
    """
    known, rows = has_errors(facts), shown_rows(facts)
    several = len(facts["quantities"]) > 1
    front = [one for one in rows if not one["dominated"] and is_number(one["error"])]
    shown = [one for one in rows if one in front or one["as_given"]
             or (not known and list(one["setting"]) == ["dx"])]
    lines = [] if is_whole(facts) else [f"errors until t = {facts['until']:.4g} s:" if known else
                                        "no error is known; differences from the reference "
                                        "over the whole run:"]
    if several:
        lines.append(f"largest of {len(facts['quantities'])} quantities, with the one that has it:")
    lines.append(f"{'setting':44} {'error' if known else 'differs':>9} {'CPU [s]':>9} "
                 f"{'particles':>9} {'steps':>7}")
    outcomes = [one["outcome"] for one in rows]
    counts = ", ".join(f"{outcomes.count(word)} {word}" for word in dict.fromkeys(outcomes))
    number = f"{len(front)} settings on the front; " if known else ""
    texts = facts["quantities"] if several else ()
    errors = "errors" if known else "errors_at_end"
    return [*lines, *(row_line(one, texts, errors) for one in shown),
            f"({number}of {len(outcomes)} settings {counts})"]


def row_line(one, texts, errors):
    """Return the line of a row in the table, with the one of several quantities (or of none) that
    has the largest of its errors, which stand under a key.
    """
    marks = [word for key, word in (("best", "recommended"), ("as_given", "as given")) if one[key]]
    mark = f"  <- {', '.join(marks)}" if marks else ""
    error = percent(one["error"]) if one["outcome"] == FINISHED else one["outcome"]
    worst = f"  {max(texts, key=lambda text: one[errors].get(text) or 0.0)}" if texts else ""
    return (f"{one['text']:44} {error:>9} {one['cpu'] or 0.0:9.3g} {one['particles']:9d} "
            f"{one['steps']:7d}{worst}{mark}")


def reference_lines(facts):
    """Return how far the solution is known."""
    if len(facts["grids"]) < 2:
        return ["fewer than two grids finished with whole bodies: nothing is known of the solution"]
    grids = ", ".join(f"{dx:.3g}" for dx in facts["grids"])
    lines = [f"reference: grids of dx = {grids} m"]
    for text in facts["quantities"]:
        reference = facts["references"][text]
        between = ", ".join(percent(value) for value in reference["differences"])
        error = f"{percent(reference['error'])} until t = {facts['until']:.4g} s"
        if not has_errors(facts):
            error = f"{percent(reference['error_at_end'])} over the whole run"
        how = ("extrapolated" if reference["extrapolated"] else
               "that on the finest grid, not extrapolated, since no two orders agree")
        lines.append(f"  {text}: known to {error} ({how}); differences of grids over the whole "
                     f"run: {between}")
    if is_number(facts["chaos"]):
        lines.append(f"  from t = {facts['chaos']:.4g} s on a run perturbed by round-off diverges: "
                     "single paths have no meaning there; ask for profile:x or energies")
    return lines


def advice_lines(facts):
    """Return the recommendation, or what it would take."""
    if facts["best"] is None:
        return [f"no setting keeps {percent(facts['error'])}:",
                *(f"  {text}" for text in shortfalls(facts)), *least_error_lines(facts),
                *companion_lines(facts)]
    return [*recommendation(facts), *caveats(facts)]


def least_error_lines(facts):
    """Return the line of what can be asked for the whole run without a finer grid."""
    if len(facts["grids"]) < 2:
        return []
    least = {text: facts["references"][text]["least_error"] for text in facts["quantities"]}
    texts = [f"{text} at {percent(rounded_up(error))}" if is_number(error) and error < MOST_ERROR
             else f"{text} at no error below {percent(MOST_ERROR)}"
             for text, error in least.items()]
    return [f"what can be asked now for the whole run: {', '.join(texts)} (the reference's own "
            f"error may be {percent(REFERENCE_PART)} of the error asked)"]


def recommendation(facts):
    """Return the recommended setting, and until when it holds."""
    best = next(one for one in facts["rows"] if one["best"])
    warning = [f"warning: {facts['start_fault']}"] if facts["start_fault"] else []
    margin = max(facts["references"][text]["error"] for text in facts["quantities"])
    lines = [f"recommended: {best['text']}: error {percent(best['error'])} (the reference's own: "
             f"{percent(margin)}), {best['cpu']:.3g} s of CPU time", *warning]
    if not is_whole(facts):
        lines += companion_lines(facts)
        lines.append(f"this holds until t = {facts['until']:.4g} s of {facts['end']:.4g} s; for "
                     f"the whole run: {'; '.join(shortfalls(facts))}")
    return lines


def caveats(facts):
    """Return what was not tried or not checked."""
    late = sum(one["outcome"] == NOT_RUN for one in facts["rows"])
    lines = [] if not late else [
        f"{counted(late, 'setting')} {'was' if late == 1 else 'were'} not run within the budget, "
        "among them perhaps a cheaper one; the same command with a larger --budget goes on"]
    if facts["compared_with"] is None:
        lines.append("no other transfer was run on a fine grid, so that the reference's error does "
                     "not include what transfers differ by")
    return lines


def compared_line(one):
    """Return the error and cost of a results file."""
    cost = "no CPU time given" if one["cpu"] is None else f"{one['cpu']:.3g} s of CPU time"
    return f"{one['text']}: error {percent(one['error'])}, {cost} with start and output"


def companion_lines(facts):
    """Return how well other quantities are known over the whole run, where single paths are not."""
    enough = REFERENCE_PART * facts["error"]
    others = {text: reference["error_at_end"] for text, reference in facts["references"].items()
              if text not in facts["quantities"] and reference["error_at_end"] is not None
              and reference["error_at_end"] <= enough}
    if not others:
        return []
    texts = ", ".join(f"{text} to {percent(error)}" for text, error in others.items())
    return [f"over the whole run these are known: {texts}; ask for one of them by --quantity"]


def shortfalls(facts):
    """Return what it would take to know the quantities for the whole run, in some texts."""
    if len(facts["grids"]) < 2:
        return [missing_grids(facts)]
    asked, texts = REFERENCE_PART * facts["error"], []
    for text in facts["quantities"]:
        reference = facts["references"][text]
        error, order = reference["error_at_end"], reference["order_at_end"]
        if not is_number(error) or order < LEAST:
            texts.append(f"the grids do not approach one solution of {text} yet (order "
                         f"{order:.2g}; it is known to {percent(error)})")
        elif error > asked:
            halvings = max(1, ceil(log2(error / asked) / order))
            finest = facts["grids"][-1] / 2**halvings
            texts.append(f"{text} is known to {percent(error)}; if errors go on falling with order "
                         f"{order:.2g} as on the last grids, a reference of {percent(asked)} takes "
                         f"dx = {finest:.3g} m, {price_text(facts, halvings)}")
    if not texts and is_number(facts["chaos"]):
        return ["chaos ends what can be known"]
    if not texts:
        texts.append(f"the finest grid, dx = {facts['grids'][-1]:.3g} m, does not keep the error")
    return [*texts, next_grid_text(facts)]


def missing_grids(facts):
    """Return why fewer than two grids make a reference, and what to do."""
    grids = [one for one in facts["rows"] if list(one["setting"]) == ["dx"]]
    failed = [one for one in grids if one["outcome"] not in (FINISHED, NOT_RUN, STOPPED)]
    stopped = next((one for one in grids if one["outcome"] == STOPPED and one["until"] > 0.0), None)
    if not failed and stopped is None:
        return "at least two grids must finish; give a larger --budget"
    if not failed:
        share = stopped["until"] / facts["end"]
        return (f"at least two grids must finish; {stopped['text']} reached t = "
                f"{stopped['until']:.3g} of {facts['end']:.3g} s in {duration(stopped['cpu'])} of "
                f"CPU time, so that it takes about {duration(stopped['cpu'] / share)}, and the "
                f"next grid {2 ** (facts['dim'] + 1)} times that; give a larger --budget")
    worst = next((one for one in failed if one["as_given"]), failed[0])
    name = "the scene as given" if worst["as_given"] else worst["text"]
    return (f"at least two grids must finish with whole bodies, which a larger --budget does not "
            f"change; {name}: {worst['outcome']}: {worst['message']}")


def is_number(value):
    """Return whether a value is a finite number, not None."""
    return value is not None and isfinite(value)


def percent(value):
    """Return a relative error as text."""
    return f"{100.0 * value:.3g} %" if is_number(value) else "unknown"


def best_scene(search, name, folder=".", quantities=(), fault=""):
    """Return the TOML text of the scene under the recommended setting, for a file in a folder, with
    comments on its error and cost; None without one.

    quantities: records of quantities of interest that the scene as given has; fault: sentence of
    its start, see `start_fault`.
    """
    best = search.best()
    if best is None:
        return None
    run, error = search.observations[best], search.error_of(best)
    asked = ", ".join(search.quantities)
    head = [
        f"{name}, with the setting that `mpm-ref trade` recommends: {best.text}",
        f"Error asked: {percent(search.error)} of {asked}, until t = "
        f"{search.horizon():.4g} s.",
        f"Expected error: {percent(error)}; the reference's own: "
        f"{percent(search.reference_error())}.",
        f"Cost: {run.cost.cpu:.3g} s of CPU time, {run.cost.steps} steps, "
        f"{run.cost.particles} particles.",
        *([f"Warning: {fault}."] if fault else []),
    ]
    return scene_text(head, scene_at(search.scene, best, search.others), folder, quantities)
