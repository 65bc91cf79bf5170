"""The facts of the page of an answer: those of `answer.answer_of`, with words and colours."""

from ..sweep.observation import CRASHED, REFUSED, STOPPED, TORN, UNSTABLE
from .answer import (
    BUDGET_END,
    LAST_RUNG,
    base_lines,
    budget_lines,
    left_out_lines,
    map_lines,
    nearest_lines,
    reason,
    tolerance_lines,
    wrong_lines,
)
from .figure import COLOURS, DECADES, NAMES
from .verdict import LOST, RIGHT, UNCHECKED, WRONG

MARKS = {RIGHT: "✓", WRONG: "W", LOST: "L", TORN: "F", UNSTABLE: "U", REFUSED: "R", STOPPED: "T",
         UNCHECKED: "?", CRASHED: "C", None: "·"}       # of outcomes, beside their colours
ENDS = {LAST_RUNG: (RIGHT, "right as far as was tried"),
        BUDGET_END: (None, "the budget ended the search")}      # of directions without a failure


def page_facts(facts):
    """Return the facts of the page: outcomes with their colours, the ends of directions, lines."""
    maps = zip(facts["maps"], map_lines(facts), strict=True)
    return facts | {
        "decades": DECADES,
        "outcomes": [{"outcome": outcome, "name": NAMES.get(outcome, outcome), "colour": colour,
                      "mark": MARKS[outcome]} for outcome, colour in COLOURS.items()],
        "directions": [one | ending(one) for one in facts["directions"]],
        "maps": [one | {"line": line} for one, line in maps],
        "nearest_lines": nearest_lines(facts), "wrong_lines": wrong_lines(facts),
        "tolerance_lines": [*base_lines(facts), *tolerance_lines(facts)],
        "lines": [*left_out_lines(facts), *budget_lines(facts)],
    }


def ending(one):
    """Return how a direction ends: an outcome, which has a colour, words, and the reason."""
    cell = one["first_bad"]
    if one["end"] in ENDS:
        outcome, words = ENDS[one["end"]]
    else:
        outcome = cell["outcome"]
        words = NAMES.get(outcome, outcome)
    return {"outcome": outcome, "ends": words, "reason": "" if cell is None else reason(cell)}
