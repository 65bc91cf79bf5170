"""The answer of a search as plain data for JSON, and as sentences."""

import re
from collections import Counter
from math import inf, isfinite, log10

from .. import __version__
from ..scene import digest
from ..store.text import counted
from ..sweep.observation import REFUSED, STOPPED
from .axes import AXIS, LEAST_NU, MOST_LONGER, UP
from .cause import RESOLUTION, SETTING, VANISHING, limit_counts
from .cell import FINE, cell_of, cell_text
from .search import NARROW
from .verdict import AT_COARSE, LOST, RIGHT, SLACK, UNCHECKED, WRONG

MARGIN, TOO_LONG, NOT_CHECKED, BUDGET_END, LAST_RUNG = (
    "failure", "too long", "not checked", "budget", "not tried farther")
LEAST_POISSON = f" (no scene has one below -1, and none below {LEAST_NU:g} is tried)"
UNRESOLVED = 0.5        # tolerance above which right and wrong mean little
SHOWN_WRONG = 10        # cells in the sentences; the JSON has all
SHOWN_MESSAGE = 150     # characters of a message


def answer_of(search, scene, name):
    """Return the answer as plain data; errors are relative, times in s.

    Axes are changed by factors; each direction has its margin, what ended it (`end`) and the first
    bad cell; `compared_with` names what its last good factor was compared with. Cells that
    finished with a wrong result come first, with the warnings that `mpm-ref run` gives of them, and
    `limits` counts these cells by warning or limit.
    """
    judge, scenes = search.judge, search.judge.scenes
    wrong = sorted(search.wrong_cells().items(), key=lambda item: distance(item[0]))
    directions = [direction_facts(one, judge) for one in search.directions]
    base = judge.base[1.0]
    wrong = [cell_facts(cell, verdict) for cell, verdict in wrong]
    return {
        "scene": name, "title": scene.title, "digest": digest(scene), "version": __version__,
        "end": scene.end, "error": judge.error, "quantities": list(judge.quantities),
        "tolerance": dict(judge.tolerance), "slack": SLACK, "most_longer": MOST_LONGER,
        "narrow": NARROW, "size": scenes.size, "base": {"outcome": base.outcome, **vars(base.cost)},
        "warnings": [*base.warnings, *warnings_of_reference(judge)],
        "wrong": wrong, "limits": limit_counts(wrong),
        "nearest": nearest(directions), "directions": directions, "left_out": search.left_out,
        "maps": [map_facts(one) for one in search.maps],
        "cells": [cell_facts(cell, verdict) for cell, verdict in judge.verdicts.items()],
        "cpu": judge.cpu, "missing_cpu": search.remaining() * judge.cpu / len(judge.verdicts),
        "complete": search.remaining() == 0,
    }


def warnings_of_reference(judge):
    """Return the sentence on a body that the scene as given tears at dx/2 alone, if any."""
    fine = judge.base.get(FINE)
    if fine is None or not fine.tear or judge.base[1.0].tear:
        return []
    return [f"at dx/2, which the others are compared with: {fine.tear}"]


def distance(cell):
    """Return the decades between a cell and the scene as given, along its farthest axis."""
    return max((abs(log10(factor)) for _, factor in cell), default=0.0)


def cell_facts(cell, verdict):
    """Return the facts of a cell; only those of the axes that it changes are factors."""
    facts = {"factors": dict(cell), "text": cell_text(cell)}
    return facts | ({"outcome": None} if verdict is None else vars(verdict))


def direction_facts(one, judge):
    """Return the facts of a `search.Direction`."""
    name, bad, scenes = one.axis.name, one.bad, judge.scenes
    late = None if one.late is None else judge.coarse.get(cell_of({name: one.late}))
    late = late if late is not None and isfinite(late.error) else None
    facts = {
        "axis": name, "text": one.axis.text, "direction": one.direction, "margin": one.margin,
        "verb": "grow" if (one.direction == UP) != one.axis.is_inverse else "fall",
        "good": one.good, "compared_with": compared_with(one, judge), "bad": bad,
        "end": end_of(one), "now": value(one, scenes, 1.0),
        "good_value": value(one, scenes, one.good),
        "bad_value": None if bad is None else value(one, scenes, bad),
        "first_bad": None if bad is None else cell_facts(cell_of({name: bad}), one.verdict),
        "late": one.late, "late_value": None if one.late is None else value(one, scenes, one.late),
        "late_cell": None if late is None else cell_facts(cell_of({name: one.late}), late)}
    return facts | {"sentence": sentence(facts)}


