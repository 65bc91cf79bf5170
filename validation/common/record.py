"""One number of one experiment, and the only place where numbers are judged.

Every comparator is an interval of accepted values, so that a verdict is one question: does the
value lie in it?

    <=     value <= factor * paper           or value <= bound        (factor 1)
    >=     value >= paper / factor           or value >= bound        (factor 1)
    ~      paper / factor <= value <= paper * factor                  (factor 3)
    =      abs(value - paper) <= tolerance * abs(paper)               (tolerance 1e-9: round-off)
    band   bound[0] <= value <= bound[1]
    info   everything; recorded for the reader, not judged
    runs   nothing; written for an experiment that raised, so that the report shows it
"""

import math
from pathlib import Path
from typing import NamedTuple

import msgspec

from mpm_ref.store.atomic import write_bytes

Bound = float | tuple[float, float]
COMPARATORS = ("<=", ">=", "~", "=", "band", "info", "runs")
SAME_SIZE = 3.0
ROUND_OFF = 1e-9


class Measurement(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A value and the printed or analytic one; `results/<profile>/<id>.json` lists them."""

    target: str                     # id of the number, of the paper's target where there is one
    value: int | float | None       # ours; None where the run gave no finite number
    unit: str
    paper: int | float | None       # the printed or analytic value
    comparator: str
    verdict: str                    # "pass", "miss" or "info": see `judge`
    scale: str                      # at which size it was run, against the paper's
    seconds: float                  # wall time of the whole experiment
    seed: int
    command: str
    commit: str
    date: str
    cores: int
    note: str = ""
    bound: Bound | None = None      # end or ends of the interval that was accepted
    cpu_seconds: float = 0.0
    versions: dict[str, str] = {}
    workers: int = 1                # experiments that shared the cores


class Criterion(NamedTuple):
    """The rule by which a value is judged; fields that a comparator does not use must stay None."""

    comparator: str
    paper: float | None = None
    bound: Bound | None = None
    factor: float | None = None
    tolerance: float | None = None


def judge(value, rule):
    """Return the verdict "pass", "miss" or "info" and the interval (low, high) that decided.

    A value that is None, NaN or infinite misses, whatever the rule. Raises ValueError where the
    rule is incomplete or contradicts itself.
    """
    low, high = accepted(rule)
    if rule.comparator == "info":
        return "info", (low, high)
    inside = value is not None and math.isfinite(value) and low <= value <= high
    return ("pass" if inside else "miss"), (low, high)


def accepted(rule):
    """Return the interval (low, high) of the values that pass."""
    if rule.comparator not in COMPARATORS:
        raise ValueError(f"unknown comparator {rule.comparator!r}; use one of {COMPARATORS}")
    _refuse_unused(rule)
    return _INTERVALS[rule.comparator](rule)


def _at_most(rule):
    return -math.inf, _end(rule, rule.factor or 1.0)


def _at_least(rule):
    return _end(rule, 1.0 / (rule.factor or 1.0)), math.inf


def _end(rule, factor):
    """Return the end of a one-sided interval: the bound, or the paper's value with slack."""
    if rule.bound is not None:
        return float(rule.bound)
    if rule.paper is None:
        raise ValueError(f"comparator {rule.comparator!r} needs paper= or bound=; neither is given")
    if factor != 1.0 and rule.paper <= 0.0:
        raise ValueError(f"a factor on paper = {rule.paper} widens nothing; give bound= instead")
    return factor * rule.paper


def _same_size(rule):
    if not rule.paper:
        raise ValueError(f"comparator '~' needs a paper value that is not zero, not {rule.paper}")
    factor = rule.factor or SAME_SIZE
    return tuple(sorted((rule.paper / factor, rule.paper * factor)))


def _equal(rule):
    if rule.paper is None:
        raise ValueError("comparator '=' needs paper=; none was given")
    tolerance = ROUND_OFF if rule.tolerance is None else rule.tolerance
    return rule.paper - tolerance * abs(rule.paper), rule.paper + tolerance * abs(rule.paper)


def _band(rule):
    try:
        low, high = rule.bound
    except TypeError:
        raise ValueError(f"comparator 'band' needs bound=(low, high), not {rule.bound}") from None
    return float(low), float(high)


_INTERVALS = {
    "<=": _at_most, ">=": _at_least, "~": _same_size, "=": _equal, "band": _band,
    "info": lambda rule: (-math.inf, math.inf),
    "runs": lambda rule: (math.inf, -math.inf),
}
_USED = {"<=": {"bound", "factor"}, ">=": {"bound", "factor"}, "~": {"factor"},
         "=": {"tolerance"}, "band": {"bound"}, "info": set(), "runs": set()}


def _refuse_unused(rule):
    for name in ("bound", "factor", "tolerance"):
        given = getattr(rule, name)
        if given is not None and name not in _USED[rule.comparator]:
            raise ValueError(f"{name} = {given} means nothing to comparator {rule.comparator!r}")
    if rule.factor is not None and rule.factor < 1.0:
        raise ValueError(f"factor = {rule.factor}: slack is a factor >= 1, in either direction")
    if rule.bound is not None and rule.factor is not None:
        raise ValueError("give bound= or factor=, not both: a bound needs no factor")


def finite_ends(interval):
    """Return the interval as it is stored: its finite end, both of them, or None."""
    ends = [end for end in interval if math.isfinite(end)]
    return tuple(ends) if len(ends) == 2 else (ends[0] if ends else None)


def write_records(path, records):
    """Write a list of `Measurement`s as readable JSON."""
    write_whole(path, msgspec.json.format(msgspec.json.encode(records), indent=1) + b"\n")


def read_records(path):
    """Read the records of a file. Raises ValueError with the file and the wrong field."""
    try:
        return msgspec.json.decode(Path(path).read_bytes(), type=list[Measurement])
    except msgspec.DecodeError as error:
        raise ValueError(f"{path} is not a list of records: {error}; run the experiment again") \
            from error


def write_whole(path, content):
    """Write bytes so that a reader, or a crash, sees the old file or the new one, never a part."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content)
