"""The answer of a search as plain data for JSON, and as sentences."""

import re
from math import inf, isfinite, log10

from .. import __version__
from ..scene import digest
from ..sweep.observation import REFUSED, STOPPED
from .axes import AXIS, MOST_LONGER, UP
from .cause import RESOLUTION, SETTING, limit_counts
from .cell import cell_of, cell_text
from .search import NARROW
from .verdict import LOST, RIGHT, SLACK, UNCHECKED, WRONG

MARGIN, TOO_LONG, NOT_CHECKED, BUDGET_END, LAST_RUNG = (
    "failure", "too long", "not checked", "budget", "not tried farther")
SHOWN_WRONG = 10        # cells in the sentences; the JSON has all
SHOWN_MESSAGE = 150     # characters of a message


def answer_of(search, scene, name):
    """Return the answer as plain data; errors are relative, times in s.

    Axes are changed by factors; each direction has its margin, what ended it (`end`) and the first
    bad cell. Cells that finished with a wrong result come first, with the warnings that
    `mpm-ref run` gives of them, and `limits` counts these cells by warning or limit.
    """
    judge, scenes = search.judge, search.judge.scenes
    wrong = sorted(search.wrong_cells().items(), key=lambda item: distance(item[0]))
    directions = [direction_facts(one, scenes) for one in search.directions]
    base = judge.base[1.0]
    wrong = [cell_facts(cell, verdict) for cell, verdict in wrong]
    return {
        "scene": name, "title": scene.title, "digest": digest(scene), "version": __version__,
        "end": scene.end, "error": judge.error, "quantities": list(judge.quantities),
        "tolerance": dict(judge.tolerance), "slack": SLACK, "most_longer": MOST_LONGER,
        "narrow": NARROW, "size": scenes.size, "base": {"outcome": base.outcome, **vars(base.cost)},
        "wrong": wrong, "limits": limit_counts(wrong),
        "nearest": nearest(directions), "directions": directions, "left_out": search.left_out,
        "maps": [map_facts(one) for one in search.maps],
        "cells": [cell_facts(cell, verdict) for cell, verdict in judge.verdicts.items()],
        "cpu": judge.cpu, "missing_cpu": search.remaining() * judge.cpu / len(judge.verdicts),
        "complete": search.remaining() == 0,
    }


def distance(cell):
    """Return the decades between a cell and the scene as given, along its farthest axis."""
    return max((abs(log10(factor)) for _, factor in cell), default=0.0)


def cell_facts(cell, verdict):
    """Return the facts of a cell; only those of the axes that it changes are factors."""
    facts = {"factors": dict(cell), "text": cell_text(cell)}
    return facts | ({"outcome": None} if verdict is None else vars(verdict))


def direction_facts(one, scenes):
    """Return the facts of a `search.Direction`."""
    name, bad = one.axis.name, one.bad
    facts = {
        "axis": name, "text": one.axis.text, "direction": one.direction, "margin": one.margin,
        "verb": "grow" if (one.direction == UP) != one.axis.is_inverse else "fall",
        "good": one.good, "bad": bad, "end": end_of(one), "now": value(one, scenes, 1.0),
        "good_value": value(one, scenes, one.good),
        "bad_value": None if bad is None else value(one, scenes, bad),
        "first_bad": None if bad is None else cell_facts(cell_of({name: bad}), one.verdict)}
    return facts | {"sentence": sentence(facts)}


def value(one, scenes, factor):
    """Return the value that an axis changes, at a factor, as text; "" where it cannot be said."""
    try:
        return one.axis.reading(scenes.tables(cell_of({one.axis.name: factor})))
    except ValueError:
        return ""


def end_of(one):
    """Return what ended the search along a direction."""
    if one.verdict is not None and one.verdict.outcome in (STOPPED, UNCHECKED):
        return TOO_LONG if one.verdict.outcome == STOPPED else NOT_CHECKED
    if one.is_late:
        return BUDGET_END
    return MARGIN if one.failed else LAST_RUNG


