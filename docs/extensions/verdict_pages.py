"""The page of headlines, the page of misses, and the list of what was chosen on its own runs.

Rows are those of the report, each with the name of the place where it is shown.
"""

from collections import Counter

from validation.common import summary
from validation.common.summary import STATE_NAMES
from validation.common.verdicts import VARIANTS

from .markdown import cell, grid_table

FOLDER = "results/generated"
PAPERS = {"hot": "HOT", "ldm": "LDM", "ldmw": "LDM workshop", "nsf": "NSF", "nclaw": "NCLaw"}
NO_CAUSE = "cause not known"
KINDS = {"result": "Printed results", "variant": "By another method, of another body or size",
         "setting": "Printed settings"}


def pages(targets, rows):
    """Return {path: text} of the pages, from `Targets` and [(name of a place, `ReportRow`)]."""
    printed = [(place, row) for place, row in rows if row.kind in KINDS]
    return {f"{FOLDER}/headlines.md": "\n".join(headlines(targets, printed)),
            f"{FOLDER}/counts.md": "\n".join(counts(targets, printed)),
            f"{FOLDER}/misses.md": "\n".join(misses(targets, printed)),
            f"{FOLDER}/chosen.md": "\n".join(chosen(printed))}


# --- headlines

def headlines(targets, rows):
    """Yield a table for each paper: claim, verdicts, ratios and sizes; and the words in it."""
    standard = [(place, row) for place, row in rows if not place.endswith("-paper")]
    for paper, name in PAPERS.items():
        yield f"## {name}\n"
        yield from grid_table(
            ("claim", "verdicts", "ours over printed", "size of the first", "numbers"),
            (headline_row(one, targets, standard) for one in targets.headlines.get(paper, ())))
    yield "## Words\n"
    yield from grid_table(("word", "the numbers are"),
                          ([f"*{word}*", cell(text)] for word, text in VARIANTS.items()))


def headline_row(headline, targets, rows):
    """Return the cells of a headline."""
    one = summary.selected(headline, targets, rows)
    return [cell(headline.claim), summary.verdict_text(one), summary.ratio_text(one.shown),
            cell(one.shown[0][1].scale) if one.shown else "",
            f"[{len(one.ids)}](#{one.shown[0][0]})" if one.shown else str(len(one.ids))]


# --- counts

def counts(targets, rows):
    """Yield the tables of the three counts: results, settings, and other methods and bodies."""
    standard = [row for place, row in rows if not place.endswith("-paper")]
    for kind, title in KINDS.items():
        found = {paper: Counter(row.verdict for row in standard
                                if row.kind == kind and row.key == paper) for paper in PAPERS}
        states = [state for state in STATE_NAMES if any(found[p][state] for p in PAPERS)]
        yield f"{title}:\n"
        yield from grid_table(("paper", *(STATE_NAMES[state] for state in states)), (
            [name, *(str(found[paper][state]) for state in states)]
            for paper, name in PAPERS.items() if found[paper]))


# --- misses, and what was chosen

def misses(targets, rows):
    """Yield the tables of all missed printed numbers, each with its cause."""
    causes = [targets.cause(row.id) for _, row in rows if row.verdict == "miss"]
    certain = sum(cause is not None and cause.certain for cause in causes)
    yield f"Of {len(causes)} missed numbers {certain} have a cause that is certain.\n"
    for kind, title in KINDS.items():
        yield f"## {title}\n"
        for paper, name in PAPERS.items():
            found = [(place, row) for place, row in rows
                     if (row.verdict, row.kind, row.key) == ("miss", kind, paper)]
            if found:
                yield f"### {name}: {title[0].lower()}{title[1:]}\n"
                yield from grid_table(
                    ("number", "printed; accepted", "ours", "ratio", "size", "cause"),
                    (miss_row(place, row, targets) for place, row in found))


def miss_row(place, row, targets):
    """Return the cells of a miss."""
    expected = f"{row.paper}; {row.rule}" if row.rule else row.paper
    return [f"[{cell(row.what)}](#{place})", cell(expected), cell(row.ours), row.ratio,
            cell(row.scale), cause_text(targets.cause(row.id))]


def cause_text(cause):
    """Return a cause, with the experiment that shows it."""
    if cause is None:
        return NO_CAUSE
    shown = f" ([{cause.shown_by}](#numbers.{cause.shown_by}))" if cause.shown_by else ""
    return f"{cell(cause.sentence)}{shown}"


def chosen(rows):
    """Yield the table of the numbers that pass and are not judged, with what was chosen."""
    yield from grid_table(("number", "printed", "ours", "chosen"), (
        [f"[{cell(row.what)}](#{place})", cell(row.paper), cell(row.ours), cell(row.why)]
        for place, row in rows if row.verdict == "chosen"))
