"""The report: everything in ``results/<profile>/`` and every printed number as HTML, and a summary
of it in Markdown.

It is written from the result files, the papers' targets and the drawn figures alone: no experiment
is imported and nothing is computed but verdicts, ratios and counts.
"""

import base64
import io
import math
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image

from .judge import VERDICTS
from .record import Measurement, write_whole
from .registry import GROUPS
from .results import ProfileResults
from .standing import read_markers
from .summary import NO_RATIO, STATE_NAMES, ratio_text, selected, verdict_text
from .verdicts import VARIANTS, judged, overruled, printed_counts

TEMPLATES = Path(__file__).parents[1] / "templates"
SHOWN_ROWS = 40          # of a table; a longer one is named and linked
PREVIEW_WIDTH = 960      # [pixels] of a figure in report.html, which links to the drawn file
PREVIEW_QUALITY = 45     # of its WebP compression, 0 to 100
KINDS = ("result", "setting", "variant", "own")
OTHERS = {"setting": "Printed settings", "variant": "Printed numbers by another method, of another "
          "body or at another size", "own": "Our own checks"}
PART = re.compile(r"(?:0|[^.]*[A-Za-z-]\d+)\.\d+(?![^.])|[^.]+")      # of an id; see `_words`


class ReportRow(NamedTuple):
    """One record, as the reader sees it; `key` is the paper or group for which it counts."""

    key: str
    kind: str           # of KINDS
    id: str
    what: str
    paper: str
    rule: str
    ours: str
    ratio: str
    verdict: str
    scale: str
    note: str
    why: str            # of the tolerance, or of a verdict "chosen"


class ReportTable(NamedTuple):
    """A table of an experiment; rows stay empty where there are too many to show."""

    name: str
    file: str
    columns: list
    rows: list
    length: int


class Figure(NamedTuple):
    """A drawn figure: `path` is relative to the report, `data` is a smaller WebP in base64."""

    name: str
    path: str
    caption: str
    data: str


class Section(NamedTuple):
    """One experiment in the report."""

    id: str
    remarks: list
    rows: list
    tables: list
    figures: list
    provenance: str


class Chapter(NamedTuple):
    """One paper or group: its experiments, and the printed numbers that still have none."""

    key: str
    title: str
    printed: Counter        # of STATE_NAMES, over the printed results
    counts: dict            # {kind: `Counter` of verdicts on the records of the other kinds}
    sections: list
    missing: list
    settings: list
    overruled: int


def write_report(folder, profile, targets):
    """Write report.html, which has everything, and the short report.md into `folder`; return
    their paths.
    """
    results = ProfileResults(folder)
    parts = chapters(results, targets)
    content = {"profile": profile, "chapters": parts, "machine": machine(results),
               "verdicts": VERDICTS, "states": STATE_NAMES, "others": OTHERS,
               "claims": claims(parts, targets), "variants": VARIANTS,
               "misses": listed(parts, "miss", lambda id: cause_of(targets, id)),
               "chosen": listed(parts, "chosen", targets.choice),
               "marked": len({id for one in read_markers(Path(folder).parent, profile)
                              for id in one.ids}),
               "counted_by_kind": counted_by_kind}
    paths = []
    for name in ("report.html", "report.md"):
        text = _environment().get_template(f"{name}.jinja").render(content)
        paths.append(Path(folder) / name)
        write_whole(paths[-1], text.encode())
    return paths


def _environment():
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, autoescape=lambda name: name.endswith(".html.jinja"))
    environment.filters["cell"] = lambda text: str(text).replace("|", "\\|").replace("\n", " ")
    return environment


def chapters(results, targets):
    """Return a `Chapter` per group that has results or printed numbers."""
    figures, places = _figures(results.folder), printed(targets)
    sections = [_section(results, id, figures.get(id, []), targets, places)
                for id in sorted({*results.ids(), *figures})]
    records = [r for id in results.ids() for r in results.records(id)]
    every = [_chapter(key, sections, targets, records) for key in GROUPS]
    return [c for c in every if c.sections or c.missing or c.settings]


