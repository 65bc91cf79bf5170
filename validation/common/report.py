"""The report: everything in ``results/<profile>/`` and every printed number, as HTML and Markdown.

It is written from the result files, the papers' targets and the drawn figures alone: no experiment
is imported and nothing is computed but ratios and counts.
"""

import base64
import io
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image

from .record import Measurement, write_whole
from .registry import GROUPS
from .results import ProfileResults

TEMPLATES = Path(__file__).parents[1] / "templates"
SHOWN_ROWS = 40          # of a table; a longer one is named and linked
PREVIEW_WIDTH = 960      # [pixels] of a figure in report.html, which links to the drawn file
PREVIEW_QUALITY = 45     # of its WebP compression, 0 to 100
VERDICTS = ("pass", "miss", "info")
PART = re.compile(r"(?:0|[^.]*[A-Za-z-]\d+)\.\d+(?![^.])|[^.]+")      # of an id; see `_words`


class ReportRow(NamedTuple):
    """One record, as the reader sees it; `key` is the paper or group for which it counts."""

    key: str
    what: str
    paper: str
    rule: str
    ours: str
    ratio: str
    verdict: str
    scale: str
    note: str


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
    counts: Counter
    sections: list
    missing: list
    settings: list
    overruled: int


def write_report(folder, profile, targets):
    """Write report.html and report.md into `folder` and return their paths."""
    content = {"profile": profile, "chapters": chapters(ProfileResults(folder), targets),
               "machine": machine(ProfileResults(folder)), "verdicts": VERDICTS}
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
    figures, by_id = _figures(results.folder), printed(targets)
    sections = [_section(results, id, figures.get(id, []), by_id)
                for id in sorted({*results.ids(), *figures})]
    done = {r.target for id in results.ids() for r in results.records(id)}
    every = [_chapter(key, sections, targets.values(), done) for key in GROUPS]
    return [c for c in every if c.sections or c.missing or c.settings]


def printed(targets):
    """Return {id: (`Target`, text of its places in print, with values printed again)}."""
    repeated = {}
    for target in targets.values():
        if target.again:
            repeated.setdefault(target.again, []).append(
                f"{target.paper_ref}: {quantity(target.value, target.unit)}")
    return {id: (target, "; ".join([target.paper_ref, *repeated.get(id, [])]))
            for id, target in targets.items()}


def _chapter(key, sections, targets, done):
    counts = Counter(row.verdict for s in sections for row in s.rows if row.key == key)
    targets = [t for t in targets if _group(t.id) == key]
    left = [t for t in targets if done.isdisjoint((t.id, t.again)) and not overruled(t)]
    return Chapter(key, GROUPS[key], counts, [s for s in sections if _group(s.id) == key],
                   missing=[t for t in left if t.kind != "setting"],
                   settings=[t for t in left if t.kind == "setting"],
                   overruled=sum(overruled(t) for t in targets))


def _group(id):
    return id.split(".")[0]


def overruled(target):
    """Return whether a ruling has replaced a printed value, which stays for the record only."""
    return target.id.split(".")[1] == "printed"


def _section(results, id, figures, by_id):
    records = results.records(id) if id in results.ids() else []
    numbers = [r for r in records if not _is_remark(r, id)]
    return Section(id, [r.note for r in records if _is_remark(r, id)],
                   [_row(r, id, *by_id.get(r.target, (None, ""))) for r in numbers],
                   [_table(results, id, name) for name in results.tables(id)], figures,
                   provenance=_provenance(records[0]) if records else "no results")


def _is_remark(record, id):
    return record.target == id and record.comparator == "info"


def _provenance(record):
    return (f"{record.seconds:.1f} s, {record.date}, commit {record.commit}, seed {record.seed}: "
            f"{record.command}")


def _row(record, id, target, where):
    key = _group(target.id if target else id)
    what = f"{target.what} ({where})" if target else _words(record, id)
    doubt = f" ({target.confidence})" if target and target.confidence != "exact" else ""
    return ReportRow(key, what, quantity(record.paper, record.unit) + doubt, rule(record),
               quantity(record.value, record.unit), ratio(record), record.verdict, record.scale,
               record.note)


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


def rule(record):
    """Return the accepted range as text."""
    if isinstance(record.bound, tuple):
        low, high = (f"{end:.4g}" for end in record.bound)
        return f"{low} … {high}" if low != high else f"= {low}"
    if record.bound is not None:
        return f"{'≤' if record.comparator == '<=' else '≥'} {record.bound:.4g}"
    return {"runs": "must run"}.get(record.comparator, "")


def ratio(record):
    """Return ours over the paper's, where that is a number."""
    if record.value is None or not record.paper:
        return "—"
    return f"{record.value / record.paper:.3g}"


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
    """Return the table "paper, experiment, status" of results in Markdown, or a sentence."""
    if not results.ids():
        return "No results are published yet; `make reproduce` makes those of the quick profile."
    lines = ["| paper | experiment | status |", "|---|---|---|"]
    for chapter in chapters(results, targets):
        lines += [_status_line(chapter.title, s.id, _verdict_counts(s.rows))
                  for s in chapter.sections if s.rows]
        if chapter.missing:
            left = len(chapter.missing)
            noun = "printed result" if left == 1 else "printed results"
            lines.append(_status_line(chapter.title, "", f"not yet: {left} {noun}"))
    return "\n".join(lines)


def _status_line(title, id, status):
    experiment = f"`{id}`" if id else ""
    return f"| {title.split(':')[0]} | {experiment} | {status} |"


def _verdict_counts(rows):
    verdicts = [row.verdict for row in rows]
    shown = [f"{verdicts.count(v)} {v}" for v in ("pass", "miss", "info") if v in verdicts]
    return ", ".join(shown)