def nearest(directions):
    """Return the facts of the direction with the least margin to a failure, or None. A refusal,
    which warns before the run, and a lost contact count where nothing else fails.
    """
    failing = [one for one in directions if one["bad"] is not None
               and one["first_bad"]["outcome"] not in (STOPPED, UNCHECKED)]
    return min(failing, key=lambda one: (one["first_bad"]["outcome"] in (REFUSED, LOST),
                                         one["margin"]), default=None)


def map_facts(one):
    """Return the facts of a `search.PairMap`."""
    names = [axis.name for axis in one.axes]
    rows = [[cell_facts(cell_of({names[0]: a, names[1]: b}), verdict)
             for b, verdict in zip(one.factors[1], row, strict=True)]
            for a, row in zip(one.factors[0], one.verdicts, strict=True)]
    return {"axes": names, "factors": [list(factors) for factors in one.factors], "cells": rows}


# in words

def answer_lines(facts):
    """Return the answer as lines of text."""
    lines = [*wrong_lines(facts), "", *nearest_lines(facts), ""]
    lines += [one["sentence"] for one in facts["directions"]]
    lines += [*left_out_lines(facts), "", *map_lines(facts), *tolerance_lines(facts)]
    return lines + budget_lines(facts)


def wrong_lines(facts):
    """Return the cells that finished with a wrong result, those without a warning first."""
    cells = sorted(facts["wrong"], key=lambda one: bool(one["warnings"]))
    if not cells:
        return ["no cell finished with a wrong result"]
    lines = [f"finished and wrong: {len(cells)} of {len(facts['cells'])} cells, "
             f"{counts_text(facts['limits'])}"]
    for one in cells[:SHOWN_WRONG]:
        notice = f"; warning: {one['warnings'][0]}" if one["warnings"] else ""
        lines.append(f"  {one['text']}: {wrong_text(one)}{notice}")
    if len(cells) > SHOWN_WRONG:
        lines.append(f"  {len(cells) - SHOWN_WRONG} more stand in the JSON")
    return lines


def counts_text(counts):
    """Return the numbers of wrong cells by warning or limit as text."""
    return ", ".join(f"{n} by {name}" for name, n in counts.items())


def wrong_text(cell):
    """Return the limit that a wrong cell met, with its error beside its tolerance."""
    return (f"by {cell['limit']}, {percent(cell['error'])} off in {cell['quantity']} (tolerance "
            f"{percent(cell['tolerance'])}), beside {cell['reference']}{coarse_text(cell)}")


def coarse_text(cell):
    """Return the error of a wrong cell's run at 2 dx, where the limit follows from it."""
    if cell["limit"] == SETTING or not isfinite(cell["coarse_error"]):
        return ""
    less = "" if cell["limit"] == RESOLUTION else " no more than"
    return f", where 2 dx is{less} {percent(cell['coarse_error'])} off"


def nearest_lines(facts):
    """Return the nearest failure."""
    if facts["nearest"] is None:
        return ["no failure within the factors that were tried"]
    return [f"nearest failure: {facts['nearest']['sentence']}"]


def sentence(facts):
    """Return how far one axis may change in one direction, and what happens then."""
    if facts["margin"] == 1.0 and facts["bad"] is None:
        return f"{facts['text']}: whether it may {facts['verb']} was not tried within the budget"
    begin = f"{facts['text']} may {facts['verb']}"
    if facts["margin"] > 1.0:
        begin += f" {extent(facts, 'good', 'to ')}"
    else:
        begin += " by less than was tried"
    if facts["bad"] is None:
        return begin + ("; the budget ended the search" if facts["end"] == BUDGET_END
                        else ", as far as was tried")
    then = f"at {extent(facts, 'bad')}: {reason(facts['first_bad'])}"
    late = " (the budget ended the search between them)" if facts["end"] == BUDGET_END else ""
    return f"{begin}; {then}{late}"