def claims(parts, targets):
    """Return {key of a chapter: [(claim, verdicts, ratios)]} of the headlines of the papers."""
    rows = [(section.id, row) for chapter in parts for section in chapter.sections
            for row in section.rows if row.kind in ("result", "variant", "setting")]
    return {paper: [(headline.claim, verdict_text(one), ratio_text(one.shown))
                    for headline in headlines
                    for one in [selected(headline, targets, rows)]]
            for paper, headlines in targets.headlines.items()}


def listed(parts, verdict, reason):
    """Return {key of a chapter: [(id of the experiment, `ReportRow`, reason(id of the row))]} of
    the printed results with a verdict.
    """
    found = {}
    for section in (section for chapter in parts for section in chapter.sections):
        for row in section.rows:
            if (row.kind, row.verdict) == ("result", verdict):
                found.setdefault(row.key, []).append((section.id, row, reason(row.id)))
    return found


def cause_of(targets, number):
    """Return the cause of a missed number as text."""
    cause = targets.cause(number)
    return cause.sentence if cause else "not known"


def counted_by_kind(rows):
    """Return the counts of verdicts of an experiment as text, by kind of its numbers."""
    words = {"result": "printed", "variant": "by another method", "setting": "settings",
             "own": "our checks"}
    parts = [(words[kind], Counter(row.verdict for row in rows if row.kind == kind))
             for kind in KINDS]
    return "; ".join(f"{name}: {', '.join(f'{n} {verdict}' for verdict, n in found.items())}"
                     for name, found in parts if found)


def printed(targets):
    """Return {id: text of its places in print, with values printed again}."""
    repeated = {}
    for target in targets.values():
        if target.again:
            repeated.setdefault(target.again, []).append(
                f"{target.paper_ref}: {quantity(target.value, target.unit)}")
    return {id: "; ".join([target.paper_ref, *repeated.get(id, [])])
            for id, target in targets.items()}


def _chapter(key, sections, targets, records):
    rows = [row for s in sections for row in s.rows if row.key == key]
    counts = {kind: Counter(row.verdict for row in rows if row.kind == kind) for kind in KINDS}
    done = {r.target for r in records}
    of_paper = [t for t in targets.values() if _group(t.id) == key]
    left = [t for t in of_paper if t.id not in done and not t.again and not overruled(t)]
    return Chapter(key, GROUPS[key], printed_counts(key, records, targets), counts,
                   [s for s in sections if _group(s.id) == key],
                   missing=[t for t in left if t.kind != "setting"],
                   settings=[t for t in left if t.kind == "setting"],
                   overruled=sum(map(overruled, of_paper)))


def _group(id):
    return id.split(".")[0]


def _section(results, id, figures, targets, places):
    records = results.records(id) if id in results.ids() else []
    remarks = [r.note for r in records if r.comparator == "remark"]
    rows = [_row(r, id, targets, places) for r in records if r.comparator != "remark"]
    return Section(id, remarks, rows, [_table(results, id, name) for name in results.tables(id)],
                   figures, provenance=_provenance(records[0]) if records else "no results")


def _provenance(record):
    return (f"{record.seconds:.1f} s, {record.date}, commit {record.commit}, seed {record.seed}: "
            f"{record.command}")


def _row(record, id, targets, places):
    one = judged(record, targets)
    target, paper = one.target, one.target.value if one.target else record.paper
    what = _words(record, id)
    if target:
        others = "".join(f"; {VARIANTS[word]}" for word in one.variants)
        what = f"{target.what} ({places[target.id]}){others}"
    doubt = f" ({target.confidence})" if target and target.confidence != "exact" else ""
    return ReportRow(_group(target.id if target else id), one.kind, record.target, what,
                     quantity(paper, record.unit) + doubt, rule(one.interval, record.comparator),
                     quantity(record.value, record.unit), ratio(record.value, paper), one.verdict,
                     record.scale, record.note, _why(one, record, targets))


