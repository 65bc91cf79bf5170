"""Verdicts and ratios of the numbers that stand for the claims of the papers.

Rows are pairs (name of the place where it is shown, `report.ReportRow`).
"""

from collections import Counter
from fnmatch import fnmatchcase
from typing import NamedTuple

from .verdicts import printed_id

NO_RATIO = "—"      # of a number to a printed one, where either is missing
STATE_NAMES = {"pass": "reproduced", "better": "better", "miss": "missed",
               "chosen": "chosen on these runs", "uncredited": "as printed, without credit",
               "info": "another machine", "other": "another method or body",
               "absent": "not measured"}


class Selected(NamedTuple):
    """The numbers that stand for a headline."""

    ids: list           # of printed numbers
    printed: list       # pairs of the paper's method
    variants: list      # pairs of other methods and bodies

    @property
    def shown(self):
        """Return the pairs whose ratios are given: of the paper's method, or else all others."""
        return self.printed or self.variants


def selected(headline, targets, pairs):
    """Return the `Selected` of a `targets.Headline`."""
    ids = [id for id in targets if not targets[id].again
           and any(fnmatchcase(id, pattern) for pattern in headline.ids)]
    by_id = {}
    for pair in pairs:
        by_id.setdefault(printed_id(pair[1].id, targets)[0], []).append(pair)
    found = [pair for id in ids for pair in by_id.get(id, ())]
    return Selected(ids, [pair for pair in found if pair[1].id in targets],
                    [pair for pair in found if pair[1].id not in targets])


def verdict_text(one):
    """Return the counts of verdicts on the paper's own method, then on each other one."""
    parts = [counted([row for _, row in one.printed])] if one.printed else []
    by_words = {}
    for _, row in one.variants:
        words = row.id.removeprefix(next(id for id in one.ids if row.id.startswith(f"{id}.")))
        by_words.setdefault(words.removeprefix(".").replace(".", ", "), []).append(row)
    parts += [f"*{words}*: {counted(rows)}" for words, rows in by_words.items()]
    absent = len(one.ids) - len({row.id for _, row in one.printed})
    if absent and not one.variants:
        parts.append(f"{absent} not measured")
    return "; ".join(parts)


def counted(rows):
    """Return the counts of verdicts as text."""
    found = Counter(STATE_NAMES[row.verdict] for row in rows)
    return ", ".join(f"{count} {name}" for name, count in found.items())


def ratio_text(pairs):
    """Return the range of the ratios of numbers."""
    values = sorted(float(row.ratio) for _, row in pairs if row.ratio != NO_RATIO)
    if not values:
        return NO_RATIO
    ends = f"{values[0]:.2g}", f"{values[-1]:.2g}"
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)
