"""The only place where numbers are judged: a value, a rule, and the verdict that follows.

Every comparator is an interval of accepted values, so that a verdict is one question: does the
value lie in it? A value that is None, NaN or infinite misses, whatever the comparator.

    <=       value <= factor * paper, or value <= bound          (factor 1 where none is given)
    >=       value >= paper / factor, or value >= bound          (factor 1 where none is given)
    <        value <= factor * paper, where the print names a bound: nothing is better than within
    >        value >= paper / factor, likewise
    ~        paper / factor <= value <= paper * factor; or, with digits, rounds to the printed one
    =        abs(value - paper) <= tolerance * abs(paper)        (tolerance 1e-9: round-off)
    band     bound[0] <= value <= bound[1]
    info     everything finite; ours alone, for the reader
    none     everything finite; printed, of another machine
    runs     nothing; written for an experiment that raised, so that the report shows it
    remark   no number: a sentence on the entire experiment
"""

import math
from typing import NamedTuple

Bound = float | tuple[float, float]
COMPARATORS = ("<=", ">=", "<", ">", "~", "=", "band", "info", "none", "runs", "remark")
UNJUDGED = ("info", "none", "remark")
VERDICTS = ("pass", "better", "miss", "chosen", "uncredited", "info")
ROUND_OFF = 1e-9
CLEARLY = 1.25      # the least ratio by which a value is better than the printed one


class Criterion(NamedTuple):
    """The rule by which a value is judged; fields that a comparator does not use must stay None."""

    comparator: str
    paper: float | None = None
    bound: Bound | None = None
    factor: float | None = None
    tolerance: float | None = None
    digits: int | None = None


def judge(value, rule):
    """Return the verdict "pass", "miss" or "info" and the interval (low, high) that decided.

    Raises ValueError where the rule is incomplete or contradicts itself.
    """
    low, high = accepted(rule)
    return verdict_in((low, high), value, rule.comparator), (low, high)


def verdict_in(interval, value, comparator):
    """Return the verdict on a value whose accepted interval is given."""
    if value is None or not math.isfinite(value):
        return "info" if comparator == "remark" else "miss"
    if comparator in UNJUDGED:
        return "info"
    return "pass" if interval[0] <= value <= interval[1] else "miss"


def judge_printed(value, rule):
    """Return the verdict on a printed number, as `judge`, or "better" where the value is on the
    good side of a one-sided claim by more than its factor and by more than `CLEARLY`.
    """
    verdict, interval = judge(value, rule)
    if verdict == "pass" and rule.comparator in ("<=", ">=") and rule.paper > 0.0:
        least = max(CLEARLY, rule.factor or 1.0)
        smaller = rule.comparator == "<="
        clearly = value * least < rule.paper if smaller else value > least * rule.paper
        verdict = "better" if clearly else "pass"
    return verdict, interval


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
    if (rule.factor is None) == (rule.digits is None):
        raise ValueError(f"comparator '~' needs factor= or digits=, not {rule.factor} and "
                         f"{rule.digits}: no width fits every number")
    if rule.digits is not None:
        return rounded(rule.paper, rule.digits)
    return tuple(sorted((rule.paper / rule.factor, rule.paper * rule.factor)))


def rounded(value, digits):
    """Return the interval that is rounded to a number of so many digits."""
    half = 0.5 * 10.0 ** (math.floor(math.log10(abs(value))) + 1 - digits)
    return value - half, value + half


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


def _everything(rule):
    return -math.inf, math.inf


def _nothing(rule):
    return math.inf, -math.inf


_INTERVALS = {
    "<=": _at_most, ">=": _at_least, "<": _at_most, ">": _at_least, "~": _same_size, "=": _equal,
    "band": _band, "info": _everything, "none": _everything, "remark": _everything,
    "runs": _nothing,
}
_USED = {"<=": {"bound", "factor"}, ">=": {"bound", "factor"}, "<": {"factor"}, ">": {"factor"},
         "~": {"factor", "digits"}, "=": {"tolerance"}, "band": {"bound"}}


def _refuse_unused(rule):
    for name in ("bound", "factor", "tolerance", "digits"):
        given = getattr(rule, name)
        if given is not None and name not in _USED.get(rule.comparator, ()):
            raise ValueError(f"{name} = {given} means nothing to comparator {rule.comparator!r}")
    if rule.factor is not None and rule.factor < 1.0:
        raise ValueError(f"factor = {rule.factor}: slack is a factor >= 1, in either direction")
    if rule.bound is not None and rule.factor is not None:
        raise ValueError("give bound= or factor=, not both: a bound needs no factor")


def finite_ends(interval):
    """Return the interval as it is stored: its finite end, both of them, or None."""
    ends = [end for end in interval if math.isfinite(end)]
    return tuple(ends) if len(ends) == 2 else (ends[0] if ends else None)


def interval_of(comparator, bound):
    """Return the interval (low, high) of a stored comparator and bound."""
    if isinstance(bound, tuple):
        return bound
    if bound is None:
        return _nothing(None) if comparator == "runs" else _everything(None)
    return (-math.inf, bound) if comparator in ("<=", "<") else (bound, math.inf)
