"""Pages of results: the numbers of each paper and group, and the list of all experiments.

Printed results, printed settings and our own numbers have pages of their own.
"""

import base64
import inspect
from collections import Counter
from functools import cache
from typing import NamedTuple

from validation.common import targets
from validation.common.citations import ROOT
from validation.common.judge import VERDICTS
from validation.common.registry import GROUPS, discover
from validation.common.report import chapters
from validation.common.results import RESULTS, ProfileResults

from . import atlas, change_page, mutation_page, paper_figures, settings, verdict_pages, which_model
from .markdown import cell, grid_table

FOLDER = "results/numbers"
PAPERS = {"hot": ("hot",), "ldm": ("ldm", "ldmw"), "nsf": ("nsf",), "nclaw": ("nclaw",)}
NAMES = {"hot": "HOT", "ldm": "LDM", "nsf": "NSF", "nclaw": "NCLaw", "explicit": "explicit MPM"}
OPENINGS = {
    "verification": "Verification, the numbers: analytic and manufactured solutions",
    "independent": "Second implementations, the numbers: agreement with the package",
    "trade": "Error against cost, the numbers: {}",
    "extremes": "Where methods break, the numbers: {}",
}
ONE_PAGE = ("verification", "independent")      # groups whose experiments share a page
COLUMNS = ("what", "printed; accepted", "measured", "verdict", "scale")
OWN_COLUMNS = ("what", "expected; accepted", "measured", "verdict", "note")
PARTS = {           # of a paper's experiment: kinds of its rows
    "": ("result", "variant"), "settings": ("setting",), "more": ("own",)}
COUNTED = {"printed": ("result",), "another method or body": ("variant",),
           "settings": ("setting",), "own": ("own",)}
HEADINGS = {"more": "numbers that the paper does not print", "settings": "printed settings"}
MOST_ROWS = 150         # of our own numbers of an experiment; the others stand in its records


class Shown(NamedTuple):
    """A part of an experiment's section, and where it is shown."""

    section: object     # `report.Section`
    part: str           # of PARTS, "" of the first that an experiment has
    profile: str
    rows: list          # of `report.ReportRow`
    title: str
    page: str           # its name in FOLDER


def pages():
    """Return {path: text, or bytes of a figure} of the pages."""
    by_page, missing = {}, missing_numbers()
    for one in shown_experiments():
        by_page.setdefault(one.page, []).append(one)
    result = {f"{FOLDER}/{page}.md": numbers(page, shown, missing.get(page, ()))
              for page, shown in by_page.items()}
    result |= {f"{FOLDER}/{figure_file(one, figure)}": base64.b64decode(figure.data)
               for one in shown_experiments() for figure in one.section.figures}
    result["results/generated/experiments.md"] = experiments(missing)
    printed = targets.load()
    rows = [(label(one), row) for one in shown_experiments() for row in one.rows]
    result |= verdict_pages.pages(printed, rows)
    result |= paper_figures.pages(printed, rows, images())
    result |= atlas.pages(shown_experiments())
    standard = ProfileResults(RESULTS / "standard")
    return (result | change_page.pages() | mutation_page.pages()
            | settings.pages(standard) | which_model.pages(standard))


@cache
def all_chapters(profile):
    """Return the report's chapters of a profile by their key."""
    return {c.key: c for c in chapters(ProfileResults(RESULTS / profile), targets.load())}


@cache
def declared():
    """Return {id: `Experiment`} of all experiments."""
    return discover().experiments


@cache
def shown_experiments():
    """Return the `Shown` of all experiments with results, by profile and group."""
    return [one for profile in ("standard", "paper")
            for chapter in all_chapters(profile).values()
            for section in chapter.sections for one in shown_parts(section, profile)]


def shown_parts(section, profile):
    """Return the `Shown`s of a section: a paper's experiment has one for each of PARTS."""
    group, second = section.id.split(".")[:2]
    known = declared().get(section.id)
    title = known.title if known else section.id
    if group in OPENINGS:
        page = group if group in ONE_PAGE else f"{group}-{second}"
        return [Shown(section, "", profile, section.rows, title, page)] if section.rows else []
    paper = next(paper for paper, groups in PAPERS.items() if group in groups)
    by_part = {part: [row for row in section.rows if row.kind in kinds]
               for part, kinds in PARTS.items()}
    present = [part for part, rows in by_part.items() if rows]
    return [Shown(section, part if part != present[0] else "", profile, by_part[part], title,
                  "-".join(filter(None, (paper, part)))) for part in present]


@cache
def experiment_places():
    """Return {id: (page, name of the section)} of the experiments at the standard profile."""
    return {one.section.id: (f"{FOLDER}/{one.page}", label(one))
            for one in shown_experiments() if one.profile == "standard" and not one.part}


def missing_numbers():
    """Return {paper: printed numbers that no experiment at the standard profile has}."""
    made = all_chapters("standard")
    return {paper: [t for group in groups if group in made for t in made[group].missing]
            for paper, groups in PAPERS.items()}


def label(one):
    """Return the name of the place of a part of an experiment's section."""
    return "-".join(filter(None, (f"numbers.{name_of(one)}", one.part)))


def name_of(one):
    """Return the id of an experiment, with the profile unless it is the standard one."""
    return one.section.id + ("" if one.profile == "standard" else f"-{one.profile}")


def missing_label(paper):
    """Return the name of the place that lists the printed numbers of a paper without ours."""
    return f"numbers.{paper}.missing"


