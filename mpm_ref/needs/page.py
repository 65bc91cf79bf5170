"""The facts of the page of an answer: those of `NeedsAnswer.facts`, with words and verdicts."""

from math import isfinite

from .answer import grid_note, grid_text, lean_lines, scene_lines
from .code_parts import table_rows
from .removal import (
    COSTLY,
    IMPOSSIBLE,
    NOT_REQUIRED,
    NOTHING,
    REQUIRED,
    UNMEASURED,
    takes_longer,
)

WORDS = {REQUIRED: "required", NOT_REQUIRED: "not required",
         COSTLY: "not required, but takes more CPU time", IMPOSSIBLE: "cannot be removed",
         UNMEASURED: "not measured"}
DEARER = "costs more to leave out"      # of a run that was stopped


def page_facts(answer):
    """Return the facts of the page of a `NeedsAnswer`: each removal with its verdicts by the change
    that counts as not required, and the lines of the terminal.
    """
    facts, result = answer.facts, answer.result
    removals = zip(facts["removals"], result.singles, strict=True)
    return facts | {
        "scene": answer.name, "nothing": NOTHING, "words": [*WORDS.values(), DEARER],
        "scene_lines": scene_lines(result), "lean_lines": lean_lines(answer),
        "grid_text": grid_text(result.errors),
        "removals": [one | removal_facts(run, result) for one, run in removals],
        "order": [one | {"change": run.change}
                  for one, run in zip(facts["order"], result.order, strict=True)],
        "code_columns": list(answer.code), "code_rows": table_rows(answer.code),
    }


def removal_facts(run, result):
    """Return what the page adds to a `RemovalRun`: its change, verdicts, and a remark."""
    note = grid_note(run, result).removeprefix("; ") if run.changes else ""
    return {"change": run.change, "cases": verdict_cases(run, result), "grid_note": note}


def verdict_cases(run, result):
    """Return the verdicts on a removal: (x, verdict, words), x increasing. One holds from where a
    change of at most its x counts as not required up to the next x.

    Where no change was measured the verdict holds for every x.
    """
    if not isfinite(run.change):
        words = DEARER if run.verdict == COSTLY else WORDS[run.verdict]
        return [(0.0, run.verdict, words)]
    within = run.verdict
    if within == REQUIRED:
        within = COSTLY if takes_longer(run, result.cpu, result.noise) else NOT_REQUIRED
    return [(0.0, REQUIRED, WORDS[REQUIRED]), (run.change, within, WORDS[within])]
