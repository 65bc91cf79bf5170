"""The table of what changed between two sets of records, with the reasons for the worse."""

from collections import Counter

from validation.common import change_table

from .markdown import cell, grid_table

FILE = "results/generated/changes.md"
WORDS = {
    "worse": "verdicts that got worse", "improved": "verdicts that improved",
    "other verdict": "other changes of a verdict",
    "moved": "numbers that moved by more than their scatter, with the same verdict",
    "lost": "numbers that are no longer recorded", "new": "new numbers",
}
LISTED = "worse", "improved", "other verdict"
SIDES = {"lost": 0, "new": 1}       # which of a record's two verdicts there is


def pages():
    """Return {path: text} of the page, from `results/changes.csv` and its reasons."""
    return {FILE: "\n".join(lines(change_table.read(), change_table.read_reasons()))}


def lines(records, reasons):
    """Yield the counts, and the tables of changed verdicts, from `ChangedRecord`s."""
    counts = Counter(one.kind for one in records)
    yield f"Since commit `{reasons.old}`:\n"
    yield from grid_table(("number", "of"), ([str(counts[kind]), text + by_verdict(records, kind)]
                                             for kind, text in WORDS.items()))
    for kind in LISTED:
        group = [one for one in records if one.kind == kind]
        if group:
            yield f"**{WORDS[kind].capitalize()}**\n"
            yield from grid_table(*table(kind, group, reasons))


def by_verdict(records, kind):
    """Return how many records of a kind have which verdict, as text; "" where they have two."""
    if kind not in SIDES:
        return ""
    counts = Counter(one.verdicts[SIDES[kind]] for one in records if one.kind == kind)
    return f": {', '.join(f'{n} {verdict}' for verdict, n in counts.most_common())}"


def table(kind, group, reasons):
    """Return the header and the rows of the records of a kind."""
    header = ("number", "before", "now", "verdict")
    rows = (cells(one) for one in group)
    if kind != "worse":
        return header, rows
    return (*header, "why"), ([*cells(one), cell(reasons.of_target(one.target) or "not known")]
                              for one in group)


def cells(record):
    """Return the cells of a record."""
    values = ("none" if value is None else f"{value:.3g}" for value in record.values)
    verdicts = (verdict or "none" for verdict in record.verdicts)
    return [f"`{record.target}`", *values, " → ".join(verdicts)]
