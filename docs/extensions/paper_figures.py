"""A page for each figure and table of the papers: what it shows, and ours beside it.

The words stand in `docs/paper_figures/<paper>.toml`, one `[[entry]]` for each figure or table. The
numbers come from `validation/targets` and the records: a number whose `paper_ref` names the figure
belongs to it, and so do those that the entry's `numbers` match.
"""

import re
import tomllib
from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path

import msgspec

from validation.common.summary import counted
from validation.common.verdicts import overruled, printed_id

from .markdown import cell, grid_table
from .verdict_pages import KINDS, PAPERS, cause_text

TEXTS = Path(__file__).resolve().parents[1] / "paper_figures"
FOLDER = "results/paper-figures"
PLACE = re.compile(r"(Figure|Table) (\d+)")     # in `paper_ref`
COLUMNS = ("number", "printed; accepted", "ours", "ratio", "verdict", "size")


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a figure or a table of a paper shows, and what of ours shows it."""

    place: str                      # "Figure 15"
    title: str                      # a few words
    shows: str                      # in the paper
    ours: str = ""                  # how ours differs from it
    experiments: list[str] = []     # that make it
    drawn: list[str] = []           # figures of ours, by the name of their script
    numbers: list[str] = []         # patterns of ids, beside those whose `paper_ref` names it
    absent: str = ""                # why nothing of ours stands beside it


def read(paper):
    """Return the `Entry`s of a paper in their order; ValueError for a file that is not valid."""
    path = TEXTS / f"{paper}.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    try:
        return msgspec.convert(content["entry"], list[Entry])
    except msgspec.ValidationError as fault:
        raise ValueError(f"{path.name}: {fault}") from None


def numbers_of(paper, entry, targets):
    """Return the printed `Target`s of an entry; one that repeats another is replaced by it."""
    found = {}
    for id, target in targets.items():
        by_place = entry.place in map(" ".join, PLACE.findall(target.paper_ref))
        by_id = any(fnmatchcase(id, pattern) for pattern in entry.numbers)
        if id.split(".")[0] == paper and (by_place or by_id):
            original = target.again or id
            found[original] = targets[original]
    return list(found.values())


def pages(targets, rows, images):
    """Return {path: text} of the pages.

    rows: [(name of a place, `ReportRow`)]; images: {name of a drawn figure: (path, caption)}.
    """
    by_number = {}
    for place, row in rows:
        by_number.setdefault(printed_id(row.id, targets)[0], []).append((place, row))
    result = {f"{FOLDER}/index.md": front()}
    for paper in PAPERS:
        entries = read(paper)
        result[f"{FOLDER}/{paper}.md"] = index(paper, entries, targets, by_number)
        for entry in entries:
            result[f"{FOLDER}/{page_name(paper, entry)}.md"] = page(
                paper, entry, numbers_of(paper, entry, targets), by_number, images, targets)
    return result


def page_name(paper, entry):
    """Return the name of an entry's page, "hot-figure-15"."""
    return f"{paper}-{re.sub('[^a-z0-9]+', '-', entry.place.lower())}"


def front():
    """Return the page that leads to the pages of all papers."""
    return "\n".join([
        "# Figure by figure", "",
        "For each figure and table of the papers: what it shows, in our words, and our figure and "
        "numbers beside it. [How to read a verdict](../index.md#how-to-read-a-verdict) explains "
        "the verdicts.", "", *(f"- [{name}]({paper}.md)" for paper, name in PAPERS.items()), "",
        *toctree(PAPERS)])


def toctree(names):
    """Return the lines of a hidden table of contents."""
    return ["```{toctree}", ":hidden:", "", *names, "```", ""]


# --- the page of a paper

def index(paper, entries, targets, by_number):
    """Return the page that lists the figures and tables of a paper."""
    table = grid_table(("in the paper", "about", "ours", "printed results"), (
        index_row(paper, entry, numbers_of(paper, entry, targets), by_number)
        for entry in entries))
    return "\n".join([
        f"# {PAPERS[paper]}: figure by figure", "",
        "The last column counts the verdicts on the printed results that belong to a figure or "
        "table; a result that two of them print counts in both.", "", *table,
        *toctree(page_name(paper, entry) for entry in entries)])


