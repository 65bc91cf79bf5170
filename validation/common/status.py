"""The table "paper, experiment, status" of published results, in Markdown."""

from .report import chapters


def status_table(results, targets):
    """Return the table, or a sentence where there are no results."""
    if not results.ids():
        return "No results are published yet; `make reproduce` makes those of the quick profile."
    lines = ["| paper | experiment | status |", "|---|---|---|"]
    for chapter in chapters(results, targets):
        lines += [_line(chapter.title, s.id, _counts(s.rows)) for s in chapter.sections if s.rows]
        if chapter.missing:
            left = len(chapter.missing)
            noun = "printed result" if left == 1 else "printed results"
            lines.append(_line(chapter.title, "", f"not yet: {left} {noun}"))
    return "\n".join(lines)


def _line(title, id, status):
    experiment = f"`{id}`" if id else ""
    return f"| {title.split(':')[0]} | {experiment} | {status} |"


def _counts(rows):
    verdicts = [row.verdict for row in rows]
    shown = [f"{verdicts.count(v)} {v}" for v in ("pass", "miss", "info") if v in verdicts]
    return ", ".join(shown)
