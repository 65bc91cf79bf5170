"""The table of outcomes, `results/mutations.csv`: one row for each experiment."""

import csv
import io
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from ..common.record import write_whole
from ..common.results import RESULTS

FILE = RESULTS / "mutations.csv"


class Row(NamedTuple):
    """The effect of mutations on the checks of an experiment at the quick profile."""

    experiment: str
    mutations: str          # names of those that broke a check, in the order of the list
    without_effect: str     # names of those that broke none
    checks: int             # judged numbers that pass as the experiment is
    broken: int             # of these, missed under a mutation at least
    unbroken: str           # ids of the others, without the leading id of the experiment
    commit: str
    date: str


def row_of(outcomes, commit):
    """Return the `Row` of an experiment from the `Outcome`s of its mutations."""
    first = outcomes[0]
    broken = frozenset().union(*(one.broken for one in outcomes))
    left = sorted(id.removeprefix(f"{first.experiment}.") for id in first.passing - broken)
    return Row(first.experiment, names_of(one for one in outcomes if one.broken),
               names_of(one for one in outcomes if not one.broken), len(first.passing),
               len(broken), "; ".join(left), commit, datetime.now(UTC).strftime("%Y-%m-%d"))


def merged(stored, row):
    """Return a `Row` with what it and an earlier one of the experiment, or None, found: of other
    mutations.
    """
    if stored is None or stored.checks != row.checks:
        return row
    left = [id for id in parts(row.unbroken) if id in parts(stored.unbroken)]
    effective = dict.fromkeys([*parts(stored.mutations), *parts(row.mutations)])
    others = dict.fromkeys([*parts(stored.without_effect), *parts(row.without_effect)])
    return row._replace(
        mutations="; ".join(effective), unbroken="; ".join(left), broken=row.checks - len(left),
        without_effect="; ".join(name for name in others if name not in effective))


def parts(text):
    """Return the list of names in a cell."""
    return text.split("; ") if text else []


def names_of(outcomes):
    """Return the names of the outcomes' mutations, and which ended in an error."""
    return "; ".join(f"{one.mutation} (raised)" if one.raised else one.mutation
                     for one in outcomes)


def read(path=FILE):
    """Return {experiment: `Row`} of a table; empty where there is none."""
    if not Path(path).exists():
        return {}
    with open(path, newline="", encoding="utf-8") as file:
        rows = [Row(**{**row, "checks": int(row["checks"]), "broken": int(row["broken"])})
                for row in csv.DictReader(file)]
    return {row.experiment: row for row in rows}


def write(path, rows):
    """Write the rows of a table, sorted by experiment."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Row._fields)
    writer.writerows(sorted(rows))
    write_whole(path, text.getvalue().encode())