def _why(one, record, targets):
    """Return the reason of a verdict "chosen", or of the tolerance of a printed number."""
    if one.verdict == "chosen":
        return targets.choice(record.target)
    return targets.why(one.target.id) if one.target else ""


def _words(record, id):
    """Return the text of a number without a printed one: `verification.fall.error_x` -> `error x`.

    Dots part the words, but for decimal points: after a 0, and after a number behind a letter or
    a hyphen, so that `body.nu0.45` has two parts and `mls.2.1` three.
    """
    if record.target == id:
        return "the experiment as a whole"
    names = PART.findall(record.target.removeprefix(f"{id}."))
    return ", ".join(name.replace("_", " ") for name in names)


def quantity(value, unit):
    """Return a number with its unit as a short text."""
    if value is None:
        return "—"
    return f"{value:.4g} {unit}".removesuffix(" 1").removesuffix(" nondim").strip()


def rule(interval, comparator):
    """Return an accepted interval as text."""
    if comparator == "runs":
        return "must run"
    ends = [f"{end:.4g}" for end in interval if math.isfinite(end)]
    if len(ends) == 2:
        return " … ".join(ends) if ends[0] != ends[1] else f"= {ends[0]}"
    return f"{'≤' if math.isinf(interval[0]) else '≥'} {ends[0]}" if ends else ""


def ratio(value, paper):
    """Return ours over the paper's, where that is a number."""
    return f"{value / paper:.3g}" if value is not None and paper else NO_RATIO


def _table(results, id, name):
    columns, rows = results.rows(id, name)
    shown = rows if len(rows) <= SHOWN_ROWS else []
    return ReportTable(name, f"{id}.{name}.csv", columns, shown, len(rows))


def _figures(folder):
    """Return the figures by experiment, which is named in the drawn file."""
    by_experiment = {}
    for file in sorted((Path(folder) / "figures").glob("*.png")):
        with Image.open(file) as image:
            owner, caption = image.text["Source"], image.text["Description"]
            data = base64.b64encode(preview(image)).decode()
        figure = Figure(file.stem, f"figures/{file.name}", caption, data)
        by_experiment.setdefault(owner, []).append(figure)
    return by_experiment


def preview(image):
    """Return a picture as WebP bytes, at most PREVIEW_WIDTH pixels wide."""
    width = min(image.width, PREVIEW_WIDTH)
    size = width, round(image.height * width / image.width)
    buffer = io.BytesIO()
    image.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(
        buffer, "WEBP", quality=PREVIEW_QUALITY, method=6)
    return buffer.getvalue()


def machine(results):
    """Return facts of the runs behind the report: commits, cores, dates, versions, seconds."""
    first = [results.records(id)[0] for id in results.ids()]
    return {"experiments": len(first), "seconds": sum(r.seconds for r in first),
            "commits": _distinct(first, "commit"), "cores": _distinct(first, "cores"),
            "dates": _ends(sorted(r.date[:10] for r in first)),
            "versions": _distinct(first, "versions")}


def _distinct(records: list[Measurement], field):
    values = [getattr(r, field) for r in records]
    texts = [", ".join(f"{k} {v}" for k, v in x.items()) if isinstance(x, dict) else str(x)
             for x in values]
    return "; ".join(dict.fromkeys(texts)) or "none"


def _ends(dates):
    return " to ".join(dict.fromkeys((dates[0], dates[-1]))) if dates else "none"


def status_table(results, targets):
    """Return the table of the printed results of each paper in Markdown, or a sentence."""
    if not results.ids():
        return "No results are published yet; `make reproduce` makes those of the quick profile."
    lines = [f"| paper | printed | {' | '.join(STATE_NAMES.values())} |",
             f"|---|---:|{'---:|' * len(STATE_NAMES)}"]
    for chapter in chapters(results, targets):
        if total := sum(chapter.printed.values()):
            counts = " | ".join(str(chapter.printed[state]) for state in STATE_NAMES)
            lines.append(f"| {chapter.title.split(':')[0]} | {total} | {counts} |")
    return "\n".join(lines)