def compared_with(one, judge):
    """Return what the farthest right cell of a direction was compared with, in words."""
    verdict = judge.verdicts.get(cell_of({one.axis.name: one.good}))
    return "" if verdict is None else verdict.reference


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
    """Return the facts of the direction whose first bad factor is nearest to 1, or None. A refusal,
    which warns before the run, a lost contact and a vanishing quantity count where nothing else
    fails.
    """
    failing = [one for one in directions if one["bad"] is not None
               and one["first_bad"]["outcome"] not in (STOPPED, UNCHECKED)]
    return min(failing, key=lambda one: (is_milder(one["first_bad"]), abs(log10(one["bad"]))),
               default=None)


def is_milder(cell):
    """Return whether a failure counts only where there is no other."""
    return cell["outcome"] in (REFUSED, LOST) or cell["limit"] == VANISHING


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
    return [*base_lines(facts), *unresolved_lines(facts), *wrong_lines(facts), "",
            *nearest_lines(facts), "", *tolerance_lines(facts), "",
            *(one["sentence"] for one in facts["directions"]),
            *left_out_lines(facts), "", *map_lines(facts), *budget_lines(facts)]


def base_lines(facts):
    """Return the warnings of the scene as given, and how many right cells have warnings."""
    lines = [f"warning: the scene as given: {text}" for text in facts["warnings"]]
    warned = [one for one in facts["cells"] if one["outcome"] == RIGHT and one["factors"]
              and one["warnings"]]
    if warned:
        lines.append(f"right with a warning of the run: {counted(len(warned), 'cell')}, such as "
                     f"{warned[0]['text']}: {warned[0]['warnings'][0]}")
    return lines


def wrong_lines(facts):
    """Return the cells that finished with a wrong result, those without a warning first, and those
    in which a quantity vanishes last.
    """
    cells = sorted(facts["wrong"], key=lambda one: (is_milder(one), bool(one["warnings"])))
    if not cells:
        return ["no cell finished with a wrong result"]
    lines = [f"finished and wrong: {len(cells)} of {len(facts['cells'])} cells, "
             f"{counts_text(facts['limits'])}"]
    for one in cells[:SHOWN_WRONG]:
        notice = f"; warning: {one['warnings'][0]}" if one["warnings"] else ""
        lines.append(f"  {one['text']} {wrong_text(one)}{notice}")
    if len(cells) > SHOWN_WRONG:
        lines.append(f"  {len(cells) - SHOWN_WRONG} more stand in the JSON")
    return lines


def counts_text(counts):
    """Return the numbers of wrong cells by warning or limit as text."""
    return ", ".join(f"{n} by {name}" for name, n in counts.items())