# --- the numbers of a paper or of a group of experiments

def numbers(page, shown, missing):
    """Return the page of a paper or of a group."""
    if page in PAPERS:
        parts = [f"# {NAMES[page]}: printed and measured numbers", "",
                 f"[The summary](../{page}.md) says what these numbers mean, and [How to read a "
                 "verdict](../index.md#how-to-read-a-verdict) what stands in the tables."]
    else:
        parts = [f"# {heading(page)}", "",
                 "[Experiments](../experiments.md) lists all experiments with links to their code."]
    for one in shown:
        parts += section_text(one, page not in PAPERS and not page.endswith("-settings"))
    if missing:
        parts += ["", f"({missing_label(page)})=", "## Not measured", "",
                  *(f"- {cell(t.what)} ({cell(t.paper_ref)})" for t in missing), ""]
    return "\n".join(parts)


def heading(page):
    """Return the heading of a page without printed numbers."""
    first, _, second = page.partition("-")
    if second in HEADINGS:
        return f"{NAMES[first]}: {HEADINGS[second]}"
    return OPENINGS[first].format(NAMES.get(second, ""))


def figure_file(one, figure):
    """Return the path of a figure, which each profile has one of, beside the page."""
    return f"figures/{one.profile}/{figure.name}.webp"


def images():
    """Return {name: (path from a neighbouring folder, caption)} of the standard figures."""
    return {figure.name: (f"../numbers/{figure_file(one, figure)}", figure.caption)
            for one in shown_experiments() if one.profile == "standard"
            for figure in one.section.figures}


def section_text(one, own):
    """Return the lines of one experiment: figures, table and notes."""
    section = one.section
    size = "" if one.profile == "standard" else f" Profile: `{one.profile}`."
    title = cell(one.title) + ("" if one.title.endswith("?") else ".")
    lines = ["", f"({label(one)})=", f"## {cell(section.id)}", "", f"{title}{size}", ""]
    for remark in section.remarks:
        if remark != one.title:
            lines += [cell(remark), ""]
    for figure in section.figures if not one.part else ():
        lines += [f"![{cell(figure.name)}]({figure_file(one, figure)})", "",
                  cell(figure.caption), ""]
    lines += own_table(one) if own else [*printed_table(one.rows), "", *notes(one.rows), ""]
    return lines


def printed_table(rows):
    """Return the table of printed numbers; a scale that all share stands before it."""
    scales = {row.scale for row in rows}
    columns = COLUMNS if len(scales) > 1 else COLUMNS[:-1]
    first = [f"Scale: {cell(scales.pop())}.", ""] if len(scales) == 1 else []
    return first + grid_table(columns, (
        list(map(cell, (described(row), expected(row), row.ours, row.verdict, row.scale)))
        [:len(columns)]
        for row in rows))


def described(row):
    """Return what a row measures; a number without a printed one is described by its note."""
    return row.what if row.kind != "own" or not row.note else f"{row.what}: {row.note}"


def own_table(one):
    """Return the table of an experiment of our own, with a note for each row."""
    rows = one.rows[:MOST_ROWS]
    lines = grid_table(OWN_COLUMNS, (
        list(map(cell, (row.what, expected(row), row.ours, row.verdict, row.note)))
        for row in rows))
    if len(rows) < len(one.rows):
        lines += [f"{len(one.rows) - len(rows)} more numbers stand in "
                  f"`results/{one.profile}/{one.section.id}.json`.", ""]
    return lines


def expected(row):
    """Return the printed or analytic value with the accepted range."""
    return f"{row.paper}; {row.rule}" if row.rule else row.paper


def notes(rows):
    """Return the notes of missed numbers, each text once."""
    missed = {row.note: row.what for row in reversed(rows) if row.verdict == "miss" and row.note}
    return [f"- *Missed:* {cell(what)}: {cell(note)}" for note, what in reversed(missed.items())]


# --- the list of all experiments

def experiments(missing):
    """Return the tables of all experiments by group, each linked to its numbers and its code."""
    parts = []
    for group, title in GROUPS.items():
        shown = [one for one in shown_experiments()
                 if one.section.id.split(".")[0] == group and not one.part]
        parts += [f"## {cell(title)}", "",
                  *grid_table(("numbers", "experiment", "verdicts"), map(experiment_row, shown))]
        if missing.get(group):
            parts += [f"Not measured: [{len(missing[group])} printed numbers]"
                      f"(#{missing_label(group)}).", ""]
    return "\n".join(parts)


def experiment_row(one):
    """Return the cells of an experiment."""
    verdicts = "; ".join(filter(None, (verdict_counts(one.section.rows, name, kinds)
                                       for name, kinds in COUNTED.items())))
    known, title = declared().get(one.section.id), cell(one.title)
    if known:
        text = one.title.replace("`", "")        # a role's text holds no other markup
        title = f"{{source}}`{text} <{source_of(known.function)}>`"
    return [f"[{cell(name_of(one))}](#{label(one)})", title, verdicts]


def verdict_counts(rows, name, kinds):
    """Return the counts of verdicts on rows of some kinds as text, empty where there are none."""
    counts = Counter(row.verdict for row in rows if row.kind in kinds)
    text = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    return f"{name}: {text}" if text else ""


def source_of(function):
    """Return `path::name` of an experiment's function; the path alone of one made in another."""
    path = inspect.getsourcefile(function)
    file = path.removeprefix(f"{ROOT}/")
    name = function.__qualname__
    return file if "<locals>" in name else f"{file}::{name}"