def index_row(paper, entry, numbers, by_number):
    """Return the cells of a figure or table."""
    ours = ", ".join(f"`{id}`" for id in entry.experiments)
    return [f"[{entry.place}]({page_name(paper, entry)}.md)", cell(entry.title),
            ours or "no counterpart", verdicts(numbers, by_number) or "none"]


def verdicts(numbers, by_number):
    """Return the counts of verdicts on printed results, by the paper's own method and by others."""
    results = [target for target in numbers if target.kind != "setting" and not overruled(target)]
    rows = [row for target in results for _, row in by_number.get(target.id, ())]
    own = [row for row in rows if row.kind == "result"]
    others = [row for row in rows if row.kind == "variant"]
    parts = [counted(own)] if own else []
    parts += [f"*by another method, of another body or size*: {counted(others)}"] if others else []
    absent = sum(target.id not in by_number for target in results)
    return "; ".join(parts + ([f"{absent} not measured"] if absent else []))


# --- the page of a figure or table

def page(paper, entry, numbers, by_number, images, targets):
    """Return the page of a figure or table."""
    found = verdicts(numbers, by_number)
    lines = [f"(paper.{page_name(paper, entry)})=",
             f"# {PAPERS[paper]}, {entry.place}: {cell(entry.title)}", "",
             *([f"**Printed results:** {found}.", ""] if found else []),
             "## In the paper", "", entry.shows, "", "## Ours", ""]
    lines += [entry.absent, ""] if entry.absent else []
    lines += [entry.ours, ""] if entry.ours else []
    if entry.experiments:
        links = ", ".join(f"[`{id}`](#numbers.{id})" for id in entry.experiments)
        lines += [f"Made by {links}.", ""]
    for name in entry.drawn:
        path, caption = images[name]
        lines += [f"![{cell(name)}]({path})", "", cell(caption), ""]
    return "\n".join([*lines, *tables(numbers, by_number, targets)])


def tables(numbers, by_number, targets):
    """Return the tables of the printed numbers of an entry, by kind, with causes of misses."""
    pairs = [pair for target in numbers for pair in by_number.get(target.id, ())]
    lines = []
    for kind, title in KINDS.items():
        found = [(place, row) for place, row in pairs if row.kind == kind]
        if found:
            lines += [f"## {title}", "", *grid_table(COLUMNS, map(number_row, found)),
                      *causes(found, targets)]
    return lines + without(numbers, by_number)


def number_row(pair):
    """Return the cells of a number of ours beside the printed one."""
    place, row = pair
    expected = f"{row.paper}; {row.rule}" if row.rule else row.paper
    verdict = f"**{row.verdict}**" if row.verdict == "miss" else row.verdict
    return [f"[{cell(row.what)}](#{place})", cell(expected), cell(row.ours), row.ratio, verdict,
            cell(row.scale)]


def causes(pairs, targets):
    """Return a line for each cause of misses, with the numbers that it explains."""
    by_cause = {}
    for _, row in pairs:
        if row.verdict == "miss":
            by_cause.setdefault(cause_text(targets.cause(row.id)), []).append(row.id)
    lines = [f"- *Missed:* {shortened(ids)}: {text}." for text, ids in by_cause.items()]
    return [*lines, ""] if lines else []


def shortened(ids):
    """Return ids as text: the first four, and how many more there are."""
    text = ", ".join(f"`{id}`" for id in ids[:4])
    return text + (f" and {len(ids) - 4} more" if len(ids) > 4 else "")


def without(numbers, by_number):
    """Return what is said of the printed numbers that no record has."""
    left = [target for target in numbers if target.id not in by_number]
    if not left:
        return []
    kinds = Counter(map(reason, left))
    if len(left) > 12:
        return ["## Without a number of ours", "",
                *(f"- {count}: {why}" for why, count in kinds.items()), ""]
    return ["## Without a number of ours", "", *(
        f"- {cell(target.what)}, {target.value:g} {cell(target.unit)}: {reason(target)}"
        for target in left), ""]


def reason(target):
    """Return why a printed number has no record."""
    if overruled(target):
        return "another reading replaces it, see the [equation index](../../reference/equations.md)"
    return "a setting that is not compared" if target.kind == "setting" else "not measured"