def wrong_text(cell):
    """Return the limit that a wrong cell met, with its error beside its tolerance."""
    if cell["limit"] == VANISHING:
        off = percent(cell["share"] * cell["error"])
        return (f"({VANISHING}): {cell['quantity']} nearly vanishes here (at dx/2 it has "
                f"{percent(cell['share'])} of its change in the scene as given), so that its "
                f"relative error means little: it is {off} of that change off")
    return (f"({cell['limit']}): {percent(cell['error'])} off in {cell['quantity']} (tolerance "
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
    text, is_late = facts["text"], facts["end"] == BUDGET_END
    if facts["margin"] == 1.0 and facts["bad"] is None:
        return (f"{text}{late_text(facts)}" if facts["late_cell"] is not None else
                f"{text}: whether it may {facts['verb']} was not tried within the budget")
    if facts["margin"] == 1.0:
        within = " within the budget" if is_late else ""
        return (f"{text} {changed_by(facts, 'bad')}: {reason(facts['first_bad'])} (nothing nearer "
                f"was tried{within})")
    by = f" (compared with {AT_COARSE} alone)" if facts["compared_with"] == AT_COARSE else ""
    begin = f"{text} may {extent(facts)}{by}"
    if facts["bad"] is None and is_late:
        return f"{begin};{late_text(facts)}"
    if facts["bad"] is None:
        ends = facts["axis"] == "poisson" and f"{LEAST_NU:g}" in facts["good_value"]
        return f"{begin}, as far as was tried{LEAST_POISSON if ends else ''}"
    late = " (the budget ended the search between them)" if is_late else ""
    return f"{begin}; {changed_by(facts, 'bad')}: {reason(facts['first_bad'])}{late}"


def late_text(facts):
    """Return what is known of the factor at which the budget ended a search without a failure."""
    cell = facts["late_cell"]
    if cell is None:
        return " the budget ended the search"
    return (f" {changed_by(facts, 'late')}: {percent(cell['error'])} off in {cell['quantity']} "
            f"(tolerance {percent(cell['tolerance'])}), beside {cell['reference']}; the budget "
            "ended before dx/2 could decide")


def extent(facts):
    """Return the verb of a change with how far it is right, and the value that it leads to: that
    value alone, from that of the scene as given, where it is not the factor's multiple.
    """
    value, factor = facts["good_value"], facts["good"]
    if AXIS[facts["axis"]].is_inverse and value:
        return f"{facts['verb']} to {value} (from {facts['now']})"
    how = f"grow {number(factor)} times" if factor > 1.0 else (
        f"be divided by {number(1.0 / factor)}")
    return how + changed(facts, "good_value")


def changed_by(facts, key):
    """Return a change by the factor at a key in words, with the value that it leads to."""
    value, factor = facts[f"{key}_value"], facts[key]
    if AXIS[facts["axis"]].is_inverse and value:
        return f"at {value}"
    how = f"at {number(factor)} times" if factor > 1.0 else f"divided by {number(1.0 / factor)}"
    return how + changed(facts, f"{key}_value")


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
    """Return a line for each pair of axes: how many of the pairs of factors that were judged are
    right, those that fail together though each axis alone does not, and how many were not run.
    """
    return [f"{' and '.join(one['axes'])}: {'; '.join(map_parts(one))}" for one in facts["maps"]]


def map_parts(one):
    """Return the parts of the line of a map."""
    cells = [cell for row in one["cells"] for cell in row]
    pairs = [cell for cell in cells if len(cell["factors"]) == 2]
    known = Counter(cell["alone"] for cell in pairs if cell.get("alone"))
    judged = [cell for cell in pairs if cell["outcome"] is not None and not cell["alone"]]
    right, late = (sum(cell["outcome"] == outcome for cell in pairs) for outcome in (RIGHT, None))
    together = [cell["text"] for cell in judged if fails_together(cell, cells)]
    return [f"{right} of {len(judged)} pairs right" if judged else "no pair was judged",
            *[f"fails only together: {', '.join(together)}"] * bool(together),
            *(f"{n} refused by {AXIS[name].text} alone, not counted" for name, n in known.items()),
            *[f"{late} not run within the budget"] * bool(late)]


def fails_together(cell, cells):
    """Return whether a cell of two axes fails, and each axis alone is right."""
    alone = {(*one["factors"].items(),)[0]: one["outcome"] for one in cells
             if len(one["factors"]) == 1}
    return cell["outcome"] not in (RIGHT, STOPPED, UNCHECKED, LOST) and all(
        alone.get(pair) == RIGHT for pair in cell["factors"].items())


def unresolved_lines(facts):
    """Return a warning for each quantity that the scene as given does not resolve."""
    return [f"warning: the grid of the scene as given does not resolve {text}: a run counts as "
            f"right within {percent(share)}, so that right and wrong mean little"
            for text, share in facts["tolerance"].items()
            if share > max(UNRESOLVED, facts["error"])]


def tolerance_lines(facts):
    """Return what counts as right, and why that is more than the error asked."""
    tolerances = facts["tolerance"].items()
    wider = {text: share for text, share in tolerances if share > facts["error"]}
    shares = ", ".join(f"{text} within {percent(share)}" for text, share in tolerances)
    if not wider:
        return [f"what counts as right: {shares}, the error asked"]
    own = ", ".join(percent(share / facts["slack"]) for share in wider.values())
    return [f"what counts as right: {shares}, not the {percent(facts['error'])} asked"
            f"{only(wider, tolerances)}: the scene as given differs from itself at dx/2 by {own}, "
            f"and {facts['slack']:g} times that is allowed; a smaller dx asks for more"]


def only(wider, tolerances):
    """Return which quantities have a wider tolerance, where others have not."""
    return f" (of {', '.join(wider)})" if len(wider) < len(tolerances) else ""


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