def extent(facts, key, preposition=""):
    """Return a factor as text with the value that it leads to: that value alone, from that of the
    scene as given, where it is not the factor's multiple.
    """
    value = facts[f"{key}_value"]
    if AXIS[facts["axis"]].is_inverse and value:
        origin = f" (from {facts['now']})" if preposition else ""
        return f"{preposition}{value}{origin}"
    factor = facts[key]
    return f"{number(max(factor, 1.0 / factor))} times{changed(facts, f'{key}_value')}"


def changed(facts, key):
    """Return a value in brackets where it differs from that of the scene as given."""
    return f" ({facts[key]})" if facts[key] and facts[key] != facts["now"] else ""


def reason(cell):
    """Return why a cell is not right, in the first clause of its message."""
    if cell["outcome"] == WRONG:
        return f"wrong {wrong_text(cell)}"
    if cell["outcome"] == STOPPED:
        return f"the run takes more than {MOST_LONGER:g} times as long as now"
    if cell["outcome"] == UNCHECKED:
        return f"it finishes, but cannot be checked: {shortened(cell['message'])}"
    return f"{cell['outcome']}: {shortened(cell['message'])}"


def shortened(message):
    """Return the first clause of a message, without what stands in brackets."""
    text = re.sub(r"\s*\([^()]*\)", "", message.split(";")[0])
    return text if len(text) <= SHOWN_MESSAGE else f"{text[:SHOWN_MESSAGE]}..."


def left_out_lines(facts):
    """Return a line for each axis that is not changed, with the reason."""
    return [f"{AXIS[name].text}: not changed, {why}" for name, why in facts["left_out"].items()]


def budget_lines(facts):
    """Return what is missing where the budget ended the search."""
    if facts["complete"]:
        return []
    return ["the budget ended the search; the same command with a larger --budget goes on: at "
            f"least {time_text(facts['missing_cpu'])} of CPU time are missing"]


def map_lines(facts):
    """Return a line for each pair of axes: cells that are right, and those that fail together
    though each axis alone does not.
    """
    lines = []
    for one in facts["maps"]:
        cells = [cell for row in one["cells"] for cell in row]
        judged = [cell for cell in cells if cell["outcome"] is not None]
        alone = {(*cell["factors"].items(),)[0]: cell["outcome"] for cell in judged
                 if len(cell["factors"]) == 1}
        both = [cell for cell in judged if cell["outcome"] not in (RIGHT, STOPPED, UNCHECKED, LOST)
                and len(cell["factors"]) == 2
                and all(alone.get(pair) == RIGHT for pair in cell["factors"].items())]
        right = sum(cell["outcome"] == RIGHT for cell in judged)
        joint = f"; fails only together: {', '.join(cell['text'] for cell in both)}" if both else ""
        lines.append(f"{' and '.join(one['axes'])}: {right} of {len(judged)} cells right{joint}")
    return lines


def tolerance_lines(facts):
    """Return what counts as right."""
    lines = []
    for text, tolerance in facts["tolerance"].items():
        origin = "the error asked" if tolerance <= facts["error"] else (
            f"{SLACK:g} times the difference of the scene as given from itself at dx/2")
        lines.append(f"right: {text} within {percent(tolerance)}, {origin}")
        if tolerance > 0.5:
            lines.append(f"  the grid does not resolve {text}: right and wrong mean little here")
    return lines


def number(value):
    """Return a factor as text, with powers of ten from a million on."""
    return f"{value:.3g}" if value < 1e3 or value >= 1e6 else f"{value:.0f}"


def time_text(seconds):
    """Return a time as text, in the unit that suits it."""
    unit, name = next((pair for pair in ((3600.0, "h"), (60.0, "min")) if seconds >= 2.0 * pair[0]),
                      (1.0, "s"))
    return f"{seconds / unit:.2g} {name}"


def percent(share):
    """Return a relative error as text."""
    return f"{100.0 * share:.3g} %" if share is not None and isfinite(share or inf) else "any share"
